"""Friction that grows with load in compiled models: the general path's numbers, its refusals, no guesses."""

from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

import hybridyn
from hybridyn.compiled import operations, torque_models
from hybridyn.compiled.code.kernels import kernel_graph
from hybridyn.compiled.code.scalars import OF_ONE, OF_TWO
from hybridyn.compiled.equations.options import inverse_options
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.equations.settling import far_from_solution, largest_over
from hybridyn.compiled.equations.states import random_states
from hybridyn.compiled.program import Call
from hybridyn.compiled.programs.whole_robot import programs
from hybridyn.effects import GearEfficiency, GravityCompensation, LoadFriction, choose
from hybridyn.errors import ActuationError, ModelError, SingularityError
from hybridyn.joints.kinds import JointKind
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.compiled import rods
from tests.effects.test_load_friction import FAST, at_speed, wedge
from tests.robots.mechanisms import random_mechanism
from tests.robots.shipped import shipped
from tests.support.comparing import close_to
from tests.support.engines import written_agrees
from tests.support.samples import slow
from tests.support.written_out import Interpreted

AGREES = 1e-10  # as of all compiled models
SAME_RUN = 1e-8  # a hundred times the tolerance of the steps
ROUNDED = 1e-12  # of the largest number, in models whose legs are computed otherwise


def rubbing_law(robot: HybridRobot, size: float = 1.0, seed: int = 0, share: float = 1.0) -> LoadFriction:
    """Draw friction in hinges, slides and balls, larger near rest in some, of a share of the joints."""
    rng, words = np.random.default_rng(seed), ("radial", "axial", "normal", "static", "speed")
    tables: dict[str, dict[str, float]] = {word: {} for word in words}
    for name, kind in zip(robot.joints, robot.kinds, strict=True):
        if name in robot.cut_joints or not (kind.single or kind is JointKind.SPHERICAL):
            continue
        if rng.uniform() > share:
            continue
        tables["normal" if kind.slides else "radial"][name] = (
            size * rng.uniform(0.5, 1) * (0.05 if kind.slides else 2e-3)
        )
        if kind.single and kind.hinge and rng.uniform() < 0.5:
            tables["axial"][name] = 1e-3 * size
        if rng.uniform() < 0.3:
            tables["static"][name], tables["speed"][name] = 1.4, 0.3
    return LoadFriction(**tables, width=0.05)


@pytest.mark.parametrize("name", ["five_bar", *map(slow, ("rps3", "delta", "gough_stewart", "lx4"))])
def test_shipped_robots_agree_with_the_general_path(name: str) -> None:
    robot = build_robot(shipped(name))
    law = LoadFriction(normal=dict.fromkeys(robot.motors, 0.05), width=0.05)
    if name in ("five_bar", "rps3", "delta"):
        law = LoadFriction(radial=rubbing_law(robot).radial, normal=rubbing_law(robot).normal, width=0.05)
    gears = GearEfficiency(dict.fromkeys(robot.motors[:2], 0.9), width=0.1)
    written_agrees(robot, effects=["default", law, gears], within=AGREES)


#: Serial, planar and spatial loops, several modules, bases that move; fewer motors than motions.
DRAWN = ["five_bar", "slider_crank", "branched", "star_four", "rssr", "stack", "serial", "gough", "four_bar"]


@pytest.mark.parametrize("seed", [0, *map(slow, range(1, 12))])
@pytest.mark.parametrize("kind", [*DRAWN[:2], *map(slow, DRAWN[2:])])
def test_random_mechanisms_agree_with_the_general_path(kind: str, seed: int) -> None:
    """A sample that a guard does not trust is left to the general path: most are trusted."""
    base = ("fixed", "moving", "floating")[seed % 3]
    robot = build_robot(random_mechanism(seed, kind=kind), base=base)
    law = rubbing_law(robot, seed=seed, share=0.5)
    effects = ["default", LoadFriction(law.radial, normal=law.normal, width=0.05)]
    library = Interpreted(robot, ("idm", "ddm"), effects)
    q, v, _, tau = random_states(robot, 6, seed)
    more, given = [], {"effects": effects}
    if base == "moving":
        more, given["base_acceleration"] = [np.zeros((6, 6))], np.zeros((6, 6))
    a = hybridyn.ddm(robot, q, v, tau, **given)
    for name, inputs, wanted in (
        ("ddm", (q, v, tau, *more), a),
        ("idm", (q, v, a), hybridyn.idm(robot, q, v, a, effects=effects)),
    ):
        (found,), guard = library.batch(name, *inputs)
        good = guard <= 1
        assert good.sum() > 3
        close_to(found[good], wanted[good], AGREES)


@pytest.mark.slow
def test_c_computes_it_in_batches_steps_and_control() -> None:
    """`ddm` inverts `idm`, and runs are those of the general path."""
    robot = build_robot(shipped("five_bar"))
    effects = ["default", rubbing_law(robot)]
    effects[1] = LoadFriction(radial=effects[1].radial, width=0.05)
    fast = hybridyn.compile(robot, effects, wait=True)
    motion = np.array([[0.1, 0.2], [-0.1, 0.3]]), np.array([[1.0, -0.5], [0.3, 0.7]]), np.zeros((2, 2))
    q, v, a = hybridyn.assemble(robot, motors=motion)
    tau = fast.idm(q, v, a)
    close_to(tau, hybridyn.idm(robot, q, v, a, effects=effects), AGREES)
    close_to(fast.ddm(q, v, tau), a, AGREES)
    close_to(fast.idm_from_motors(*(x[1] for x in motion))[0], tau[1], AGREES)
    given = {"effort": tau[0], "effects": effects, "rtol": 1e-10}
    one, other = (
        hybridyn.simulate(robot, q[0], v[0], np.array([0.0, 0.01]), compiled=compiled, **given)
        for compiled in (fast, None)
    )
    close_to(one.q, other.q, SAME_RUN)
    assert fast.recomputed == 0
    assert torque_models(fast, choose(robot, effects)) is not None


@pytest.mark.parametrize("name", ["five_bar", slow("gough_stewart")])
def test_friction_that_vanishes_leaves_the_numbers_without(name: str) -> None:
    robot = build_robot(shipped(name))
    slight = LoadFriction(
        radial=dict.fromkeys([] if name == "gough_stewart" else robot.motors, 1e-16),
        normal=dict.fromkeys(robot.motors if name == "gough_stewart" else [], 1e-16),
    )
    q, v, a, tau = random_states(robot, 3)
    with_it, without = (Interpreted(robot, ("idm", "ddm"), on) for on in (["default", slight], None))
    for model, last in (("idm", a), ("ddm", tau)):
        close_to(with_it.batch(model, q, v, last)[0][0], without.batch(model, q, v, last)[0][0], ROUNDED)


def test_equal_legs_share_their_kernels_with_friction() -> None:
    """Slides of six legs rub. C calls no function of its library lane by lane."""
    robot = build_robot(shipped("gough_stewart"))
    law = LoadFriction(normal=dict.fromkeys(robot.motors, 0.05))
    program = programs(robot, ["default", law], models=("idm",))["idm"]
    assert [step.copies for step in program.steps if isinstance(step, Call)].count(6) == 1
    used = {node.name.upper() for kernel in program.kernels for node in kernel_graph(kernel).nodes}
    assert "TANH" in used
    assert not used & {*OF_ONE, *OF_TWO}


@pytest.mark.parametrize(
    ("name", "model", "most"),
    [
        ("gough_stewart", "idm", 1.4),
        slow("gough_stewart", "ddm", 2.0),
        slow("lx4", "idm", 1.4),
        slow("lx4", "ddm", 2.5),
    ],
)
def test_friction_in_every_slide_takes_few_operations_more(name: str, model: str, most: float) -> None:
    """Motors balance it in `idm`; `python -m benchmarks` measures the time, which grows alike."""
    robot = build_robot(shipped(name))
    on = choose(robot, ["default", LoadFriction(normal=dict.fromkeys(robot.motors, 0.05))])
    assert operations(robot, on, model) < most * operations(robot, choose(robot, None), model)


@pytest.mark.parametrize("name", ["ball_gough", slow("gough_stewart")])
def test_equal_legs_may_differ_near_rest_in_ddm(name: str) -> None:
    """What their joints carry is the same to the last bit, in legs that are turned, too."""
    robot = build_robot(rods.ball_gough(2) if name == "ball_gough" else shipped(name))
    static, speed = (dict(zip(robot.motors, x + 0.01 * np.arange(6), strict=True)) for x in (1.4, 0.3))
    law = LoadFriction(normal=dict.fromkeys(robot.motors, 0.05), static=static, speed=speed, width=0.05)
    effects = ["default", law]
    rubbing = inverse_options(request(robot, choose(robot, effects)), 0).rubbing
    assert len({one.terms[0].part for one in rubbing}) == 1 < len(rubbing)
    q, v, _, tau = random_states(robot, 2)
    (found,), guard = Interpreted(robot, ("ddm",), effects).batch("ddm", q, v, tau)
    assert (guard <= 1).all()
    close_to(found, hybridyn.ddm(robot, q, v, tau, effects=effects), AGREES)


@pytest.mark.parametrize("angle", [0.1, 0.6])
def test_a_wedge_that_may_jam_is_left_to_the_general_path(tmp_path: Path, angle: float) -> None:
    """The block jams from mu = 1 / tan(angle) on; well below, C solves for it."""
    robot = wedge(tmp_path, angle, lifted=True)
    q, v, a = at_speed(robot, FAST)
    for part in (0.5, 1.2):
        effects = ["default", LoadFriction(normal={"ramp": part / np.tan(angle)})]
        (tau,), guard = Interpreted(robot, ("idm",), effects).batch("idm", q[None], v[None], a[None])
        if part < 1:
            assert guard[0] <= 1
            close_to(tau[0], hybridyn.idm(robot, q, v, a, effects=effects), ROUNDED)
        else:
            assert not guard[0] <= 1
            with pytest.raises(ActuationError, match="may jam"):
                hybridyn.idm(robot, q, v, a, effects=effects)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_an_iteration_that_did_not_arrive_is_not_trusted(
    base: str, monkeypatch: pytest.MonkeyPatch, written_anew: None
) -> None:
    """Of one module, and of two."""
    robot = build_robot(shipped("five_bar"), base=base)
    effects = ["default", LoadFriction(radial=rubbing_law(robot).radial, width=0.05)]
    monkeypatch.setattr("hybridyn.compiled.equations.settling.NEWTON", 0)
    monkeypatch.setattr("hybridyn.compiled.programs.rubbing.friction_sweeps", lambda *given: 1)
    q, v, a, tau = random_states(robot, 2)
    models = {"idm": a, "ddm": tau} if base == "fixed" else {"ddm": tau}
    library = Interpreted(robot, (*models,), effects)
    for model, last in models.items():
        assert not (library.batch(model, q, v, last)[1] <= 1).any()


def test_wrenches_on_outputs_load_the_joints_of_legs() -> None:
    robot, rng = build_robot(shipped("rps3")), np.random.default_rng(0)
    law = rubbing_law(robot)
    effects = ["default", LoadFriction(radial=law.radial, normal=law.normal, width=0.05)]
    q, v, a, tau = random_states(robot, 2)
    wrench = 20 * rng.normal(size=(2, 6))
    library = Interpreted(robot, ("idm", "ddm"), effects, wrenches=["m1_platform"])
    for model, last in (("ddm", tau), ("idm", a)):
        (found,), guard = library.batch(model, q, v, last, wrench)
        wanted = getattr(hybridyn, model)(
            robot, q, v, last, wrenches={"m1_platform": wrench}, effects=effects
        )
        assert (guard <= 1).all()
        close_to(found, wanted, AGREES)


def test_a_friction_that_is_nan_is_not_settled() -> None:
    values = np.array([ca.SX(1.0), ca.SX(np.nan)], dtype=object)
    assert float(largest_over(values[:1], np.array([2.0]))) == 0.5
    assert float(far_from_solution(0.5, largest_over(values, np.ones(2)), 1e-16)) == np.inf


def test_what_compiled_models_cannot_do_with_it_is_refused() -> None:
    robot = build_robot(shipped("five_bar"))
    joint = robot.motors[0]
    rubs, shared = LoadFriction(radial={joint: 1e-3}), LoadFriction(tilt={joint: 1e-3})
    for effects, said in (
        (
            ["default", rubs, GravityCompensation({"m1_tool": 0.5})],
            "on joint 'm1_.*' with a wrench on the link 'm1_tool'",
        ),
        (["default", shared], f"redundant closures share loads .*tilt of '{joint}'"),
    ):
        with pytest.raises(ModelError, match=said):
            hybridyn.compile(robot, effects)


@pytest.mark.parametrize(
    ("postures", "said"),
    [(1, "redundant closures share loads"), (2, "no posture tells .*general path")],
)
def test_shared_loads_are_refused_beside_singular_postures(
    postures: int, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first ones of the two that are drawn: one is left to judge by, or none."""
    robot, calls = build_robot(shipped("five_bar")), iter(range(2))

    def direct(*state: Any, **more: Any) -> Any:
        """Compute accelerations, at the first postures none."""
        if next(calls) < postures:
            raise SingularityError("the matrix lost rank")
        return hybridyn.ddm(*state, **more)

    monkeypatch.setattr("hybridyn.compiled.equations.states.ddm", direct)
    with pytest.raises(ModelError, match=said):
        request(robot, ["default", LoadFriction(tilt={robot.motors[0]: 1e-3})])
