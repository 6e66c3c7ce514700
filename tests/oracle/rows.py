"""Rows: scalar functions that define joints and closures, with their first two derivatives.

With frame A on one body, frame B on the other, `d = x_B - x_A`, and `n = omega x (omega x r)` of each frame's
origin (r its lever from the body's origin), there are two kinds:

    slide along e   e . d,       rate   e . (x_dot_B - x_dot_A - omega_A x d)
                                 drift  e . (n_B - n_A - omega_A x (x_dot_B - x_dot_A)) + e_dot . (bracket)
    turn u, w       u_A . w_B,   rate   (omega_B - omega_A) . c,  c = w x u
                                 drift  (omega_B - omega_A) . ((omega_B x w) x u + w x (omega_A x u))

All vectors are in world axes. The drift is the second derivative at zero acceleration of all bodies.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hybridyn.description.records import Joint, JointKind, RotationKind

from .arithmetic import Numbers, cross

ROWS: dict[JointKind, tuple[tuple[int, ...], RotationKind]] = {
    "fixed": ((0, 1, 2), "fixed"),
    "revolute": ((0, 1, 2), "parallel"),
    "continuous": ((0, 1, 2), "parallel"),
    "prismatic": ((0, 1), "fixed"),
    "screw": ((0, 1), "parallel"),
    "spherical": ((0, 1, 2), "free"),
    "planar": ((2,), "parallel"),
    "floating": ((), "free"),
}
ROTATION_PAIRS: dict[RotationKind, tuple[tuple[int, int], ...]] = {
    "free": (),
    "perpendicular": ((2, 2),),
    "parallel": ((0, 2), (1, 2)),
    "fixed": ((0, 1), (1, 2), (2, 0)),
}


class Frame(NamedTuple):
    """A frame on a body: origin x, axes E (columns), lever r from the body's origin, all in world axes."""

    x: Numbers
    E: Numbers
    r: Numbers
    body: int


@dataclass(frozen=True)
class Row:
    """One scalar function between two frames: its value and the terms of its first two derivatives.

    The rate is `at_a . V_A + at_b . V_B`. The second derivative is the same with V_dot, plus the drift.
    """

    value: Any
    at_a: Numbers
    at_b: Numbers
    drift: Callable[[Numbers, Numbers], Any]
    slides: bool


def slide(A: Frame, B: Frame, axis: int, on_b: bool = False) -> Row:
    """Build the row "slide along e", with e an axis of A, or of B."""
    e, d = (B if on_b else A).E[:, axis], B.x - A.x
    at_a = np.concatenate([-e, cross(e, d) - cross(A.r, e)])

    def drift(V_A: Numbers, V_B: Numbers) -> Any:
        """Compute the second derivative of the row's value at zero accelerations."""
        omega_A, omega_B = V_A[3:], V_B[3:]
        x_dot = V_B[:3] + cross(omega_B, B.r) - V_A[:3] - cross(omega_A, A.r)
        n = cross(omega_B, cross(omega_B, B.r)) - cross(omega_A, cross(omega_A, A.r))
        e_dot = cross(omega_B if on_b else omega_A, e)
        return e @ (n - cross(omega_A, x_dot)) + e_dot @ (x_dot - cross(omega_A, d))

    return Row(e @ d, at_a, np.concatenate([e, cross(B.r, e)]), drift, slides=True)


def turn(A: Frame, B: Frame, axis_a: int, axis_b: int) -> Row:
    """Build the row "turn u, w": an axis of A stays perpendicular to an axis of B."""
    u, w = A.E[:, axis_a], B.E[:, axis_b]
    c = np.concatenate([0 * u, cross(w, u)])

    def drift(V_A: Numbers, V_B: Numbers) -> Any:
        """Compute the second derivative of the row's value at zero accelerations."""
        c_dot = cross(cross(V_B[3:], w), u) + cross(w, cross(V_A[3:], u))
        return (V_B[3:] - V_A[3:]) @ c_dot

    return Row(u @ w, -c, c, drift, slides=False)


def turn_rate(A: Frame, B: Frame, axis: int) -> Row:
    """Build the rate of turn about an axis of B (not integrable: its value is meaningless)."""
    w = B.E[:, axis]
    c = np.concatenate([0 * w, w])
    return Row(0, -c, c, lambda V_A, V_B: (V_B[3:] - V_A[3:]) @ cross(V_B[3:], w), slides=False)


def constraint_rows(A: Frame, B: Frame, translations: Sequence[int], rotation: RotationKind) -> list[Row]:
    """Build the rows of a closure, as defined by `records.Closure`."""
    return [slide(A, B, axis) for axis in translations] + [
        turn(A, B, i, j) for i, j in ROTATION_PAIRS[rotation]
    ]


def joint_rows(A: Frame, B: Frame, joint: Joint) -> list[Row]:
    """Build the rows that a joint holds; that of a screw's thread ties slide and turn."""
    rows = constraint_rows(A, B, *ROWS[joint.kind])
    if joint.kind == "screw":
        way, angle, pitch = slide(A, B, 2), turn_rate(A, B, 2), joint.pitch

        def drift(V_A: Numbers, V_B: Numbers) -> Any:
            """Compute the second derivative of the row's value at zero accelerations."""
            return way.drift(V_A, V_B) - pitch * angle.drift(V_A, V_B)

        at_a, at_b = way.at_a - pitch * angle.at_a, way.at_b - pitch * angle.at_b
        rows.append(Row(0, at_a, at_b, drift, slides=True))
    return rows


def coordinate_rows(A: Frame, B: Frame, kind: JointKind) -> list[Row]:
    """Build the rows that define the velocity coordinates of a joint, in Pinocchio's order."""
    slides = {"prismatic": [2], "planar": [0, 1], "floating": [0, 1, 2]}.get(kind, [])
    turns = {"revolute": [2], "continuous": [2], "screw": [2], "planar": [2]}.get(
        kind, [0, 1, 2] if kind in ("spherical", "floating") else []
    )
    return [slide(A, B, axis, on_b=True) for axis in slides] + [turn_rate(A, B, axis) for axis in turns]
