"""Derivatives of the written-out models against finite differences and linearity."""

from functools import partial
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import ArrayLike

import hybridyn
from benchmarks.operations import total
from hybridyn.compiled.code.rules import check, compacted, trimmed
from hybridyn.compiled.code.scalars import GUARD_LIMIT
from hybridyn.compiled.derivatives import Derivatives
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.program import Worst
from hybridyn.compiled.programs.derivatives.evaluation import BUILDERS, DERIVATIVE_AGREES
from hybridyn.compiled.programs.derivatives.models import direct_derivatives, inverse_derivatives
from hybridyn.compiled.programs.whole_robot import function_of, programs
from hybridyn.compiled.programs.writer import Writer
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.assembly.test_assembly import waves
from tests.compiled import rods
from tests.compiled.test_acting import laws, taking
from tests.oracle import Base
from tests.robots.any_mechanism import any_mechanism
from tests.robots.mechanisms import KINDS, random_mechanism
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused, same_bits
from tests.support.samples import slow

STEP = 1e-4  # [s]; central differences of fourth order leave STEP^4 and rounding over STEP, both near 1e-12
DIFFERENCES = 1e-8
EXACT = 1e-12  # linear in what is changed: rounding alone
#: Rounded posture of the five-bar beside one at which a pivot vanishes, though no rank is lost.
LOST_PIVOT = [-1.070, 3.768, 0.880, 0.691]
SOLVED = 5e-12  # rounding times the condition of the mass matrix: 1e4 for the snake, where 1e-12 is found


@pytest.fixture(scope="module", params=["five_bar", slow("gough_stewart")])
def robot(request: pytest.FixtureRequest) -> hybridyn.HybridRobot:
    return hybridyn.load(request.param)


def rate(values: np.ndarray) -> np.ndarray:
    """Return the time derivative at the middle of five samples, fourth order."""
    out: np.ndarray = (values[0] - 8 * values[1] + 8 * values[3] - values[4]) / (12 * STEP)
    return out


def along_a_motion(robot: hybridyn.HybridRobot) -> tuple[np.ndarray, np.ndarray]:
    """Hold the derivatives of efforts to differences along a motion of the motors.

    Returns:
        The rate of the accelerations by derivatives and by differences, shapes (nv,).
    """
    q, v, a = hybridyn.assemble(robot, motors=waves(robot, 0.4 + STEP * np.arange(-2, 3), 0.03))
    tau = hybridyn.idm(robot, q, v, a)
    J = hybridyn.idm_jacobian(robot, q[2], v[2], a[2])
    found = J["q"] @ v[2] + J["v"] @ a[2] + J["a"] @ rate(a)
    np.testing.assert_allclose(found, rate(tau), atol=DIFFERENCES * np.abs(tau).max())
    J = hybridyn.ddm_jacobian(robot, q[2], v[2], tau[2])
    found = J["q"] @ v[2] + J["v"] @ a[2] + J["tau"] @ rate(tau)
    return found, rate(hybridyn.ddm(robot, q, v, tau))


def test_along_a_closed_motion(robot: hybridyn.HybridRobot, interpreted: None) -> None:
    found, jerk = along_a_motion(robot)
    np.testing.assert_allclose(found, jerk, atol=DIFFERENCES * np.abs(jerk).max())


def test_forces_that_follow_links_have_derivatives_of_efforts(
    robot: hybridyn.HybridRobot, interpreted: None
) -> None:
    """Those of accelerations and over motors are refused."""
    effects = ["default", *laws(taking(robot)[:2])]
    q, v, a = hybridyn.assemble(robot, motors=waves(robot, 0.4 + STEP * np.arange(-2, 3), 0.03))
    tau = hybridyn.idm(robot, q, v, a, effects=effects)
    J = hybridyn.idm_jacobian(robot, q[2], v[2], a[2], effects=effects)
    found = J["q"] @ v[2] + J["v"] @ a[2] + J["a"] @ rate(a)
    np.testing.assert_allclose(found, rate(tau), atol=DIFFERENCES * np.abs(tau).max())
    words = "go module by module.*the derivatives of 'idm' over joints have it"
    for model, coordinates in (("ddm", "joints"), ("idm", "motors"), ("ddm", "motors")):
        asked = partial(Derivatives, robot, model, effects, coordinates=coordinates)
        refused(asked, hybridyn.ModelError, words)


@pytest.mark.parametrize("model", ["idm", "ddm"])
def test_states_without_derivatives_are_refused(
    robot: hybridyn.HybridRobot, interpreted: None, model: str
) -> None:
    q, v, a, tau = random_states(robot, 3)
    derive, last = Derivatives(robot, model), a if model == "idm" else tau
    lost, opened = q.copy(), q.copy()
    lost[1, 0], opened[1, 0] = np.nan, 0.3
    for bad, error, words in (
        (q[:, 1:], hybridyn.TrajectoryError, "q has shape"),
        (q[:, :1], hybridyn.TrajectoryError, "q has shape"),
        (q[:2], hybridyn.TrajectoryError, "have 2, 3, 3 samples"),
        (lost, hybridyn.HybridynError, "q is not finite at sample 1"),
        (opened, hybridyn.HybridynError, "do not close the loops at sample 1"),
    ):  # fmt: skip
        refused(lambda: derive(bad, v, last), error, words)  # noqa: B023
    assert {len(x) for x in derive(q[:0], v[:0], last[:0]).values()} == {0}
    limited = partial(hybridyn.ddm_jacobian, robot, q, v, tau, effects=["default", "limits"])
    refused(limited, hybridyn.ModelError, "'limits' has no derivative")
    refused(lambda: Derivatives(robot, "kinematics"), hybridyn.ModelError, "not of 'kinematics'")


def test_where_pivots_vanish_the_general_path_judges(interpreted: None) -> None:
    robot = hybridyn.load("five_bar")
    q = near_a_lost_pivot(robot, 1e-4)
    v, tau = np.zeros(robot.nv), np.array([0.3, -0.2])
    derive = Derivatives(robot, "ddm")
    assert derive._interpreted.batch("ddm_jacobian", q[None], v[None], tau[None])[1] > GUARD_LIMIT
    linear = hybridyn.ddm(robot, q, v, 2 * tau) - hybridyn.ddm(robot, q, v, tau)
    np.testing.assert_allclose(
        derive(q, v, tau)["tau"] @ tau, linear, atol=DERIVATIVE_AGREES * np.abs(linear).max()
    )
    other = Derivatives(robot, "ddm", coordinates="motors")
    # at 1e-6 the result agrees, but 1e-6 and 2e-2 of the derivatives over q do not
    for distance, of in ((1e-6, derive), (0.0, derive), (0.0, other)):
        q, words = (
            near_a_lost_pivot(robot, distance, q),
            r"not to be trusted at sample 0: the pivots .* vanish",
        )
        refused(partial(of, q, v, tau), hybridyn.SingularityError, words)


def near_a_lost_pivot(
    robot: hybridyn.HybridRobot, distance: float, guess: ArrayLike = LOST_PIVOT
) -> np.ndarray:
    """Return a posture of the five-bar near one at which a pivot vanishes, though no rank is lost."""
    values = [distance - 1.0703831736303813, 0.88]
    motors = dict(zip(robot.motors, values, strict=True))
    return hybridyn.assemble(robot, motors=motors, guess=np.array(guess))[0]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("model", "coordinates"), [("idm", "joints"), ("idm", "motors"), ("ddm", "motors")], ids=str
)
def test_batches_and_casadi(robot: hybridyn.HybridRobot, model: str, coordinates: str) -> None:
    """Single calls have the bits of batches, and the numbers of the program in CasADi."""
    q, v, a, tau = random_states(robot, 3)
    given = {"q": q, "v": v} | ({"a": a} if model == "idm" else {"tau": tau})
    derive = Derivatives(robot, model, coordinates=coordinates)
    many, one = derive(*given.values()), {name: x[1] for name, x in given.items()}
    assert many["q"].shape[:2] == (3, len(robot.motors))
    same_bits(derive(*one.values()), {name: block[1] for name, block in many.items()})
    (_, *found), _ = derive._interpreted.batch(derive._name, *(x[None] for x in one.values()))
    close_to(tuple(x[0] for x in found), tuple(many[name][1].ravel() for name in one), EXACT)


def test_a_library_is_used_that_agrees_with_the_general_path(
    request: pytest.FixtureRequest, empty_cache: Path
) -> None:
    """Not where a number of the model, or of its slopes, is off. Without a compiler CasADi runs them."""
    robot, right = hybridyn.load("five_bar"), Library.batch
    for wrong in (0, 2):

        def bent(self: Library, name: str, *inputs: Array, wrong: int = wrong, **options: Any) -> Any:
            outputs, guard = right(self, name, *inputs, **options)
            outputs[wrong][:, 0] *= 1.001
            return outputs, guard

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Library, "batch", bent)
            words = "differs from the general path by"
            refused(lambda: Derivatives(robot, "ddm"), hybridyn.CompileError, words)
    q, v, _, tau = random_states(robot, 2)
    derive = Derivatives(robot, "ddm")
    assert derive.library is not None
    built, one = derive(q, v, tau), derive(q[1], v[1], tau[1])
    request.getfixturevalue("interpreted")
    other = Derivatives(robot, "ddm")
    assert other.library is None
    run = other(q, v, tau)
    same_bits(one, {name: block[1] for name, block in built.items()})
    close_to(run, built, EXACT)


@pytest.mark.slow
def test_while_the_compiler_takes_long_casadi_computes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A warning says so first, progress is told, and the compiled derivatives have the same numbers."""
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path))
    monkeypatch.setattr(Derivatives, "patience", 0.0)
    caplog.set_level("INFO", "hybridyn.compiled")
    robot = hybridyn.load("five_bar")
    found = Derivatives(robot, "idm")
    states = random_states(robot, 3)[:3]
    assert found.library is None
    assert "the C compiler takes about" in caplog.text
    meanwhile = found(*states)
    found.wait_until_compiled()
    assert found.library is not None
    assert "the C compiler has done 1 of" in caplog.text
    for name, block in found(*states).items():
        assert np.abs(block - meanwhile[name]).max() <= EXACT * np.abs(block).max()


def test_calls_fill_arrays(interpreted: None) -> None:
    robot = hybridyn.load("five_bar")
    q, v, a, _ = random_states(robot, 2)
    derive = Derivatives(robot, "idm")
    assert_filled(derive, q[0], v[0], a[0])
    for given, words in (
        (derive.allocate(), "out is for a single sample, the arguments are 2 rows"),
        (derive(q, v, a), "what `allocate` of the same derivatives returned"),
    ):
        refused(lambda given=given: derive(q, v, a, out=given), hybridyn.TrajectoryError, words)


@pytest.mark.slow
def test_compiled_calls_fill_arrays() -> None:
    robot = hybridyn.load("five_bar")
    q, v, a, _ = random_states(robot, 1)
    assert_filled(Derivatives(robot, "idm"), q[0], v[0], a[0])


def assert_filled(derive: Derivatives, *given: np.ndarray) -> None:
    """Check that a call with `out` fills and returns it, with the same numbers."""
    out = derive.allocate()
    places = {name: block.ctypes.data for name, block in out.items()}
    assert derive(*given, out=out) is out
    assert {name: block.ctypes.data for name, block in out.items()} == places
    same_bits(out, derive(*given))


@pytest.mark.parametrize(
    ("name", "base"),
    [slow("five_bar", "moving"), slow("rps3", "fixed"), slow("rps3", "floating"),
     slow("gough_stewart", "floating"), slow("scara_delta", "fixed"),
     slow("delta", "fixed"), slow("tanev", "fixed"), slow("stewart_ur5", "floating"),
     slow("lx4", "fixed"), slow("snake", "fixed")],
)  # fmt: skip
def test_the_joined_blocks_are_the_derivatives_of_the_whole_program(name: str, base: str) -> None:
    """CasADi differentiates the whole program; single columns, too, are the same to rounding."""
    robot = hybridyn.load(name, base=base)
    assert_as_whole(robot)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "sps_thin"])  # rods spin without inertia
def test_joined_blocks_of_random_mechanisms(kind: str) -> None:
    """Along motions that efforts cause: columns that open loops may differ on a floating base."""
    base: Base = "floating" if list(KINDS).index(kind) % 2 else "fixed"
    assert_as_whole(build_robot(random_mechanism(1, kind=kind), base=base), along_loops=base == "floating")


def assert_as_whole(robot: hybridyn.HybridRobot, *, along_loops: bool = False) -> None:
    """Compare the derivatives of both models with those of the whole program, by columns or along loops."""
    q, v, a, tau = (x[0] for x in random_states(robot, 1))
    asked = request(robot, None)
    for model, derive, given in (
        ("idm", inverse_derivatives, [q, v, a]),
        *([("ddm", direct_derivatives, [q, v, tau])] if robot.base != "moving" else []),
    ):
        whole = function_of(programs(robot, models=(model,))[model])
        columns = [ca.SX.sym(f"x{i}", len(x)) for i, x in enumerate(given)]
        value = whole.call(columns)[0]
        J = ca.Function("J", columns, [ca.densify(ca.jacobian(value, x)) for x in columns])
        wanted = [np.array(x) for x in J.call(given)]
        wanted[0] = wanted[0] @ tangent(robot, q)
        joined = derive(asked)
        check(trimmed(joined))
        found = function_of(joined).call(given)
        for x, block in zip(wanted, found[1:-1], strict=True):
            moves = along_loops and model == "ddm" and x is wanted[0]
            along = wanted[2] / np.abs(wanted[2]).max(initial=1e-300) if moves else np.eye(x.shape[1])
            atol = SOLVED * np.abs(x).max(initial=0.0)
            off = np.array(block).reshape(x.shape) @ along - x @ along
            np.testing.assert_allclose(off, 0.0, atol=atol)


def tangent(robot: hybridyn.HybridRobot, q: np.ndarray) -> np.ndarray:
    """Return the derivative of the coordinates q over the freedoms by differences of fourth order."""
    step, weights = 1e-3, {-2: 1 / 12, -1: -8 / 12, 1: 8 / 12, 2: -1 / 12}
    columns = [
        sum(x * pin.integrate(robot.model, q, n * step * e) for n, x in weights.items()) / step
        for e in np.eye(robot.nv)
    ]
    return np.array(columns).T


@pytest.mark.slow
def test_one_robot_is_prepared_once(monkeypatch: pytest.MonkeyPatch, interpreted: None) -> None:
    """The same robot read again, too; another model, effect or robot is prepared anew."""
    import hybridyn.compiled.derivatives as file

    made: list[tuple[str, ...]] = []

    class Counted(file.Derivatives):
        def __init__(self, robot: hybridyn.HybridRobot, model: str, *given: Any, **options: Any) -> None:
            made.append((robot.name, model))
            super().__init__(robot, model, *given, **options)

    monkeypatch.setattr(file, "Derivatives", Counted)
    monkeypatch.setattr(file, "_prepared", {})
    monkeypatch.setattr(file, "KEPT", 2)
    five, moon = hybridyn.load("five_bar"), hybridyn.load("five_bar", gravity=(0, 0, -1.62))
    v = np.zeros(five.nv)
    first = hybridyn.idm_jacobian(five, five.home, v, v)
    again = hybridyn.idm_jacobian(hybridyn.load("five_bar"), five.home, v, v)
    same_bits(first, again)
    assert len(made) == 1
    hybridyn.idm_jacobian(moon, five.home, v, v)
    hybridyn.ddm_jacobian(five, five.home, v, np.zeros(2))
    hybridyn.idm_jacobian(five, five.home, v, v)  # the oldest went
    assert len(made) == 4


def test_derivatives_are_written_where_a_motion_has_no_inertia(interpreted: None) -> None:
    """A slide without mass, on which nothing acts, rests; so says the general path, which is asked."""
    description, base = any_mechanism(47)
    robot = build_robot(description, base=base)
    rest = robot.home, np.zeros(robot.nv), np.zeros(0)
    assert not hybridyn.ddm(robot, *rest).any()
    found = Derivatives(robot, "ddm")(*rest)
    assert found["q"].shape == (1, 1)
    assert not any(block.any() for block in found.values())


def test_steps_that_lead_to_no_result_are_left_out() -> None:
    """What a guard or a sum needs stays; numbers that are written again before they are read do not."""
    w, x = Writer("steps", [("x", 1)], [("y", 1)]), ca.SX.sym("x")
    double = w.kernel("double", ca.Function("double", [x], [2.0 * x]), "toy")
    guarded = w.kernel("guarded", ca.Function("guarded", [x], [x, x - 3.0]), "toy")
    given, unread, once, total = w.from_given("x", np.zeros(1, int)), w.shared(1), w.shared(1), w.shared(1)
    added = w.start(total, np.ones(1))
    w.call(double, 1, [given], [unread])
    w.call(double, 1, [given], [once])
    w.call(double, 1, [unread], [once])
    w.call(guarded, 1, [given], [once, Worst()])
    w.call(guarded, 1, [once], [added, Worst()])
    w.call(double, 1, [once], [w.result("y", np.zeros(1, int))])
    whole = w.program()
    program = compacted(whole)
    assert len(program.steps) == 4  # the start of the sum, both guards and the result
    for value in (1.5, 4.0):
        same_bits(*([np.array(end) for end in function_of(p)(value)] for p in (program, whole)))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["delta", "gough_stewart", "random axes"])
def test_derivatives_of_balls_take_operations_as_those_of_universal_joints(name: str) -> None:
    """At most 1.3 times as many: 0.94 to 1.29 are found, once 1.6."""
    counts = []
    ball, universal = (
        (rods.ball_gough(1), rods.ball_gough(1, "universal"))
        if name == "random axes"
        else (rods.with_balls(shipped(name)), shipped(name))
    )
    for description in (ball, universal):
        asked = request(build_robot(description), None)
        counts.append([total(build(asked)) for build in BUILDERS.values()])
    assert (np.array(counts[0]) <= 1.3 * np.array(counts[1])).all()
