"""Written-out models of badly written robots: home open or singular, loops rounded, motors locked."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled import comparing
from hybridyn.compiled.equations.guarded_elimination import choose_pivots
from hybridyn.compiled.equations.states import moving_states, random_states
from hybridyn.compiled.exporting import export
from hybridyn.compiled.failures import difference
from hybridyn.compiled.programs.general import GENERAL, body_rows
from hybridyn.compiled.verifying import MODEL_AGREES, verify
from hybridyn.description.records import Closure, Coupling, Description, Joint, Link
from hybridyn.effects.choice import Effects, choose
from hybridyn.effects.joint_laws import ViscousFriction
from hybridyn.manifold.manifold import Manifold
from hybridyn.structure.building import build_robot
from tests.compiled import rods
from tests.compiled.test_thin import design, oblique
from tests.hard import dietmaier
from tests.robots.sketch import placement, rotation_of
from tests.support.comparing import refused
from tests.support.engines import TRUSTED, written_agrees
from tests.support.samples import slow
from tests.support.written_out import Interpreted

Z = np.array([0.0, 0.0, 1.0])


def at(x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    return placement(np.eye(3), [x, y, z])


def link(name: str, mass: float = 1.0) -> Link:
    return Link(name, mass, np.array([0.1, 0.3, 0.02]), 0.05 * mass * np.eye(3))


def hinge(name: str, parent: str, child: str, x: float = 0.0, y: float = 0.0) -> Joint:
    return Joint(name, "revolute", parent, child, at(x, y), Z)


def pin(name: str, a: str, b: str, at_a: tuple[float, float], at_b: tuple[float, float]) -> Closure:
    return Closure(name, "revolute", a, at(*at_a), b, at(*at_b), (0, 1, 2), "parallel")


def robot_of(
    name: str, links: Sequence[str], joints: Sequence[Joint], closures: Sequence[Closure],
    motors: Sequence[str], couplings: Sequence[Coupling] = (), **home: float,
) -> hybridyn.HybridRobot:  # fmt: skip
    """Build a robot of links of one kilogram."""
    base = Link("base", 0.0, np.zeros(3), np.zeros((3, 3)))
    return build_robot(
        Description(
            name, (base, *map(link, links)), tuple(joints), tuple(closures), tuple(couplings), tuple(motors),
            "here", {joint: (angle,) for joint, angle in home.items()},
        ),
        gravity=(0.0, -9.81, 0.0),
    )  # fmt: skip


# -------------------------------------------------------------------- pivots


def test_a_home_with_open_loops_chooses_no_pivots() -> None:
    """Dietmaier's platform with its slides at 0: all loops are open there, by a metre and more."""
    robot = build_robot(replace(dietmaier.robot("U").description, home={}))
    assert not robot.modules[0].mechanism.home_closes
    q, v, a, tau = random_states(robot, 4)
    (result,), guard = Interpreted(robot, ("ddm",)).batch("ddm", q, v, tau)
    assert (guard <= TRUSTED).sum() >= 3
    assert (difference(result, a)[guard <= TRUSTED] <= MODEL_AGREES["float64"]).all()


def test_a_robot_without_freedoms_has_models_and_is_not_exported(tmp_path: Path) -> None:
    fixed = Joint("weld", "fixed", "base", "block", at(1.0), Z)
    robot = robot_of("a block", ["block"], [fixed], [], [])
    assert robot.nv == 0
    library = Interpreted(robot, ("idm", "ddm", "kinematics", "lift"))
    verify(library, robot, choose(robot, None))
    refused(
        lambda: export(robot, tmp_path, name="block"),
        hybridyn.ModelError,
        "'a block' has no joint that moves: there is nothing to compute",
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_motions_without_inertia_do_not_enter_accelerations() -> None:
    """Rods between balls spin idly, without inertia: what a pivot of rounding gives is no acceleration."""
    robot = build_robot(replace(dietmaier.robot("S").description, home={}))
    q, v, tau = moving_states(robot, 2)
    (result,), guard = Interpreted(robot, ("ddm",)).batch("ddm", q, v, tau)
    assert (guard <= TRUSTED).all()
    assert (difference(result, hybridyn.ddm(robot, q, v, tau)) <= MODEL_AGREES["float64"]).all()


def test_a_singular_sample_chooses_no_pivots() -> None:
    """Rounding is all that is left of it after the first pivot: it must not outvote 24 good samples."""
    rng = np.random.default_rng(4)
    good = rng.normal(size=(24, 4, 4)) + 4 * np.eye(4)
    one = rng.normal(size=(4, 1)) @ rng.normal(size=(1, 4))
    ones = np.ones(4)
    wanted = choose_pivots(good, 4, ones, ones)
    lost = np.concatenate([good, one[None], np.full((1, 4, 4), np.nan)])
    assert choose_pivots(lost, 4, ones, ones).sizes[1:] == pytest.approx(wanted.sizes[1:], rel=0.5)


def test_pivots_that_fail_at_some_samples_are_still_pivots() -> None:
    """No entry is large everywhere: most samples decide, none divides by zero."""
    samples = np.zeros((30, 2, 2))
    samples[:20] = [[1.0, 0.0], [0.0, 1.0]]
    samples[20:] = [[0.0, 1.0], [1.0, 0.0]]
    pivots = choose_pivots(samples, 2, np.ones(2), np.ones(2))
    assert set(zip(pivots.rows, pivots.cols, strict=True)) == {(0, 0), (1, 1)}
    assert pivots.sizes == (1.0, 1.0)


# -------------------------------------------------------------------- loops rounded in the file


def rounded_bars() -> hybridyn.HybridRobot:
    """Three parallel cranks of a metre, the third's numbers rounded: it fits at 60 degrees alone."""
    return robot_of(
        "bars", ("one", "two", "three", "coupler"),
        [
            hinge("drive", "base", "one"), hinge("second", "base", "two", 2.0),
            hinge("third", "base", "three", 1.000002), hinge("elbow", "one", "coupler", 1.0),
        ],
        [pin("end", "coupler", "two", (2.0, 0.0), (1.0, 0.0)),
         pin("middle", "coupler", "three", (1.0, 0.0), (0.999999, 0.0))],
        ["drive"], drive=1.0, second=1.0, third=1.0, elbow=-1.0,
    )  # fmt: skip


def test_rounded_loops_are_the_general_paths_where_they_close_exactly() -> None:
    robot = rounded_bars()
    (module,) = robot.modules
    rows = module.mechanism.spanning_closures
    q = np.zeros((1, 4))
    for joint, angle in {"drive": 1.0, "second": 1.0, "third": 1.0, "elbow": -1.0}.items():
        q[0, robot.q_slices[robot.joint_index[joint]]] = angle * np.pi / 3
    for _ in range(6):  # every singular value of the rows counts here, the file's rounding too
        motion = rows.tree.sweep(q)
        q -= (np.linalg.pinv(rows.matrix(motion)[0], rcond=1e-10) @ rows.residual(q, motion)[0])[None]
    assert np.abs(rows.residual(q, rows.tree.sweep(q))).max() < 1e-12
    still, tau = np.zeros((1, robot.nv)), np.array([[5.0]])
    for name, model in (("ddm", hybridyn.ddm), ("idm", hybridyn.idm)):
        third = tau if name == "ddm" else hybridyn.ddm(robot, q, still, tau)
        (result,), guard = Interpreted(robot, (name,)).batch(name, q, still, third)
        off = difference(result, model(robot, q, still, third))
        assert guard[0] > TRUSTED or off[0] <= MODEL_AGREES["float64"], (name, off)


# -------------------------------------------------------------------- motors that do not move


def locked() -> hybridyn.HybridRobot:
    """A crank that two hinges hold at different places, motor and all, and an arm beside it."""
    return robot_of(
        "locked", ("held", "bar", "arm"),
        [
            hinge("stuck", "base", "held"), hinge("bolt", "held", "bar", 1.0),
            hinge("swing", "base", "arm", 0.5),
        ],
        [
            pin("end", "bar", "base", (1.0, 0.0), (2.0, 0.0)),
            pin("lock", "held", "base", (0.4, 0.0), (0.4, 0.0)),
        ],
        ["stuck", "swing"],
    )  # fmt: skip


def test_a_motor_that_loops_hold_still_has_no_effort() -> None:
    """Its row of the motion is rounding; efforts were rounding over rounding, and nothing compiled."""
    robot = locked()
    q, v, a, tau = random_states(robot, 3)
    efforts = hybridyn.idm(robot, q, v, a)
    assert (efforts[:, 0] == 0.0).all()
    np.testing.assert_allclose(efforts[:, 1], tau[:, 1], rtol=1e-11)
    written_agrees(robot)


def test_motors_that_no_posture_tells_apart_are_the_general_paths() -> None:
    """Two motors for two freedoms, geared to each other: one freedom has two motors, the other none."""
    gears = [
        Coupling("gear", (("a", 1.0), ("b", -0.7)), 0.0),
        Coupling("sum", (("b", 1.0), ("c", 1.0), ("d", 0.5)), 0.0),
    ]
    hinges = [
        hinge("a", "base", "one"), hinge("b", "one", "two", 1.0),
        hinge("c", "two", "three", 1.0), hinge("d", "three", "four", 1.0),
    ]  # fmt: skip
    robot, alone = (
        robot_of("geared", ("one", "two", "three", "four"), hinges, [], motors, gears)
        for motors in (["a", "b"], ["a"])
    )
    q, v, a, _ = random_states(robot, 2)
    tau, one = hybridyn.idm(robot, q, v, a), hybridyn.idm(alone, q, v, a)
    power, rates = one[:, 0] * v[:, 0], v[:, robot.motor_v]
    assert np.abs((tau * rates).sum(axis=1) - power).max() <= 1e-12 * np.abs(power).max()
    assert not (Interpreted(robot, ("idm",)).batch("idm", q, v, a)[1] <= TRUSTED).any()


def test_redundant_motors_on_gears_alone() -> None:
    """Their map holds plain numbers and no symbol."""
    robot = robot_of(
        "gears", ("one", "two", "three"),
        [hinge("a", "base", "one"), hinge("b", "one", "two", 1.0), hinge("c", "two", "three", 1.0)], [],
        ["a", "b", "c"], [Coupling("gear", (("a", 1.0), ("b", -0.5), ("c", 0.5)), 0.0)],
    )  # fmt: skip
    written_agrees(robot)


# -------------------------------------------------------------------- open couplings


def geared(kind: str) -> hybridyn.HybridRobot:
    """Two arms on a gear of any ratio, endless or with a slide on a rack that is off its zero."""
    joints = [
        replace(hinge("a", "base", "one"), kind=kind), replace(hinge("b", "one", "two", 1.0), kind=kind),
        Joint("c", "prismatic", "two", "three", at(0.5), np.array([1.0, 0.0, 0.0])),
    ]  # fmt: skip
    gears = [
        Coupling("gear", (("a", 1.0), ("b", -2.37)), 0.0),
        Coupling("rack", (("a", 0.3), ("c", -1.0)), 0.2),
    ]
    count = 1 if kind == "continuous" else 2
    return robot_of(
        "geared", ("one", "two", "three")[: count + 1], joints[: count + 1], [], ["a"], gears[:count]
    )


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
@pytest.mark.parametrize("what", ["positions", "rates", "accelerations"])
def test_an_open_coupling_is_no_state_of_the_models(kind: str, what: str) -> None:
    """The general path refuses it; the models computed on, as if the gear were closed."""
    robot = geared(kind)
    q, v, a, tau = random_states(robot, 3)
    library = Interpreted(robot, ("idm", "ddm"))
    written_agrees(robot, 3)
    at_q, at_v = (slices[robot.joint_index["b"]] for slices in (robot.q_slices, robot.v_slices))
    if what == "positions":
        q[:, at_q] += 1e-5
    else:
        (v if what == "rates" else a)[:, at_v] += 1e-5
    refused(
        lambda: hybridyn.idm(robot, q, v, a), hybridyn.AssemblyError, f"the {what} do not close the loops"
    )
    assert (library.batch("idm", q, v, a)[1] > TRUSTED).all()
    if what != "accelerations":
        assert (library.batch("ddm", q, v, tau)[1] > TRUSTED).all()


@pytest.mark.parametrize("turns", [1, -3])
def test_whole_turns_of_one_endless_joint_open_no_coupling(turns: int) -> None:
    """Cosine and sine do not count them: the residual is known modulo a turn of the last joint."""
    robot = geared("continuous")
    q = hybridyn.assemble(robot, motors={"a": 2 * np.pi * turns + 0.3})[0][None]
    ratio = np.zeros((1, 2))
    for joint, rate in {"a": 2.37, "b": 1.0}.items():
        ratio[:, robot.v_slices[robot.joint_index[joint]]] = rate
    v, a = 0.4 * ratio, -0.2 * ratio
    (tau,), guard = Interpreted(robot, ("idm",)).batch("idm", q, v, a)
    wanted = hybridyn.idm(robot, q, v, a)
    assert guard[0] <= TRUSTED
    assert tau == pytest.approx(wanted, rel=MODEL_AGREES["float64"])


# -------------------------------------------------------------------- one freedom


def door() -> hybridyn.HybridRobot:
    """A door with two hinges: a tree of one freedom, and a loop."""
    hinges = [Joint("hinge", "revolute", "base", "door", np.eye(4), Z)]
    second = Closure(
        "second", "revolute", "base", at(0, 0, 1.5), "door", at(0, 0, 1.5), (0, 1, 2), "parallel"
    )
    return robot_of("door", ("door",), hinges, [second], ["hinge"])


def test_a_door_with_two_hinges() -> None:
    robot = door()
    written_agrees(robot)
    manifold = Manifold(robot)
    residual, K = manifold.looped[0][1].at(np.array([0.3]))
    assert K.shape == (5, 1)
    np.testing.assert_allclose(K, 0.0, atol=1e-15)
    np.testing.assert_allclose(residual, 0.0, atol=1e-15)
    verify(Interpreted(robot, ("idm", "ddm", "kinematics", "lift")), robot, choose(robot, None))


@pytest.mark.parametrize("digits", [6, 16])
def test_a_door_whose_hinges_are_askew_by_rounding_still_turns(digits: int) -> None:
    """Rows that are rounding alone: the largest of them is no measure, and the door not locked."""
    frame = placement(rotation_of(np.array([0.2, -0.5, 0.4, 0.7])), [0.1, 0.2, 0.3])
    axis = frame[:3, :3] @ Z
    lower = placement(np.round(frame[:3, :3], digits), np.round(frame[:3, 3], digits))
    upper = placement(np.round(frame[:3, :3], digits), np.round(frame[:3, 3] + 1.5 * axis, digits))
    leaf = at(0, 0, 1.5)
    hinges = [Joint("hinge", "revolute", "base", "door", lower, Z)]
    second = Closure("second", "revolute", "base", upper, "door", leaf, (0, 1, 2), "parallel")
    robot = robot_of("door", ("door",), hinges, [second], ["hinge"])
    assert robot.mobility == 1
    q, v, a, tau = random_states(robot, 3)
    np.testing.assert_allclose(hybridyn.idm(robot, q, v, a), tau, rtol=1e-9)


# -------------------------------------------------------------------- verification


class Edited:
    """A library whose numbers and guards are changed on the way."""

    dtype = np.dtype("float64")

    def __init__(self, robot: hybridyn.HybridRobot, edit: Any) -> None:
        self._right, self._edit = Interpreted(robot), edit
        self.programs, self.asked = self._right.programs, 0

    def batch(self, name: str, *inputs: np.ndarray) -> Any:
        """Run one model and change what it says."""
        outputs, guard = self._right.batch(name, *inputs)
        self.asked += name == "ddm"
        return self._edit(name, outputs, guard)


def every_third(guard: np.ndarray, others: Any = 2.0) -> np.ndarray:
    """Return guards that trust every third sample."""
    return np.where(np.arange(len(guard)) % 3, others, guard)


#: Models that say something else, what is raised, what is logged, and how often states are drawn.
EDITS: dict[str, tuple[Any, str, str, int]] = {
    "wrong wherever it trusts itself": (
        lambda name, outputs, guard: (
            (outputs[0] * np.where(every_third(0 * guard) > 1, 1.0, 1 + 1e-8)[:, None], *outputs[1:]),
            every_third(0 * guard),
        ),
        "'ddm' of the robot 'door' differs", "", 1,
    ),
    "trusts few": (
        lambda name, outputs, guard: (outputs, every_third(guard)),
        "", "'door': the compiled 'idm' hands 24 of 36 random states", 3,
    ),
    "says nothing of itself": (
        lambda name, outputs, guard: (outputs, every_third(guard, np.nan)),
        "'ddm' of the robot 'door' differs from the general path by nan", "", 1,
    ),
    "trusts nothing": (
        lambda name, outputs, guard: (outputs, guard + 2.0),
        "models of the robot 'door' would hand every one of 96 random states",
        "'door': the compiled 'ddm' hands 96 of 96", 8,
    ),
    "one model trusts nothing": (
        lambda name, outputs, guard: (outputs, guard + 2.0 * (name == "idm")),
        "", "'door': the compiled 'idm' hands 96 of 96", 1,
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", EDITS)
def test_models_that_say_something_else(what: str, caplog: pytest.LogCaptureFixture) -> None:
    """States that the general path computes prove nothing; more are drawn where few count."""
    edit, raised, logged, draws = EDITS[what]
    robot = door()
    library = Edited(robot, edit)
    if raised:
        refused(lambda: verify(library, robot, choose(robot, None)), hybridyn.CompileError, raised)
    else:
        verify(library, robot, choose(robot, None))
    assert library.asked == draws
    assert logged in caplog.text
    assert bool(caplog.records) == bool(logged)


class WithoutDirectModel:
    """Models of a robot by the general path; the direct model trusts no sample."""

    dtype, programs = "float64", ("idm", "ddm", "kinematics")

    def __init__(self, robot: hybridyn.HybridRobot, effects: Effects, off: float) -> None:
        self.robot, self.effects, self.off = robot, effects, off

    def batch(self, name: str, *inputs: np.ndarray) -> Any:
        """Run a model; efforts are off by a number."""
        q, v, x = inputs
        good = np.zeros(len(q))
        if name == "ddm":
            return (np.zeros_like(v),), good + 2.0
        if name == "kinematics":
            return (body_rows(self.robot, q, v, x),), good
        return (hybridyn.idm(self.robot, q, v, x, effects=self.effects) + self.off,), good


def test_the_inverse_model_is_verified_where_a_motion_has_no_inertia(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The five-bar moves legs alone: without their inertia its direct model is not defined."""
    monkeypatch.setattr(comparing, "ROUNDS", 1)
    robot = hybridyn.load("five_bar")
    effects = choose(robot, ["default", "massless_legs"])
    verify(WithoutDirectModel(robot, effects, 0.0), robot, effects)
    assert "the compiled 'ddm' hands 12 of 12 random states to the general path, which refuses" in caplog.text
    assert "has no inertia" in caplog.text
    refused(
        lambda: verify(WithoutDirectModel(robot, effects, 1e-5), robot, effects),
        hybridyn.CompileError,
        "'idm' of the robot 'five_bar' differs",
    )


def crossing() -> hybridyn.HybridRobot:
    """A crank whose thin rod stands on three hinges that cross, none along the rod, and pushes a slide."""
    return build_robot(oblique(rods.crank(3, "revolutes", thin=True)))


def on_light_base(mass: float) -> hybridyn.HybridRobot:
    """A base that floats and carries three arms of a kilogram, on hinges across each other."""
    axes = [hinge(f"j{k}", "base", f"arm{k}", 0.2 * k, 0.1) for k in range(3)]
    joints = tuple(replace(joint, axis=axis) for joint, axis in zip(axes, np.eye(3), strict=True))
    base = Link("base", mass, np.zeros(3), mass * np.eye(3))
    arms, motors = tuple(link(joint.child) for joint in joints), tuple(joint.name for joint in joints)
    return build_robot(
        Description("arms", (base, *arms), joints, (), (), motors, "here", {}), base="floating"
    )


def on_light_post() -> hybridyn.HybridRobot:
    """A hinge turns 1e-7 kg, on which a second one along it turns a kilogram."""
    joints = [hinge("first", "base", "post"), hinge("second", "post", "arm")]
    robot = robot_of("post", ["post", "arm"], joints, [], ["first", "second"])
    links = tuple(link(x.name, 1e-7) if x.name == "post" else x for x in robot.description.links)
    return build_robot(replace(robot.description, links=links))


def driven_spin() -> hybridyn.HybridRobot:
    """A motor turns a thin rod about its line."""
    description = rods.crank(3, "revolutes", thin=True)
    spin = next(joint.name for joint in description.joints if "rod" in joint.name)
    return build_robot(replace(description, motors=(*description.motors, spin)))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (crossing, "the motion of .*(cross|rod).* has no inertia, and no joint has this motion alone. Give"),
        (
            driven_spin,
            "refuses 12 of the first 12 .*the motion of .* has no inertia, and a force .*Give a mass",
        ),
        (
            on_light_post,
            r"the motion of joint 'first' has .*e-0[78] of the inertia .*limit 1e-05.*Give the bodies",
        ),
    ],
)
def test_the_reason_names_the_motion_and_what_to_do(
    make: Callable[[], hybridyn.HybridRobot], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparing, "ROUNDS", 1)
    robot = make()
    refused(
        lambda: verify(Interpreted(robot, ("ddm",)), robot, choose(robot, None)),
        hybridyn.CompileError,
        f"would hand every one of 12 random states to the general path.*{words}",
    )


def test_models_that_trust_themselves_nowhere_are_not_exported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In C there is no general path: a guard above 1 at every state is of no use."""
    monkeypatch.setattr(comparing, "ROUNDS", 1)
    description = crossing().description
    slide = next(joint.name for joint in description.joints if "slide" in joint.name)
    robot = build_robot(replace(description, motors=(*description.motors, slide)))  # efforts need weights
    words = "would hand every one of 12 random states to the general path"
    refused(lambda: export(robot, tmp_path / "crossing"), hybridyn.CompileError, words)
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("mass", [0.0, 1e-6, 1.0])
def test_forces_on_a_light_base_are_compared_with_all_their_terms(mass: float) -> None:
    """The base has nothing to compare with the wrench of what it carries, which cancels to rounding."""
    robot = on_light_base(mass)
    q, v, a, tau = random_states(robot, 6)
    (found,), guard = Interpreted(robot, ("idm",)).batch("idm", q, v, a)
    assert (guard <= TRUSTED).all()
    assert difference(found, tau).max() <= 1e-6
    _, guard = Interpreted(robot, ("idm",)).batch("idm", q, v, a + 1e-6 * np.abs(a).max())
    assert (guard > TRUSTED).all()


@pytest.mark.parametrize(
    ("name", "foot", "axial", "beside"),
    [
        ("crank", "revolutes", 1e-9, 0.0),
        ("crank", "ball", 0.0, 1e-8),
        *(slow("crank", "revolutes", axial, 0.0) for axial in (1e-14, 1e-13, 1e-12, 1e-11, 1e-10)),
        *(slow("crank", "floating", axial, 0.0) for axial in (1e-14, 1e-12, 1e-9)),
        *(slow("slides", foot, axial, 0.0) for foot in ("revolutes", "ball") for axial in (1e-14, 1e-9)),
        *(slow("crank", foot, 1e-14, beside) for foot in ("ball", "floating") for beside in (1e-9, 1e-8)),
        *(slow("crank", foot, 0.0, beside) for foot in ("ball", "floating") for beside in (1e-9, 1e-7)),
    ],
)
def test_little_inertia_about_a_rods_line_is_no_bug(
    name: str, foot: rods.Foot, axial: float, beside: float
) -> None:
    """Both paths are right to rounding of the forces; a force on a spin without inertia is refused."""
    description = getattr(rods, name)(3, foot)
    values = [design(x, axial, beside) if "rod" in x.name else {} for x in description.links]
    robot = build_robot(description).with_parameters({k: x for each in values for k, x in each.items()})
    crosses = [joint.name for joint in robot.description.joints if "cross" in joint.name]
    effects = ["default", *([ViscousFriction(dict.fromkeys(crosses, 1e-7))] if crosses else [])]
    said = ""
    try:
        verify(Interpreted(robot, effects=effects), robot, choose(robot, effects))
    except hybridyn.CompileError as error:
        said = str(error)
    assert not said or "has no inertia" in said


@pytest.mark.parametrize("name", ["ddm", "idm"])
def test_rounding_is_allowed_for(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the general path's own rounding is 1e-11, a difference of 2e-10 is no error; of 2e-8 it is."""
    robot, effects = door(), choose(door(), None)
    general, size = GENERAL[name], 1e-11

    def rounding(r: hybridyn.HybridRobot, q: np.ndarray, *given: Any, **more: Any) -> np.ndarray:
        return general(r, q, *given, **more) * (1 + size * np.where(q[:, :1] == known(q), 0.0, 1.0))

    seen: set[float] = set()

    def known(q: np.ndarray) -> np.ndarray:
        seen.update(q[:, 0] if not any(np.isclose(x, list(seen), rtol=1e-14).any() for x in q[:, 0]) else ())
        return np.array([[x] if x in seen else [np.nan] for x in q[:, 0]])

    monkeypatch.setitem(GENERAL, name, rounding)
    for off, wrong in ((2e-10, False), (2e-8, True)):

        def shifted(model: str, outputs: Any, guard: np.ndarray, off: float = off) -> Any:
            return (outputs[0] * (1 + off * (model == name)), *outputs[1:]), guard

        seen.clear()
        judged = partial(verify, Edited(robot, shifted), robot, effects)
        if wrong:
            refused(judged, hybridyn.CompileError, f"'{name}' of the robot 'door' differs")
        else:
            judged()


# -------------------------------------------------------------------- what is no error of ours


def test_any_failure_is_a_compile_error_with_the_robots_name(monkeypatch: pytest.MonkeyPatch) -> None:
    import hybridyn.compiled.programs.whole_robot as file

    def broken(*_: Any, **__: Any) -> Any:
        return 1.0 / 0.0

    robot = door()
    monkeypatch.setattr(file, "programs", broken)
    refused(
        lambda: hybridyn.compile(robot),
        hybridyn.CompileError,
        r"robot 'door' cannot be compiled \(ZeroDivisionError",
    )
