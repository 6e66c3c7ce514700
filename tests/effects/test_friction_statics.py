"""Friction that grows with load, against statics by hand: linkages with friction circles, and what jams."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

import hybridyn
from hybridyn.description.records import Closure, Description, Joint, JointKind, Link
from hybridyn.effects import LoadFriction
from hybridyn.errors import ActuationError
from hybridyn.spatial import Array
from hybridyn.structure.building import build_robot

SPEED = 40.0  # in widths of the smoothed sign at least that much: tanh(40) is 1
ROUNDED = 1e-12  # of the largest effort
X, Y, Z = WORLD = np.eye(3)
#: In the plane alone, so that no load across it is shared: two translations and one rotation.
WELD, PIN = ((0, 2), "perpendicular"), ((0, 1), "free")
FRAMES = {"perpendicular": (np.array([Y, Z, X]).T, np.array([Z, X, Y]).T), "free": (np.eye(3), np.eye(3))}

#: Name, kind, parent, child, point of the joint in the plane, axis; a joint with a pitch is a screw.
Parts = Sequence[tuple[str, str, str, str, tuple[float, float], Array]]
#: Links, point in the plane, and the locked translations and rotations.
Tie = tuple[str, str, tuple[float, float], tuple[tuple[int, ...], str]]
Jam = tuple[hybridyn.HybridRobot, LoadFriction, dict[str, Array], str, float]


def linkage(
    parts: Parts, ties: Sequence[Tie], motors: Sequence[str], pitch: float = 0.0
) -> hybridyn.HybridRobot:
    """Lay out a mechanism in the plane of x and y; all frames are parallel to the world's at home."""
    at = {"ground": np.zeros(2)} | {child: np.array(point) for _, _, _, child, point, _ in parts}

    def placed(point: Array, axes: Array = WORLD) -> Array:
        out = np.eye(4)
        out[:3, :3], out[:2, 3] = axes, point
        return out

    joints = tuple(
        Joint(name, JointKind(kind), parent, child, placed(at[child] - at[parent]), axis, pitch=pitch)
        for name, kind, parent, child, _, axis in parts
    )
    links = tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in at)
    closures = tuple(
        Closure(f"tie{i}", "rows", a, placed(point - at[a], A), b, placed(point - at[b], B), *rows)
        for i, (a, b, point, rows) in enumerate(ties)
        for A, B in [FRAMES[rows[1]]]
    )
    return build_robot(Description("plane", links, joints, closures, motors=tuple(motors)))


def effort(
    robot: hybridyn.HybridRobot, law: LoadFriction, load: dict[str, Array], rate: float = SPEED
) -> tuple[float, Array]:
    """Compute the effort of the first motor, and all rates, without weight and inertia."""
    q, v, a = hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, (0.0, rate, 0.0)))
    tau = hybridyn.idm(robot, q[None], v[None], a[None], wrenches=load, effects=[law])
    return float(tau[0, 0]), v


@pytest.mark.parametrize("angle", [0.4, 2.0, -1.1])
def test_a_slider_crank_with_friction_in_all_joints(angle: float) -> None:
    """The rod's force touches the friction circles of both pins."""
    r, rod, push, (bearing, pin, wrist), mu = 0.3, 0.8, 100.0, (0.01, 0.006, 0.004), 0.1
    A = r * np.array([np.cos(angle), np.sin(angle)])
    tilt = np.arcsin(A[1] / rod)  # of the rod, downwards
    B = (A[0] + rod * np.cos(tilt), 0.0)
    robot = linkage(
        [("crank", "revolute", "ground", "arm", (0, 0), Z), ("pin", "revolute", "arm", "rod", tuple(A), Z),
         ("wrist", "revolute", "rod", "ring", B, Z), ("slide", "prismatic", "ground", "block", B, X)],
        [("ring", "block", B, WELD)], ["crank"],
    )  # fmt: skip
    law = LoadFriction(radial={"crank": bearing, "pin": pin, "wrist": wrist}, normal={"slide": mu})
    tau, rates = effort(robot, law, {"block": np.array([-push, 0, 0, 0, 0, 0])})
    swing = r * np.cos(angle) * SPEED / (rod * np.cos(tilt))
    s1, s2, s3, s4 = np.sign(
        [SPEED, swing + SPEED, swing, -r * np.sin(angle) - rod * np.sin(tilt) * swing / SPEED]
    )
    assert np.abs(rates).min() > 1.0
    line = tilt - np.arcsin((pin * s2 + wrist * s3) / rod)  # the force's direction, downwards
    S = push / (np.cos(line) - mu * abs(np.sin(line)) * s4)
    expected = -r * S * np.sin(angle + line) + S * (pin * s2 + bearing * s1)
    assert abs(tau - expected) <= ROUNDED * push


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_four_bar_with_friction_circles(sign: float) -> None:
    """The coupler's force is the tangent of the circles at its pins that both rates ask for."""
    A, B, D, torque = np.array([0.1, 0.3]), np.array([0.7, 0.5]), np.array([0.8, 0.0]), 12.0
    radii = {"crank": 0.012, "first": 0.007, "second": 0.005, "rocker": 0.009}
    robot = linkage(
        [("crank", "revolute", "ground", "arm", (0, 0), Z),
         ("first", "revolute", "arm", "coupler", tuple(A), Z),
         ("second", "revolute", "coupler", "ring", tuple(B), Z),
         ("rocker", "revolute", "ground", "output", tuple(D), Z)],
        [("ring", "output", tuple(B), WELD)], ["crank"],
    )  # fmt: skip
    load = {"output": np.array([0, 0, 0, 0, 0, torque])}
    tau, v = effort(robot, LoadFriction(radial=radii), load, sign * SPEED)
    s = {name: np.sign(v[robot.v_slices[robot.joint_index[name]]][0]) for name in radii}
    length, direction = np.linalg.norm(B - A), np.arctan2(*(B - A)[::-1])
    solutions = []
    for pushes in (1.0, -1.0):  # of the coupler on the rocker, along the coupler or against it
        off = np.arcsin(pushes * (radii["second"] * s["second"] - radii["first"] * s["first"]) / length)
        F = pushes * np.array([np.cos(direction + off), np.sin(direction + off)])
        lever = (B - D)[0] * F[1] - (B - D)[1] * F[0]
        S = -torque / (lever - radii["second"] * s["second"] - radii["rocker"] * s["rocker"])
        if S > 0:
            about = A[0] * F[1] - A[1] * F[0]
            solutions.append(S * (about - radii["first"] * s["first"] + radii["crank"] * s["crank"]))
    (expected,) = solutions
    assert abs(tau - expected) <= ROUNDED * abs(torque)


def test_bearings_of_parallel_shafts_each_carry_the_pull_of_a_belt() -> None:
    """Arms in a line under a pull along it: every bearing has the whole radial load, none a lever."""
    names = [f"shaft{i}" for i in range(5)]
    links = ["ground", *(f"arm{i}" for i in range(5))]
    parts = [(n, "revolute", links[i], links[i + 1], (0.2 * i, 0.0), Z) for i, n in enumerate(names)]
    robot = linkage(parts, [], names)
    radii = {name: 1e-3 * (i + 1) for i, name in enumerate(names)}
    q, v, a = hybridyn.assemble(robot, motors=dict.fromkeys(names, (0.0, SPEED, 0.0)))
    pull = {"arm4": np.array([70.0, 0, 0, 0, 0, 0])}
    tau = hybridyn.idm(robot, q, v, a, wrenches=pull, effects=[LoadFriction(radial=radii)])
    assert np.abs(tau - 70.0 * np.array([*radii.values()])).max() <= ROUNDED * 70.0


def lever(ratio: float) -> Jam:
    """A lever of 0.2 m, pushed at its end: its friction circle reaches for the line of the push."""
    robot = linkage(
        [("lever", "revolute", "ground", "bar", (0, 0), Z),
         ("push", "prismatic", "ground", "rod", (0, 0.2), X)],
        [("rod", "bar", (0, 0.2), ((0,), "free"))], ["push"],
    )  # fmt: skip
    load = {"bar": np.array([0, 0, 0, 0, 0, 3.0])}
    return robot, LoadFriction(radial={"lever": 0.2 * ratio}), load, "lever", 3.0 / 0.2


def drawer(ratio: float) -> Jam:
    """A drawer that is pushed 0.4 m beside its middle tilts in its guide."""
    robot = linkage(
        [("guide", "prismatic", "ground", "drawer", (0, 0), X),
         ("push", "prismatic", "ground", "hand", (0, 0.4), X)],
        [("hand", "drawer", (0, 0.4), ((0,), "free"))], ["push"],
    )  # fmt: skip
    load = {"drawer": np.array([-5.0, 0, 0, 0, 0, 0])}
    return robot, LoadFriction(tilt={"guide": ratio / 0.4}), load, "guide", 5.0


def screw(ratio: float) -> Jam:
    """A spindle that is pushed along its axis has to turn a load."""
    robot = linkage(
        [("thread", "screw", "ground", "spindle", (0, 0), X),
         ("push", "prismatic", "ground", "hand", (0, 0), X)],
        [("hand", "spindle", (0, 0), ((0,), "free"))], ["push"], pitch=0.01,
    )  # fmt: skip
    load = {"spindle": np.array([0, 0, 0, -0.5, 0, 0])}
    return robot, LoadFriction(axial={"thread": 0.01 * ratio}), load, "thread", 50.0


def ladder(ratio: float) -> Jam:
    """A ladder's foot is pushed to the wall and lifts a load in a guide on it."""
    robot = linkage(
        [("foot", "prismatic", "ground", "shoe", (-0.6, 0), X),
         ("hinge", "revolute", "shoe", "ladder", (-0.6, 0), Z),
         ("wall", "prismatic", "ground", "block", (0, 0.8), Y)],
        [("ladder", "block", (0, 0.8), PIN)], ["foot"],
    )  # fmt: skip
    load = {"block": np.array([0, -9.0, 0, 0, 0, 0])}
    return robot, LoadFriction(normal={"wall": ratio * 0.8 / 0.6}), load, "wall", 9.0 * 0.6 / 0.8


def toggle(ratio: float) -> Jam:
    """A slider drives a crank whose bearing and pin have friction circles: dead before the dead centre."""
    parts = [
        ("crank", "revolute", "ground", "arm", (0.0, 0.0), Z),
        ("pin", "revolute", "arm", "rod", (0.0, 0.3), Z),
        ("push", "prismatic", "ground", "block", (-0.8, 0.3), X),
    ]  # fmt: skip
    robot = linkage(parts, [("rod", "block", (-0.8, 0.3), PIN)], ["push"])
    load = {"arm": np.array([0, 0, 0, 0, 0, 6.0])}
    return robot, LoadFriction(radial={"crank": 0.3 * ratio}), load, "crank", 6.0 / 0.3


JAMS: list[Callable[[float], Jam]] = [lever, drawer, screw, ladder, toggle]


@pytest.mark.parametrize("mechanism", JAMS)
def test_what_jams_is_refused_with_its_ratio_and_what_nearly_does_is_solved(
    mechanism: Callable[[float], Jam],
) -> None:
    """The push is that without friction, divided by 1 - ratio."""
    for ratio in (0.5, 0.999):
        robot, law, load, _, free = mechanism(ratio)
        tau, _ = effort(robot, law, load)
        assert abs(tau) == pytest.approx(free / (1 - ratio), rel=ROUNDED / (1 - ratio))
    for ratio in (1.001, 3.0):
        robot, law, load, joint, _ = mechanism(ratio)
        with pytest.raises(ActuationError, match=f"joint '{joint}' may jam at sample 0") as error:
            effort(robot, law, load)
        assert error.value.size == pytest.approx(ratio, rel=ROUNDED)
