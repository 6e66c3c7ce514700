"""Every public function gets the same input on both paths: equal results, or errors in the same words."""

import pickle
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.failures import check_agreement
from hybridyn.compiled.programs.quantities import following
from hybridyn.dynamics.quantities.independent import independent_coordinates
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.dynamics.test_guards import parallelogram
from tests.dynamics.test_idm import flat_five_bar
from tests.quantities.ankle import JOINTS, ankle, leg
from tests.robots.locked import hinged_five_bar, named
from tests.robots.mechanisms import random_mechanism
from tests.robots.parts import rssr
from tests.robots.shipped import ROBOTS
from tests.robots.sketch import Sketch
from tests.support.comparing import SOLVED, close_to, refused, same_bits, same_words
from tests.support.engines import General
from tests.support.samples import slow

#: The functions over coordinates, with the arguments after the positions; those of links; the others.
OVER_JOINTS = {
    "motion_map": "", "motion_map and rate": "v", "mass_matrix": "", "gravity": "", "link_jacobian": "l",
    "bias": "v", "coriolis": "v", "coriolis_matrix": "v", "joint_map": "",
}  # fmt: skip
OTHERS = {
    "delassus": "l", "delassus of three": "m", "operational_inertia": "l", "operational_inertia of two": "m",
    "energy": "v", "kinematics": "va", "idm": "va", "ddm": "vu",
}  # fmt: skip
#: Of the largest entry, in single precision: rounding times the condition of an operational-space inertia.
WITHIN = {"float64": SOLVED, "float32": 1e-3}
ELBOWS = ["m1_left_elbow", "m1_right_elbow"]


def compared(
    compiled: hybridyn.CompiledRobot,
    q: Array,
    v: Array,
    coordinates: Sequence[Sequence[str] | None] = (None,),
    a: Array | None = None,
) -> tuple[int, int]:
    """Compare every function; return how many calls gave results, and how many samples were general.

    Accelerations are zero by default, which may open the loops.
    """
    robot, count, general_samples = compiled.robot, 0, 0
    general, rng = General(robot, compiled.effects), np.random.default_rng(0)
    weight = 9.81 * sum(body.mass for body in robot.bodies.bodies)
    links = [list(robot.bodies.place)[-1], robot.description.root, list(robot.bodies.place)[2]]
    u = rng.normal(size=(*q.shape[:-1], len(robot.motors)))
    given = {"l": links[0], "m": links, "v": v, "a": np.zeros_like(v) if a is None else a, "u": u}
    calls = [(n, letters, {"joints": x}) for x in coordinates for n, letters in OVER_JOINTS.items()]
    calls += [(n, letters, {}) for n, letters in OTHERS.items()]
    calls += [(n, "l", {"axes": "link"}) for n in ("link_jacobian", "delassus")]
    for name, letters, options in calls:
        if name == "joint_map" and options["joints"] is None:
            continue

        def call(on: Any, name: str = name, letters: str = letters, options: Any = options) -> Any:
            """Call one function of an engine."""
            found = getattr(on, name.split()[0])(q, *(given[letter] for letter in letters), **options)
            maps = "motors_per_joints", "joints_per_motors", "curvature", "joint_positions", "motor_positions"
            return tuple(getattr(found, x) for x in maps) if name == "joint_map" else found

        try:
            wanted = call(general)
        except hybridyn.HybridynError:
            same_words(partial(call, compiled), partial(call, general))
            continue
        before = compiled.recomputed
        close_to(call(compiled), wanted, WITHIN[str(compiled.dtype)], weight)
        count, general_samples = count + 1, general_samples + compiled.recomputed - before
    return count, general_samples


def spinning() -> hybridyn.HybridRobot:
    """Return a spatial four-bar whose rod spins idly between two balls."""
    s = Sketch(np.random.default_rng(0))
    s.fixed_links = 0.0
    rssr(s, "base", s.place())
    return build_robot(s.description("spinning"))


Case = tuple[
    Callable[[Path], hybridyn.HybridRobot], Callable[[hybridyn.HybridRobot], Sequence[Any]], str, str
]


def five_bar(_: Path, **options: Any) -> hybridyn.HybridRobot:
    return hybridyn.load("five_bar", **options)


def shipped_one(name: str, _: Path) -> hybridyn.HybridRobot:
    return hybridyn.load(name)


#: Regular robots: how they are made, coordinates besides the motors, effects and the type of numbers.
REGULAR: dict[str, Case] = {
    "five_bar": (
        five_bar,
        lambda r: [ELBOWS, r.motors[:1], [*r.motors[:1], "nobody"], [], [*ELBOWS, *r.motors]],
        "default",
        "float64",
    ),
    "five_bar moving": (partial(five_bar, base="moving"), lambda r: [], "model", "float64"),
    "five_bar floating": (partial(five_bar, base="floating"), lambda r: [ELBOWS], "model", "float64"),
    "gough_stewart single": (partial(shipped_one, "gough_stewart"), lambda r: [], "default", "float32"),
    "ankle": (ankle, lambda r: [JOINTS], "default", "float64"),
    **{
        name: (partial(shipped_one, name), lambda r: [r.motors[:1]], "model", "float64")
        for name in ROBOTS[:-1]
    },
    "five_bar of its files": (five_bar, lambda r: [ELBOWS], "model", "float64"),
}


@pytest.mark.parametrize("name", ["five_bar of its files", *map(slow, list(REGULAR)[:-1])])
def test_regular_states(name: str, tmp_path: Path) -> None:
    """One sample and many; the general path computes no sample for the compiled one."""
    make, coordinates, effects, dtype = REGULAR[name]
    compiled = hybridyn.compile(make(tmp_path), effects, dtype=dtype)
    q, v, tau = moving_states(compiled.robot, 3, 1)
    a = hybridyn.ddm(compiled.robot, q, v, tau, effects=effects)
    for q_v_a in ((q, v, a), (q[1], v[1], a[1])):
        count, general_samples = compared(
            compiled, *q_v_a[:2], [None, *coordinates(compiled.robot)], q_v_a[2]
        )
        assert count >= 15
        assert general_samples == 0


#: Robots at postures or with coordinates that some functions refuse, and how many calls compute something.
REFUSING: dict[
    str,
    tuple[
        Callable[[Path], hybridyn.HybridRobot], Callable[[hybridyn.HybridRobot], Any], Callable[..., Any], int
    ],
] = {
    "a hinge that the loop locks": (
        lambda _: hinged_five_bar(("ja", "jc")),
        lambda r: r.home,
        lambda r: [named(r, *ends) for ends in (("ja", "jx"), ("jx", "jd"), ("ja", "jd"), ("jx",))],
        20,
    ),
    "a locked motor": (
        lambda _: hinged_five_bar(("ja", "jx")),
        lambda r: r.home,
        lambda r: [named(r, "ja", "jd")],
        3,
    ),
    "open loops": (five_bar, lambda r: r.home + 0.1 * np.eye(r.nq)[r.q_slices[1].start], lambda r: [], 0),
    "a rod that spins": (
        lambda _: spinning(),
        lambda r: r.home,
        lambda r: [r.joints[:1], r.joints[1:2], r.joints[-1:]],
        3,
    ),
    "motors that lose a direction": (
        lambda _: flat_five_bar()[0],
        lambda r: np.array([r.home, r.home, flat_five_bar()[1]]),
        lambda r: [["left_elbow", "right_elbow"], ["left", "left_elbow"]],
        3,
    ),
    "a toe without motor": (leg, lambda r: r.home, lambda r: [JOINTS], 8),
    "closures that lose rank": (parallelogram, lambda r: np.zeros(3), lambda r: [], 0),
}


@pytest.mark.parametrize(
    "name", [*list(REFUSING)[:1], "open loops", *(slow(x) for x in list(REFUSING)[1:] if x != "open loops")]
)
def test_states_and_coordinates_that_are_refused(name: str, tmp_path: Path) -> None:
    make, posture, coordinates, least = REFUSING[name]
    compiled = hybridyn.compile(make(tmp_path))
    q = posture(compiled.robot)
    v = np.zeros((*q.shape[:-1], compiled.robot.nv))
    assert compared(compiled, q, v, [None, *coordinates(compiled.robot)])[0] >= least


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_random_mechanisms(seed: int) -> None:
    """The coordinates are joints drawn at random, so that some of them are locked, idle or too many."""
    robot = build_robot(random_mechanism(seed))
    try:
        q, v, _ = (x[0] for x in moving_states(robot, 1, seed))
    except hybridyn.HybridynError:
        q, v = robot.home, np.zeros(robot.nv)
    rng, names = np.random.default_rng(seed), robot.motors + tuple(robot.joints)
    drawn = [list(dict.fromkeys(rng.choice(names, size=len(robot.motors) or 1))) for _ in range(6)]
    compared(hybridyn.compile(robot), q, v, [None, *drawn])


def test_batches_in_several_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    bar = hybridyn.compile(hybridyn.load("five_bar"))
    q, v, _ = moving_states(bar.robot, 5, 3)
    whole = bar.mass_matrix(q), bar.coriolis(q, v), bar.motion_map(q, v)
    monkeypatch.setattr("hybridyn.compiled.programs.quantities.calls.ROWS_AT_ONCE", 4)
    same_bits((bar.mass_matrix(q), bar.coriolis(q, v), bar.motion_map(q, v)), whole)


@pytest.mark.slow
def test_the_acceleration_of_a_moving_base() -> None:
    compiled = hybridyn.compile(hybridyn.load("five_bar", base="moving"), "model")
    (q, v, _), given = moving_states(compiled.robot, 3, 1), np.arange(6.0)
    wanted = hybridyn.bias(compiled.robot, q, v, base_acceleration=given, effects="model")
    close_to(compiled.bias(q, v, base_acceleration=given), wanted, SOLVED)


@pytest.mark.slow
def test_links_of_a_robot_at_a_parallel_singularity_have_a_delassus_matrix() -> None:
    """Motors lose a direction there, inertia does not: the general path computes these samples alone."""
    robot, flat = flat_five_bar()
    compiled, link = hybridyn.compile(robot), list(robot.bodies.place)[-1]
    q = np.array([robot.home, flat])
    close_to(compiled.delassus(q, link), hybridyn.delassus(robot, q, link), SOLVED)
    assert compiled.recomputed == 1


@pytest.mark.slow
def test_joint_maps_from_positions_by_name(tmp_path: Path) -> None:
    compiled = hybridyn.compile(ankle(tmp_path))
    given = {"pitch": np.linspace(0.0, 0.4, 5), "roll": np.full(5, -0.2)}
    wanted = hybridyn.joint_map(compiled.robot, given, JOINTS)
    found = pickle.loads(pickle.dumps(compiled.joint_map(given, JOINTS)))
    close_to((found.q, found.curvature), (wanted.q, wanted.curvature), SOLVED)
    assert compiled.recomputed == 0


@pytest.mark.slow
def test_forces_of_a_floating_robot_come_from_models_under_a_wrench_on_its_base() -> None:
    compiled = hybridyn.compile(hybridyn.load("five_bar", base="floating"))
    robot, (q, v, _) = compiled.robot, moving_states(compiled.robot, 2, 1)
    link = list(robot.bodies.place)[-1]
    close_to(compiled.bias(q, v), hybridyn.bias(robot, q, v), SOLVED)
    close_to(compiled.delassus(q, link), hybridyn.delassus(robot, q, link), SOLVED)
    assert compiled.recomputed == 0


@pytest.mark.parametrize("off", [2.0, np.nan, [0.0, np.nan]])
def test_a_difference_above_its_limit_or_nan_is_refused(off: Any) -> None:
    robot = hybridyn.load("five_bar")
    check_agreement(robot, "map", [0.0, 1.0], 1.0)
    words = "the compiled map of the robot 'five_bar' differs from the general path by"
    refused(lambda: check_agreement(robot, "map", off, 1.0), hybridyn.CompileError, words)


def test_a_motion_map_that_is_trusted_nowhere_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = hybridyn.load("five_bar")

    def batch(states: list[np.ndarray], threads: int) -> Any:
        """Trust nothing."""
        return states, np.full(len(states[0]), np.inf)

    calls = SimpleNamespace(batch=batch, trusted=1.0, dtype=np.dtype(float))
    monkeypatch.setattr(following, "Library", lambda _: SimpleNamespace(programs={"following": calls}))
    moves = following.Following(robot, independent_coordinates(robot, None), SimpleNamespace())
    refused(
        lambda: following.check_following(moves), hybridyn.CompileError, "hand every one of 96 random states"
    )
