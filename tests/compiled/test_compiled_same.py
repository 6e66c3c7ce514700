"""Every public function gets the same input on both paths: the results are equal, or both raise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot, HybridynError
from hybridyn.compiled.equations.states import moving_states
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot
from tests.comparing import SOLVED
from tests.dynamics.test_idm import flat_five_bar
from tests.locked import hinged_five_bar, named
from tests.mechanisms import random_mechanism
from tests.parts import rssr
from tests.samples import slow
from tests.sketch import Sketch

#: The functions of both paths over coordinates, with the arguments after the positions.
OVER_JOINTS = {
    "motion_map": "", "mass_matrix": "", "gravity": "", "link_jacobian": "l", "bias": "v", "coriolis": "v",
    "coriolis_matrix": "v",
}  # fmt: skip
#: Those of links, of motions and of efforts.
OTHERS = {
    "delassus": "l", "operational_inertia": "l", "energy": "v", "kinematics": "va", "idm": "va", "ddm": "vu",
}  # fmt: skip


def spinning() -> HybridRobot:
    """Return a spatial four-bar whose rod spins idly between two balls."""
    s = Sketch(np.random.default_rng(0))
    s.fixed_links = 0.0
    rssr(s, "base", s.place())
    return build_robot(s.description("spinning"))


def arrays(result: Any) -> list[Array]:
    """Return the numbers of a result: an array, or a tuple, dictionary or record of them."""
    if isinstance(result, dict):
        return [x for name in sorted(result) for x in arrays(result[name])]
    if isinstance(result, tuple):
        return [x for part in result for x in arrays(part)]
    if isinstance(result, hybridyn.JointMap):
        return [result.motors_per_joints, result.joints_per_motors]
    parts = getattr(result, "__dataclass_fields__", None)
    return [x for name in parts for x in arrays(getattr(result, name))] if parts else [np.asarray(result)]


def same(name: str, compiled: Callable[[], Any], general: Callable[[], Any], size: float) -> bool:
    """Compare two calls, relative to the largest entry or `size`; return whether they computed something."""
    try:
        wanted = arrays(general())
    except HybridynError as error:
        with pytest.raises(type(error)):
            print(name, "computed in C:", compiled())
        return False
    for x, y in zip(arrays(compiled()), wanted, strict=True):
        off = np.abs(x - y).max(initial=0.0)
        assert off <= SOLVED * max(size, np.abs(y).max(initial=0.0)), name
    return True


def compared(
    robot: HybridRobot, q: Array, coordinates: Sequence[Sequence[str] | None], effects: str = "default"
) -> int:
    """Compare every function at one posture; return how many calls computed something."""
    compiled = hybridyn.compile(robot, effects)
    rng, weight = np.random.default_rng(0), 9.81 * sum(body.mass for body in robot.bodies.bodies)
    try:
        v = hybridyn.motion_map(robot, q) @ rng.normal(size=len(robot.motors))
    except HybridynError:  # nothing moves that the motors prescribe
        v = np.zeros(robot.nv)
    link = list(robot.bodies.place)[-1]
    given = {"l": link, "v": v, "a": np.zeros(robot.nv), "u": rng.normal(size=len(robot.motors))}
    own, count = {"effects": compiled.effects}, 0

    def both(name: str, letters: str, **options: Any) -> int:
        """Compare one function."""
        after = [given[letter] for letter in letters]
        general = getattr(hybridyn, name)
        massless = name in ("motion_map", "link_jacobian", "kinematics", "joint_map")
        more = options if massless else {**own, **options}
        return same(
            f"{name} {options}",
            lambda: getattr(compiled, name)(q, *after, **options),
            lambda: general(robot, q, *after, **more),
            weight,
        )

    for joints in coordinates:
        count += sum(both(name, letters, joints=joints) for name, letters in OVER_JOINTS.items())
        count += 0 if joints is None else both("joint_map", "", joints=joints)
    count += sum(both(name, letters) for name, letters in OTHERS.items())
    for far in (0.01, 50.0):
        asked = {name: x + far for name, x in zip(robot.motors, positions(robot, q), strict=True)}
        count += same(
            f"assemble {far}",
            lambda motors=asked: compiled.assemble(motors=motors),
            lambda motors=asked: hybridyn.assemble(robot, motors=motors),
            1.0,
        )
    return count


def positions(robot: HybridRobot, q: Array) -> Array:
    """Return the motors' positions."""
    at = [robot.q_slices[robot.joint_index[name]] for name in robot.motors]
    return np.array([q[s][0] if s.stop - s.start == 1 else np.arctan2(*q[s][::-1]) for s in at])


def test_a_five_bar_by_motors_and_by_elbows() -> None:
    robot = hybridyn.load("five_bar")
    q = moving_states(robot, 1, 1)[0][0]
    both = [None, ["m1_left_elbow", "m1_right_elbow"], ["m1_left_drive"], ["m1_left_drive", "nobody"]]
    assert compared(robot, q, both) > 20


@pytest.mark.parametrize("motors", [("ja", "jc"), slow(("ja", "jx"))])
def test_a_hinge_that_the_loop_locks(motors: tuple[str, str]) -> None:
    robot = hinged_five_bar(motors)
    choices = [None, *([*named(robot, *ends)] for ends in (("ja", "jx"), ("ja", "jd"), ("jx",)))]
    assert compared(robot, robot.home, choices) > (15 if "jx" not in motors else 3)


@pytest.mark.slow
def test_a_rod_that_spins_idly() -> None:
    robot = spinning()
    names = [*robot.joints]
    assert compared(robot, robot.home, [None, names[:1], names[1:2], names[-1:]]) > 3


@pytest.mark.slow
def test_a_posture_where_the_motors_lose_a_direction() -> None:
    robot, q = flat_five_bar()
    assert compared(robot, q, [None, ["left_elbow", "right_elbow"], ["left", "left_elbow"]]) > 3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["five_bar", "delta", "gough_stewart", "stewart_ur5"])
def test_shipped_robots_with_all_that_their_files_state(name: str) -> None:
    robot = hybridyn.load(name)
    compared(robot, moving_states(robot, 1, 1)[0][0], [None, robot.motors[:1]], "model")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_random_mechanisms(seed: int) -> None:
    """The coordinates are joints drawn at random, so that some of them are locked, idle or too many."""
    robot = build_robot(random_mechanism(seed))
    try:
        q = moving_states(robot, 1, seed)[0][0]
    except HybridynError:
        q = robot.home
    rng, names = np.random.default_rng(seed), robot.motors + tuple(robot.joints)
    drawn = [list(dict.fromkeys(rng.choice(names, size=len(robot.motors) or 1))) for _ in range(6)]
    compared(robot, q, [None, *drawn])
