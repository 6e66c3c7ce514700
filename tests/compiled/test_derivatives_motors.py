"""Derivatives over the motors: against those over all joints along the loops, and against differences."""

from dataclasses import replace
from functools import partial
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.posture import positions_of
from hybridyn.compiled.derivatives import Derivatives, ddm_jacobian, idm_jacobian
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.program import Constants, Shared
from hybridyn.compiled.programs.derivatives.motor_motion import brackets
from hybridyn.compiled.programs.derivatives.nodes import StageNode
from hybridyn.compiled.programs.derivatives.sweeps import ProgramGraph, Sweep
from hybridyn.compiled.programs.writer import Writer
from hybridyn.description.records import Description
from hybridyn.joints.kinds import JointKind
from hybridyn.structure.building import build_robot
from tests.compiled import rods
from tests.robots.effect_cases import CASES
from tests.robots.locked import hinged_five_bar, with_truss
from tests.robots.mechanisms import random_mechanism
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

ROUNDING = 1e-12  # of both derivatives, and the condition of the mass matrix; 8e-14 is found (snake)
STEP = 1e-3  # of differences of fourth order: STEP^4 and rounding of the closed loops over STEP
CLOSED = 1e-9  # of postures that two robots assemble each by itself
DIFFERENCES = 1e-7  # 8e-8 is found (tanev, over rates, whose derivatives are small)


ALONG = ["five_bar", "gough_stewart", "delta", "tanev", "scara_delta", "lx4", "snake"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "law", "changed"),
    [
        *((name, "", "") for name in ALONG),
        ("gough_stewart", "viscous_friction", "v"),
        ("gough_stewart", "spring", "q"),
    ],
)
def test_they_are_those_over_joints_along_the_loops(
    name: str, law: str, changed: str, interpreted: None
) -> None:
    """In E and its rate, d(E u)/dm and dE/dt are the same: second derivatives of q by m.

    Laws of joints are among the forces.
    """
    robot = build_robot(shipped(name))
    on = ["default", *(CASES[law](robot) if law else [])]
    q, v, a, _ = (x[0] for x in random_states(robot, 1))
    tau = hybridyn.idm(robot, q, v, a, effects=on)
    E, E_dot = hybridyn.motion_map(robot, q, v)
    joints = hybridyn.ddm_jacobian(robot, q, v, tau, effects=on)
    J = {x: block[robot.motor_v] for x, block in joints.items()}
    found = hybridyn.ddm_jacobian(robot, q, v, tau, effects=on, coordinates="motors")
    if name != "delta":  # whose spherical joints turn: their rates are no derivatives
        close_to(found["q"], J["q"] @ E + J["v"] @ E_dot, ROUNDING)
    close_to((found["v"], found["tau"]), (J["v"] @ E, J["tau"]), ROUNDING)
    efforts = hybridyn.idm_jacobian(robot, q, v, a, effects=on, coordinates="motors")
    close_to(efforts["a"], hybridyn.mass_matrix(robot, q), ROUNDING)
    for x in ("q", "v"):
        close_to(efforts["a"] @ found[x], -efforts[x], ROUNDING)
    if changed:
        without = hybridyn.idm_jacobian(robot, q, v, a, coordinates="motors")[changed]
        assert np.abs(efforts[changed] - without).max() > 1e-3 * np.abs(without).max()


@pytest.mark.parametrize(
    "name",
    [
        "five_bar", "truss beside",
        *map(slow, ("truss on", "truss below", "gough_stewart", "rps3", "delta", "tanev", "lx4")),
        slow("gough_floating"),
    ],
)  # fmt: skip
def test_columns_against_differences_along_each_motor(name: str, interpreted: None) -> None:
    """The general path of `idm` at postures that `assemble` closes: single columns have a meaning here."""
    drawn = name == "gough_floating"  # its platform has a joint of six freedoms
    robot = (
        with_truss(name.removeprefix("truss "))
        if name.startswith("truss")
        else build_robot(random_mechanism(1, kind=name) if drawn else shipped(name))
    )
    q, v, a, tau = (x[0] for x in random_states(robot, 1))
    columns, n = robot.motor_v, len(robot.motors)
    start = np.concatenate([positions_of(robot, q[None], robot.motors)[0], v[columns], a[columns]])
    found = hybridyn.idm_jacobian(robot, q, v, a, coordinates="motors")
    J = np.concatenate([found["q"], found["v"], found["a"]], axis=1)

    def efforts(x: np.ndarray) -> np.ndarray:
        """Compute the efforts at positions, rates and accelerations of the motors."""
        motion = {name: tuple(x[i::n]) for i, name in enumerate(robot.motors)}
        return hybridyn.idm(robot, *hybridyn.assemble(robot, motors=motion, guess=q))

    picked = range(3 * n) if n < 10 else (0, 23, 30, 47, 50)
    for j in picked:
        x = start + STEP * np.arange(-2, 3)[:, None] * np.eye(3 * n)[j]
        f = [np.ravel(efforts(row)) for row in x]
        close_to(J[:, j], (f[0] - 8 * f[1] + 8 * f[3] - f[4]) / (12 * STEP), DIFFERENCES)
    rates = hybridyn.ddm_jacobian(robot, q, v, tau, coordinates="motors")
    for known, of in (("q", -found["q"]), ("v", -found["v"]), ("tau", np.eye(n))):
        close_to(found["a"] @ rates[known], of, ROUNDING)


@pytest.mark.slow
def test_motors_of_a_serial_arm_are_its_joints(interpreted: None) -> None:
    """Whatever the order of the motors: both derivatives are the same, and each other's inverse."""
    arm = random_mechanism(1, kind="serial")
    robot = build_robot(replace(arm, motors=arm.motors[::-1]))
    q, v, a, tau = (x[0] for x in random_states(robot, 1))
    joints = hybridyn.idm_jacobian(robot, q, v, a)
    motors = hybridyn.idm_jacobian(robot, q, v, a, coordinates="motors")
    for x, block in motors.items():
        close_to(block, joints[x][:, robot.motor_v], ROUNDING)
    rates = hybridyn.ddm_jacobian(robot, q, v, tau, coordinates="motors")
    close_to(motors["a"] @ rates["tau"], np.eye(len(robot.motors)), ROUNDING)


def test_brackets_are_commutators_of_matrices() -> None:
    kinds, columns = ("planar", "floating", "revolute", "spherical"), ([0, 1, 5], range(6), [3], [3, 4, 5])
    x, y = np.random.default_rng(0).normal(size=(2, 13))
    found, first = brackets(tuple(map(JointKind, kinds)), x.astype(object), y.astype(object)), 0
    for kind, at in zip(kinds, columns, strict=True):
        twists = np.zeros((2, 6))
        twists[:, list(at)] = x[first : first + len(at)], y[first : first + len(at)]
        X, Y = (_matrix(twist) for twist in twists)
        bracket = found[first : first + len(at)].astype(float)
        expected = np.zeros(6)
        expected[list(at)] = bracket
        np.testing.assert_allclose(X @ Y - Y @ X, _matrix(expected), atol=1e-15, err_msg=kind)
        first += len(at)


def _matrix(twist: np.ndarray) -> np.ndarray:
    """Return the matrix of a twist (linear part first), shape (4, 4)."""
    (vx, vy, vz, x, y, z) = twist
    return np.array([[0, -z, y, vx], [z, 0, -x, vy], [-y, x, 0, vz], [0, 0, 0, 0]])


def test_what_is_no_coordinate_is_refused(interpreted: None) -> None:
    robot, floating = build_robot(shipped("five_bar")), build_robot(shipped("five_bar"), base="floating")
    rest: Any = robot.home, *np.zeros((2, robot.nv))
    moving = build_robot(shipped("five_bar"), base="moving")
    for call, words in (
        (lambda: Derivatives(robot, "idm", coordinates="u"), "derivatives are 'joints' or 'motors', not 'u'"),
        (lambda: idm_jacobian(robot, *rest, coordinates=["motors"]), r"or 'motors', not \['motors'\]"),
        (lambda: ddm_jacobian(robot, *rest, coordinates=["motors"]), r"or 'motors', not \['motors'\]"),
        (lambda: Derivatives(moving, "ddm"), "a base that is fixed or floating; the motion of this one is"),
        (lambda: Derivatives(floating, "ddm", coordinates="motors"), "a fixed base; this one is 'floating'"),
    ):  # fmt: skip
        refused(call, hybridyn.ModelError, words)


@pytest.mark.slow
def test_nothing_changes_where_nothing_moves(interpreted: None) -> None:
    """There are no derivatives over no motors, and those over the effort of a locked one are zero."""
    robot = with_truss("alone")
    for derive in (Derivatives(robot, model, coordinates="motors") for model in ("idm", "ddm")):
        found = derive(robot.home, *(np.zeros(n) for n in list(derive._inputs.values())[1:]))
        assert {block.shape for block in found.values()} == {(0, 0)}
    robot = with_truss("beside", motor=True)
    q, v, _, tau = (x[0] for x in random_states(robot, 1))
    J, locked = ddm_jacobian(robot, q, v, tau)["tau"], robot.modules[0]
    assert not J[locked.v_index].any()
    assert not J[:, locked.motor_index].any()
    assert np.linalg.matrix_rank(J) == robot.mobility


@pytest.mark.parametrize("model", ["idm", "ddm"])
def test_motors_that_loops_lock_are_no_coordinates(model: str) -> None:
    for robot in (hinged_five_bar(("ja", "jx")), with_truss("beside", motor=True)):
        refused(
            partial(Derivatives, robot, model, coordinates="motors"),
            hybridyn.ModelError,
            r"its loops lock motor '.*', which is no coordinate",
        )


def test_only_numbers_that_results_need_get_derivatives() -> None:
    """The second output and the entry that it alone reads are left out, forwards and back."""
    x, w = ca.SX.sym("x", 3), Writer("derivatives", [], [])
    function = ca.Function("f", [x], [ca.vertcat(x[0] * x[1], ca.sin(x[2]) * x[1])])
    node = StageNode("node", function, 1, (Shared(0, 3),), (Shared(3, 2),))
    graph = ProgramGraph.between([node], [Shared(0, 3)], [Shared(3, 1)])
    assert graph.needed == {("shared", k) for k in (0, 1, 3)}
    for back, seeded, wanted in ((False, Shared(0, 3), {3}), (True, Shared(3, 2), {0, 1})):
        n = seeded.size
        sweep = Sweep(w, n)
        sweep.seed(seeded, Constants(np.eye(n)))
        before = set(sweep.of)
        sweep.through(graph, back=back)
        assert {k for _, k in set(sweep.of) - before} == wanted


def thick(description: Description) -> Description:
    """Give rods a hundred times the inertia about their line, so that their spins matter."""
    links = []
    for link in description.links:
        d = link.com / (np.linalg.norm(link.com) or 1.0)
        more = 0.01 * link.mass * np.outer(d, d) if "rod" in link.name else np.zeros((3, 3))
        links.append(replace(link, inertia=link.inertia + more))
    return replace(description, links=tuple(links))


class Alike(np.random.Generator):
    """Draws one number for all samples."""

    def __init__(self, seed: int) -> None:
        super().__init__(np.random.PCG64(seed))

    def normal(self, *, size: int) -> np.ndarray:  # type: ignore[override]
        """Draw a number, shape (size,)."""
        return np.full(size, super().normal())


@pytest.mark.parametrize(
    ("description", "size"),
    [
        (thick(rods.crank(1)), 0.3),
        (thick(rods.crank(1, "floating")), 0.3),
        (rods.crank(1, "floating aside", thin=True), 0.3),
        slow(thick(rods.ball_delta(1)), 0.3),
        slow(rods.ball_delta(1, "floating aside", thin=True), 0.3),
        slow(rods.ball_gough(1), 0.02),
    ],
    ids=["crank", "free crank", "crank aside", "delta", "free delta", "gough"],
)
def test_columns_of_spinning_rods_against_differences(
    description: Description, size: float, interpreted: None
) -> None:
    """The rates of spins stay. Their accelerations stay, too, or they respond to the forces."""
    robot = build_robot(description)
    n, m = len(robot.motors), rods.swings(robot, 3, size)
    start = np.array([[x[1] for x in m[name]] for name in robot.motors]).T.ravel()
    guess, tau = robot.home, np.zeros(n)

    def states(x: np.ndarray) -> tuple[np.ndarray, ...]:
        """Compute states in which the rods spin at motions of the motors, shape (T, 3 n)."""
        motors = {name: tuple(x[:, i::n].T) for i, name in enumerate(robot.motors)}
        q, v, a = hybridyn.assemble(robot, motors=motors, guess=guess)
        rods.spin(robot, q, v, None, Alike(7))
        free = hybridyn.ddm(robot, q, v, np.tile(tau, (len(x), 1)))
        moved = {
            name: (*motors[name][:2], free[:, at]) for name, at in zip(motors, robot.motor_v, strict=True)
        }
        a += free - hybridyn.assemble(robot, motors=moved, guess=guess)[2]
        rods.spin(robot, q, v, a, Alike(8))
        return q, v, a

    guess, v, a = (x[0] for x in states(start[None]))
    tau = hybridyn.idm(robot, guess, v, a)
    held = idm_jacobian(robot, guess, v, a, coordinates="motors")
    free = ddm_jacobian(robot, guess, v, tau, coordinates="motors")

    def results(x: np.ndarray) -> np.ndarray:
        """Compute efforts, and the motors' accelerations that `tau` causes, shape (T, 2 n)."""
        q, v, a = states(x)
        caused = hybridyn.ddm(robot, q, v, np.tile(tau, (len(x), 1)))
        return np.concatenate([hybridyn.idm(robot, q, v, a), caused[:, robot.motor_v]], axis=1)

    for j in range(3 * n) if n < 6 else (1, 8, 15):
        f = results(start + STEP * np.array([-2, -1, 1, 2])[:, None] * np.eye(3 * n)[j])
        change, x, k = (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * STEP), "qva"[j // n], j % n
        for J, found in ((held, change[:n]), (free, change[n:])) if x != "a" else ((held, change[:n]),):
            assert np.abs(J[x][:, k] - found).max() <= DIFFERENCES * np.abs(J[x]).max()


@pytest.mark.parametrize(
    ("name", "size"), [("crank", 0.3), slow("ball_delta", 0.3), slow("ball_gough", 0.02)]
)
def test_spinning_rods_act_as_those_that_cannot_spin(name: str, size: float, interpreted: None) -> None:
    """With no inertia about their lines, both derivatives are those of rods on universal joints."""
    both, description = [], getattr(rods, name)(1, "universal", thin=True)
    balls = rods.with_balls(description)
    assert sum(joint.kind == "spherical" for joint in balls.joints) >= len(balls.motors)
    for robot in map(build_robot, (balls, description)):
        q, v, a = (x[1] for x in hybridyn.assemble(robot, motors=rods.swings(robot, 3, size)))
        tau = hybridyn.idm(robot, q, v, a)
        both.append(idm_jacobian(robot, q, v, a, coordinates="motors"))
        both.append(ddm_jacobian(robot, q, v, tau, coordinates="motors"))
    for found, known in zip(both[:2], both[2:], strict=True):
        close_to(found, known, CLOSED)


@pytest.mark.slow
@pytest.mark.parametrize("model", ["idm", "ddm"])
def test_compiled_derivatives_of_spinning_rods(model: str) -> None:
    """The library passes its own check: without spins, whose change is no motor's."""
    robot = build_robot(thick(rods.crank(1)))
    q, v, a, tau = random_states(robot, 3)
    derive, last = Derivatives(robot, model, coordinates="motors"), a if model == "idm" else tau
    assert derive.library is not None
    (_, *known), _ = derive._interpreted.batch(derive._name, q, v, last)
    close_to([x.ravel() for x in derive(q, v, last).values()], [x.ravel() for x in known], ROUNDING)


def test_modules_that_spin_alone_have_no_coordinates(interpreted: None) -> None:
    """An arm beside a rod between two balls: columns over its motor are those of its joint."""
    s = rods.plain(1)
    p = s.place()
    rods.rod(s, "base", p(0.15, 0.0, 0.0), "base", p(0.1, 0.1, 0.5), "ball")
    s.joint("revolute", "base", p(1.0, 0.0, 0.0), p.axes[:, 0], motor=True, stem="arm")
    robot = build_robot(s.description("held_rod"))
    q, v, _, tau = (x[0] for x in random_states(robot, 1))
    joints, motors = (ddm_jacobian(robot, q, v, tau, coordinates=x) for x in ("joints", "motors"))
    arm = robot.motor_v[0]
    close_to([motors[x][0, 0] for x in "qv"], [joints[x][arm, arm] for x in "qv"], ROUNDING)
    assert motors["tau"][0, 0] == pytest.approx(joints["tau"][arm, 0], rel=ROUNDING)


def test_a_motion_without_a_motor_is_no_coordinate() -> None:
    """Spins are no such motions."""
    robot = build_robot(replace(rods.crank(1), motors=()))
    words = "0 motors for 1 freedom are not its independent coordinates"
    refused(partial(Derivatives, robot, "idm", coordinates="motors"), hybridyn.ModelError, words)
