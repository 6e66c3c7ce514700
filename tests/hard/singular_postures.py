"""Where the shipped parallel robots are singular, and postures at any distance from there.

Every function gives the robot's record and its joints at distance d; d = 0 is the singularity itself, to
the rounding of the robot's own numbers. What the distance is stands in each docstring.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from hybridyn.description import Description
from tests.hard.closed_forms import (
    Delta,
    FiveBar,
    Values,
    about,
    balls,
    changed,
    gough_stewart,
    heading,
    meet,
    numbers,
    pitch,
    placement,
    rps3,
    towards,
    vector,
)
from tests.hard.extended_judge import mp
from tests.hard.four_bars import flat_four_bar, folded_parallelogram
from tests.oracle.arithmetic import cross
from tests.robots.shipped import shipped

Place = tuple[Description, Values]


def posture(place: str, d: float) -> tuple[Description, np.ndarray]:
    """Return a robot's record and its q at distance d from one of `PLACES`."""
    description, values = PLACES[place](d)
    return description, vector(description, values)


def _tilted() -> Any:
    return about(2, mp.mpf("0.3")) @ about(0, mp.mpf("0.2")) @ about(1, mp.mpf("-0.25"))


# ------------------------------------------------------------------ Gough-Stewart


def hexagons_at_ninety_degrees(d: Any) -> Place:
    """Parallel: hexagons of half-angles 10 and 50 degrees, 90 degrees - d of yaw (Fichter, 1986)."""
    robot = changed("gough_stewart", base_half_angle="10", platform_half_angle="50")
    p = numbers([0.03, -0.02, 0.7])
    return robot, gough_stewart(robot, about(2, mp.pi / 2 - d), p)


def universal_joint_in_gimbal_lock(d: Any) -> Place:
    """Leg: leg 2 makes the angle d with the first axis of its universal joint; it then spins on the spot."""
    robot = shipped("gough_stewart")
    return robot, _under_leg(robot, 2, mp.mpf("0.6"), mp.mpf("0.7"), mp.mpf(d) - mp.pi / 2)


def leg_of_no_length(d: Any) -> Place:
    """Serial: leg 2 has the length d [m]; its joints no longer follow from the platform."""
    robot = shipped("gough_stewart")
    return robot, _under_leg(robot, 2, mp.mpf(d), mp.mpf("0.3"), mp.mpf("0.4"))


def _under_leg(robot: Description, i: int, L: Any, y: Any, x: Any) -> Values:
    """Put the platform, tilted, on leg i of length L with its cross at (y, x)."""
    R = _tilted()
    Rh, ph = placement(robot, f"m1_leg{i}_cross_y")
    tip = ph + Rh @ about(1, y) @ about(0, x) @ numbers([0, 0, 1]) * L
    ball = balls(robot, "m1_leg1_wrist")[f"m1_leg{i}_rod"]
    return gough_stewart(robot, R, tip - R @ ball, {i: (y, x)})


def two_singular_modules(d: Any) -> Place:
    """Leg and parallel: gimbal lock in the first of two stacked modules, 90 degrees of yaw in the second."""
    robot = shipped("lx4", modules="2")
    first = _under_leg(robot, 2, mp.mpf("0.45"), mp.mpf("0.7"), mp.mpf(d) - mp.pi / 2)
    p = numbers([0.02, -0.01, 0.5])
    return robot, first | gough_stewart(robot, about(2, mp.pi / 2 - mp.mpf(d)), p, module="m2")


# ------------------------------------------------------------------ 3-RPS


def _rps3_place(R: Any, z: Any, r: Any) -> Any:
    """Return where the platform's centre must be: every ball in its leg's plane."""
    return np.array([r / 2 * (R[0, 0] - R[1, 1]), -r * R[1, 0], z])


def _rps3_radius(robot: Description) -> Any:
    return -placement(robot, "m1_leg1_wrist_mount")[1][0]


def _turned(n: Any, c: Any, s: Any) -> Any:
    """Return the rotation about an axis by the angle of that cosine and sine."""
    e = numbers(np.eye(3))
    return c * e + (1 - c) * np.outer(n, n) + s * np.array([cross(n, column) for column in e]).T


def platform_upside_down(d: Any) -> Place:
    """Constraint: turned by pi - 2 d about a horizontal axis; the constraint forces are dependent at pi.

    There the two operation modes of the 3-RPS meet (Schadlbauer, Walter and Husty, 2014: x0 = x3 = 0); they
    are w = 0 and z = 0 of the platform's quaternion, and d is w.
    """
    robot = shipped("rps3")
    w, way = mp.mpf(d), mp.mpf("0.4")
    s = mp.sqrt(1 - w * w)
    R = _turned(np.array([mp.cos(way), mp.sin(way), mp.mpf(0)]), 2 * w * w - 1, 2 * w * s)
    p = _rps3_place(R, mp.mpf("0.55"), _rps3_radius(robot))
    return robot, rps3(robot, R, p)


def leg_in_the_platform(d: Any) -> Place:
    """Parallel: pitched by 45 degrees, leg 1 makes about the angle d with the platform's plane."""
    robot = shipped("rps3")
    r, base = _rps3_radius(robot), placement(robot, "m1_leg1_hinge")[1][0]
    beta = mp.pi / 4
    R = about(1, beta)
    z = (base + r / 2) * mp.tan(beta) - r / 2 * mp.sin(beta) + mp.mpf(d)
    return robot, rps3(robot, R, _rps3_place(R, z, r))


def slide_of_no_length(d: Any) -> Place:
    """Serial: the ball of leg 1 is d [m] from its hinge, so that the hinge is free to turn."""
    robot = shipped("rps3")
    r, turn, way = _rps3_radius(robot), mp.mpf("0.5"), mp.mpf("0.23")
    Rh, ph = placement(robot, "m1_leg1_hinge")
    ball = ph + Rh @ about(1, turn) @ numbers([0, 0, 1]) * mp.mpf(d)
    n = np.array([mp.cos(way), mp.sin(way), mp.mpf(0)])
    m = 3 * n[0] ** 2 - n[1] ** 2
    c = (2 * ball[0] / r - m) / (
        2 - m
    )  # so that r / 2 (3 R11 - R22), where the ball is, is where it shall be
    R = _turned(n, c, mp.sqrt(1 - c * c))
    return robot, rps3(robot, R, _rps3_place(R, ball[2] - r * R[2, 0], r), {1: turn})


# ------------------------------------------------------------------ Delta


def arm_in_line_with_its_rods(d: Any) -> Place:
    """Serial: arm 1 makes the angle d with the plane that its axis and its rods lie in."""
    robot = shipped("delta")
    delta, turn, aside = Delta(robot), mp.mpf("1.4"), mp.mpf("-0.155")
    (x, y, z), d = (delta.frames[0][0] @ about(1, turn)).T, mp.mpf(d)
    rod = -mp.cos(aside) * (mp.cos(d) * x + mp.sin(d) * z) + mp.sin(aside) * y
    P = delta.elbow(0, turn) + delta.rod * rod
    turns = [turn, delta.turn(1, P, 1), delta.turn(2, P, 1)]
    return robot, delta.values(P, turns)


def rods_in_one_plane(d: Any) -> Place:
    """Parallel: the three rods span the volume d; in one plane they cannot hold the platform across it."""
    ends = numbers([[-0.261, 0.046, -0.506], [-0.331, 0.341, -0.591]])
    return _on_the_way(ends, (1, -1, -1), d, lambda delta, P, turns: delta.rods(P, turns))


def couples_in_one_plane(d: Any) -> Place:
    """Constraint: the couples by which the parallelograms keep the platform level span the volume d."""
    ends = numbers([[0.38, 0.24, -0.278], [0.456, 0.316, -0.348]])

    def couples(delta: Delta, P: Any, turns: Any) -> list[Any]:
        return [cross(y, rod) for y, rod in zip(delta.tangents, delta.rods(P, turns), strict=True)]

    return _on_the_way(ends, (1, -1, 1), d, couples)


def _on_the_way(ends: Any, sides: Any, d: Any, three: Callable[[Delta, Any, Any], list[Any]]) -> Place:
    """Put P between two points, where three vectors span the volume d."""
    robot = shipped("delta")
    delta = Delta(robot)

    def posture(t: Any) -> tuple[Any, list[Any]]:
        P = ends[0] + t * (ends[1] - ends[0])
        return P, [delta.turn(i, P, side) for i, side in enumerate(sides)]

    def volume(t: Any) -> Any:
        a, b, c = three(delta, *posture(t))
        return cross(a, b) @ c

    sign = 1 if volume(0) > 0 else -1
    t = mp.findroot(lambda t: volume(t) - sign * mp.mpf(d), (0, 1), solver="anderson", tol=mp.mpf(10) ** -60)
    return robot, delta.values(*posture(t))


def rods_in_one_line(d: Any) -> Place:
    """Leg and constraint: the rods of arm 1 make the angle d with the motor's axis, at 0 in one line."""
    robot = shipped("delta")
    delta, turn, d = Delta(robot), mp.mpf("0.42"), mp.mpf(d)
    (x, y, z), way = (delta.frames[0][0] @ about(1, turn)).T, mp.mpf("0.6")
    P = delta.elbow(0, turn) + delta.rod * (mp.cos(d) * y + mp.sin(d) * (mp.cos(way) * x - mp.sin(way) * z))
    turns = [turn, delta.turn(1, P, 1), delta.turn(2, P, 1)]
    home = pitch(placement(robot, "m1_arm1_rod_a_cross_y")[0])
    return robot, delta.values(P, turns, {0: way - home})


# ------------------------------------------------------------------ five-bar


def arm_stretched(d: Any) -> Place:
    """Serial, and leg: the links of the left side make the angle d."""
    robot = shipped("five_bar")
    bars, way = FiveBar(robot), mp.mpf("-1.2")
    E = bars.motors[0] + bars.upper[0] * towards(way)
    T = E + bars.lower[0] * towards(way + mp.mpf(d))
    F = meet(bars.motors[1], bars.upper[1], T, bars.lower[1], 1)
    return robot, bars.values((E, F), (T, T))


def elbows_together(d: Any) -> Place:
    """Parallel: the lower links make the angle d; folded on each other they turn about the elbows as one."""
    robot = shipped("five_bar")
    bars, way, half = FiveBar(robot), mp.mpf("-1.3"), mp.mpf(d) / 2
    apart = 2 * bars.lower[0] * mp.sin(half) * towards(way + mp.pi / 2)
    E = meet(bars.motors[0], bars.upper[0], bars.motors[1] - apart, bars.upper[1], -1)
    return robot, (
        bars.angles(bars.sides[0], heading(bars.motors[0], E), way + half)
        | bars.angles(bars.sides[1], heading(bars.motors[1], E + apart), way - half)
    )


def lower_links_in_line(d: Any) -> Place:
    """Parallel: motors 0.4 m apart, the lower links make the angle pi - d; in line they hold no tip."""
    robot = changed("five_bar", spacing="0.4")
    bars, way, half = FiveBar(robot), mp.mpf("0.1"), mp.mpf(d) / 2
    apart = 2 * bars.lower[0] * mp.cos(half) * towards(way)
    E = meet(bars.motors[0], bars.upper[0], bars.motors[1] - apart, bars.upper[1], -1)
    return robot, (
        bars.angles(bars.sides[0], heading(bars.motors[0], E), way - half)
        | bars.angles(bars.sides[1], heading(bars.motors[1], E + apart), way + mp.pi + half)
    )


def all_links_in_line(d: Any) -> Place:
    """Constraint: motors 0.8 m apart, left side stretched, right one folded, about the angle d off.

    Positive and negative d are one smooth motion.
    """
    robot = changed("five_bar", spacing="0.8", lean="-10")
    bars, d = FiveBar(robot), mp.mpf(d)
    E = bars.motors[0] + bars.upper[0] * towards(-d)
    T = E + bars.lower[0] * towards(-d / 2)
    F = meet(bars.motors[1], bars.upper[1], T, bars.lower[1], 1 if d >= 0 else -1)
    return robot, bars.values((E, F), (T, T))


#: By robot and kind.
PLACES: dict[str, Callable[[Any], Place]] = {
    "gough_stewart parallel": hexagons_at_ninety_degrees,
    "gough_stewart leg": universal_joint_in_gimbal_lock,
    "gough_stewart serial": leg_of_no_length,
    "lx4 leg and parallel": two_singular_modules,
    "rps3 parallel": leg_in_the_platform,
    "rps3 serial": slide_of_no_length,
    "rps3 constraint": platform_upside_down,
    "delta parallel": rods_in_one_plane,
    "delta serial": arm_in_line_with_its_rods,
    "delta constraint": couples_in_one_plane,
    "delta leg": rods_in_one_line,
    "five_bar parallel": lower_links_in_line,
    "five_bar parallel, folded": elbows_together,
    "five_bar serial": arm_stretched,
    "five_bar constraint": all_links_in_line,
    "four_bar constraint": flat_four_bar,
    "parallelogram constraint": folded_parallelogram,
}
