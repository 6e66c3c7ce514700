"""Directions of axes and distances from points are prescribed as coordinates are; Pinocchio judges them."""

from functools import partial
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import least_squares

import hybridyn
from hybridyn import AssemblyError, TrajectoryError
from hybridyn.linkage.motion import Motion
from hybridyn.linkage.pointing import DirectionTarget, DistanceTarget
from hybridyn.spatial import Array, rotation_from_vector
from tests.assembly.test_angles import arm
from tests.assembly.test_chains import (
    ALMOST,
    DIFFERENCED,
    DRIFTED,
    REACHED,
    STEP,
    ends,
    least,
    spans,
    stacked,
)
from tests.robots.posing import far_apart, of_link
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

KINDS = ("gough", "delta_bars", "stewart_arm", "stack", "scara_delta")
SLOPE, SLOPED = 1e-6, 1e-7  # of central differences, and their error
ACROSS, SPED = 5e-4, 1e-9  # steps in time of a point that speeds up [s], and of its acceleration: STEP^4
EXACTLY = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
Levels = tuple[Array, Array, Array]


def direction(pose: Array, twist: Array, change: Array, axis: int) -> Levels:
    """Return the direction of an axis, shape (T, 3), and its derivatives, from a link's motion."""
    a = np.array([pin.Quaternion(*p[[6, 3, 4, 5]]).matrix()[:, axis] for p in pose])
    w, w_dot = twist[:, 3:], change[:, 3:]
    a_dot = np.cross(w, a)
    return a, a_dot, np.cross(w_dot, a) + np.cross(w, a_dot)


def distance(pose: Array, twist: Array, change: Array, centre: Levels) -> Levels:
    """Return the distance from a point that moves, shape (T,), and its derivatives, by its square."""
    way, u, u_dot = (x[:, :3] - c for x, c in zip((pose, twist, change), centre, strict=True))
    d = np.linalg.norm(way, axis=1)
    d_dot = np.sum(way * u, axis=1) / d
    return d, d_dot, (np.sum(u * u + way * u_dot, axis=1) - d_dot**2) / d


def named(axis: str, pointed: Levels, far: Levels, centre: Levels, i: int) -> tuple[dict[str, float], ...]:
    """Return the words for the values, rates and accelerations at a sample."""
    out = []
    for a, d, c in zip(pointed, far, centre, strict=True):
        words = {f"{axis}{n}": float(x) for n, x in zip("xyz", a[i], strict=True)} | {"distance": float(d[i])}
        out.append(words | {f"c{n}": float(x) for n, x in zip("xyz", c[i], strict=True)})
    return tuple(out)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [*zip(KINDS, range(5), strict=True), *(slow(kind, seed) for kind in KINDS for seed in range(8, 14))],
)
def test_directions_and_distances_are_reached_by_the_least_motion(kind: str, seed: int) -> None:
    """Of any length, from a point that moves; rates and accelerations by Pinocchio."""
    robot, states = stacked(kind, seed)
    link, other = ends(robot, kind)
    seen, rng = of_link(robot, *states, link, other), np.random.default_rng(seed)
    axis, centre = seed % 3, tuple(rng.normal(size=(3, len(states[0]), 3)))
    pointed, far = direction(*seen, axis), distance(*seen, centre)
    for i in range(len(states[0])):
        length = rng.uniform(0.3, 3.0)
        longer = (length * pointed[0], length * pointed[1], length * pointed[2])
        words = named("xyz"[axis], longer, far, centre, i)
        q, v, a = hybridyn.assemble(robot, platforms={f"{link}@{other}": words}, guess=states[0][i])
        assert far_apart(robot, q[None], states[0][i : i + 1]) < REACHED
        found = of_link(robot, q[None], v[None], a[None], link, other)
        at = tuple(c[i : i + 1] for c in centre)
        met = (*direction(*found, axis), *distance(*found, at))
        for one, wanted in zip(met, (*pointed, *far), strict=True):
            close_to(one, wanted[i : i + 1], REACHED, 1.0)
        way = seen[0][i, :3] - centre[0][i]
        rows = np.zeros((4, 6))
        rows[:3, 3:] = np.cross(np.eye(3), pointed[0][i]).T  # w x a
        rows[3, :3] = way / np.linalg.norm(way)
        twist = np.linalg.lstsq(rows, np.append(pointed[1][i], far[1][i] + rows[3, :3] @ centre[1][i]))[0]
        motors = least(robot, q, link, other, twist, rows=rows)
        close_to(v[robot.motor_v] / spans(robot), motors, ALMOST, 1e-6)


@pytest.mark.parametrize("what", ["direction", "distance"])
def test_accelerations_are_those_of_the_rule_where_targets_move(what: str, tmp_path: Path) -> None:
    """A direction that turns, and a distance from a point that moves, by differences of the rates."""
    robot, q0 = arm(tmp_path, "zyxyzyx"), np.array([0.3, 0.8, -0.5, 0.9, 0.4, 0.7, -0.2])
    data, frame = robot.model.createData(), robot.model.getFrameId("l6")
    pin.framesForwardKinematics(robot.model, data, q0)
    R, p = data.oMf[frame].rotation, data.oMf[frame].translation
    t = STEP * np.arange(-3, 4)[:, None]
    near = tuple(p + x for x in (t * [0.3, -0.2, 0.1] + t * t, [0.3, -0.2, 0.1] + 2 * t, 0 * t + 2.0))
    near = near[0], near[1] - p, near[2] - p
    turn = 0.8 * t - t * t, 0.8 - 2 * t, 0 * t - 2.0
    along, across = np.cos(turn[0]), np.sin(turn[0])
    d = along * R[:, 2] + across * R[:, 0]
    e = along * R[:, 0] - across * R[:, 2]
    pointed = d, turn[1] * e, turn[2] * e - turn[1] ** 2 * d
    centre = tuple(x + y for x, y in zip(near, (np.array([0.1, 0.3, -0.4]), 0.0, 0.0), strict=True))
    far = np.linalg.norm(p - centre[0][3]) + 0.2 * t[:, 0], 0 * t[:, 0] + 0.2, 0 * t[:, 0]
    rows: list[dict[str, Array]] = []
    for x, to, d_level, c in zip(near, pointed, far, centre, strict=True):
        words = {"distance": d_level} | dict(zip(("cx", "cy", "cz"), c.T, strict=True))
        if what == "direction":
            words = dict(zip(("x", "y", "z", "zx", "zy", "zz"), [*x.T, *to.T], strict=True))
        rows.append(words)
    q, v, a = hybridyn.assemble(robot, platforms={"l6": tuple(rows)}, guess=q0)
    close_to((q[4] - q[2]) / (2 * STEP), v[3], DRIFTED)
    close_to((v[4] - v[2]) / (2 * STEP), a[3], DIFFERENCED)


def test_a_point_that_begins_to_move_says_how_far_rates_look_ahead(tmp_path: Path) -> None:
    """It speeds up across the distance, which hardly moves the arm: by differences of the rates."""
    robot, start, centre = arm(tmp_path, "yyy"), np.array([0.3, 0.5, 0.2]), np.array([5.0, 0.0, 5.0])
    way = of_link(robot, start[None], *np.zeros((2, 1, 3)), "l2", "base")[0][0, :3] - centre
    across, t = np.array([-way[2], 0.0, way[0]]), ACROSS * np.arange(-2, 3)
    points = centre + np.outer(t**2 / 2, across), np.outer(t, across), np.outer(np.ones(5), across)
    lengths = np.linalg.norm(way) + 0.05 * t, np.full(5, 0.05), np.zeros(5)
    rows = [{"distance": d, "cx": c[:, 0], "cy": c[:, 1], "cz": c[:, 2]}
            for d, c in zip(lengths, points, strict=True)]  # fmt: skip
    _, v, a = hybridyn.assemble(robot, platforms={"l2": tuple(rows)}, guess=start)
    slope = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) @ v / (12 * ACROSS)
    close_to(slope, a[2], SPED, float(np.linalg.norm(across)))


def test_an_arm_points_where_least_squares_point(tmp_path: Path) -> None:
    """Five numbers for five joints: a point and a direction, up to a turn away, by SciPy and Pinocchio."""
    robot = arm(tmp_path, "zyyzy")
    data, frame = robot.model.createData(), robot.model.getFrameId("l4")
    rng = np.random.default_rng(0)

    def reached(q: Array) -> Array:
        pin.framesForwardKinematics(robot.model, data, q)
        return np.concatenate([data.oMf[frame].translation, data.oMf[frame].rotation[:, 0]])

    for _ in range(3):
        start = np.array([0.0, 0.4, 0.9, 0.3, 0.5]) + rng.uniform(-0.2, 0.2, 5)
        wanted = reached(start + rng.uniform(-0.5, 0.5, 5))
        words = dict(zip(("x", "y", "z", "xx", "xy", "xz"), wanted.tolist(), strict=True))
        q = hybridyn.assemble(robot, platforms={"l4": (words,)}, guess=start)[0]
        judge = least_squares(lambda x, to=wanted: reached(x) - to, q + 0.01, **EXACTLY)
        close_to(q, judge.x, 1e-9)
        close_to(reached(q), wanted, REACHED)


@pytest.mark.parametrize("axes", ["zyz", slow("zyx"), slow("xyz")])
def test_the_opposite_direction_is_no_solution(tmp_path: Path, axes: str) -> None:
    """Any direction is reached from any other, also from its opposite."""
    robot, rng = arm(tmp_path, axes), np.random.default_rng(0)
    still = np.zeros((1, 3))
    for wanted in (np.array([0.0, 0.0, -1.0]), rng.normal(size=3)):
        words = dict(zip(("zx", "zy", "zz"), wanted.tolist(), strict=True))
        q = hybridyn.assemble(robot, platforms={"l2": (words,)})[0]
        pointed = direction(*of_link(robot, q[None], still, still, "l2", "root"), 2)[0][0]
        close_to(pointed, wanted / np.linalg.norm(wanted), REACHED)


def test_rows_are_the_derivatives_of_residuals_wherever_the_body_is() -> None:
    """Not only where the target is met: Newton's steps are whole up to nearly half a turn."""

    class Body:
        def jacobian(self, motion: Motion, body: int) -> Array:
            return np.eye(6)[None]

    rng = np.random.default_rng(0)
    for turn in (1e-9, 1e-5, 0.1, 1.0, 2.0, 3.1):
        for axis in range(3):
            R, shift, frame = (rotation_from_vector(x) for x in rng.normal(size=(3, 3)))
            across = np.cross(rng.normal(size=3), R @ shift[:, axis])
            goal = rotation_from_vector(turn * across / np.linalg.norm(across)) @ R @ shift[:, axis]
            still = np.zeros((1, 3))
            aim = DirectionTarget(1, axis, frame, shift, (frame.T @ goal)[None], still, still, np.ones(2))
            p, *points = rng.normal(size=(3, 3))
            away = DistanceTarget(1, frame, *points, np.ones((3, 1)), rng.normal(size=(3, 1, 3)), np.ones(1))

            def moved(step: Array, R: Array = R, p: Array = p) -> Motion:
                there = np.array([np.eye(3), rotation_from_vector(step[3:]) @ R])[None]
                zero = np.zeros((1, 2, 3))
                return Motion(there, np.array([np.zeros(3), p + step[:3]])[None], zero, zero, zero, zero)

            for target in (aim, away):
                sample = np.zeros(1, dtype=int)
                rows = target.matrix(Body(), moved(np.zeros(6)), sample)[0]
                steps = SLOPE * np.eye(6)
                slopes = [
                    (target.residual(moved(s), sample) - target.residual(moved(-s), sample))[0] / (2 * SLOPE)
                    for s in steps
                ]
                close_to(rows, np.array(slopes).T, SLOPED * (1 + 10 * (turn > 3)), 1.0)


# -------------------------------------------------------------------- wrong


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ({"zx": 0.0, "zz": 1.0}, "the direction of 'l0' lacks zy: it takes zx, zy, zz"),
        ({"zx": 0.0, "zy": 0.0, "zz": 0.0}, r"direction of length 0 \(at least 1e-06\): give a longer"),
        ({"zx": 0.0, "zy": 0.0, "zz": np.nan}, "needs finite numbers"),
        (dict.fromkeys(("zx", "zy", "zz", "xx", "xy", "xz"), 1.0), "twice, by xx, xy, xz and zx, zy, zz"),
        (dict.fromkeys(("zx", "zy", "zz", "rx", "ry", "rz"), 1.0), "twice, by rx, ry, rz and zx, zy, zz"),
        ({"cx": 0.0, "distance": 1.0}, "the distance of 'l0' lacks cy, cz: it takes distance, cx, cy, cz"),
        ({"cx": 0.0, "cy": 0.0, "cz": 0.0}, "the distance of 'l0' lacks distance"),
        ({"distance": 0.0}, "distance 0 m: it must be positive; to reach a point give x, y, z"),
        ({"axis": 0.0}, "unknown coordinate 'axis' of 'l0'; known: x, y, z, roll, .*, rx, ry, rz"),
        ({"distanc": 0.0}, "unknown coordinate 'distanc' .did you mean 'distance'"),
    ],
)  # fmt: skip
def test_what_is_no_direction_and_no_distance_is_refused(
    tmp_path: Path, pose: dict[str, float], words: str
) -> None:
    robot = arm(tmp_path, "y")
    refused(partial(hybridyn.assemble, robot, platforms={"l0": (pose,)}), TrajectoryError, words)


def test_what_no_motion_points_or_draws_near_is_refused(tmp_path: Path) -> None:
    robot = arm(tmp_path, "zz")
    along = partial(hybridyn.assemble, robot, platforms={"l1": ({"zx": 0.0, "zy": 1.0, "zz": 0.0},)})
    refused(along, AssemblyError, "changes it .the direction of the z axis of 'l1'")
    far = partial(hybridyn.assemble, robot, platforms={"l1": ({"distance": 2.0},)})
    refused(far, AssemblyError, "changes it .the distance of 'l1'")
