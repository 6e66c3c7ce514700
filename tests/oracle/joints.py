"""One joint: its numbers of coordinates, the placement of its child, and a step on its manifold."""

from typing import Any

import numpy as np

from hybridyn.description.records import Joint, JointKind

from .arithmetic import Arithmetic, Numbers, cross

#: Numbers of coordinates of each kind of joint: positions, velocities.
FREEDOMS: dict[JointKind, tuple[int, int]] = {
    "fixed": (0, 0),
    "revolute": (1, 1),
    "continuous": (2, 1),
    "prismatic": (1, 1),
    "screw": (1, 1),
    "spherical": (4, 3),
    "planar": (4, 3),
    "floating": (7, 6),
}
#: Number of velocity coordinates in m/s, which come first.
SLIDES: dict[JointKind, int] = {"prismatic": 1, "planar": 2, "floating": 3}


def quaternion_matrix(xyzw: Numbers) -> Numbers:
    """Build the rotation of a quaternion (x, y, z, w) of any norm."""
    u, w = xyzw[:3], xyzw[3]
    skew = np.array([cross(u, e) for e in np.eye(3)]).T
    R: Numbers = ((w * w - u @ u) * np.eye(3) + 2 * np.outer(u, u) + 2 * w * skew) / (xyzw @ xyzw)
    return R


def rotation_about_z(c: Any, s: Any) -> Numbers:
    """Build the rotation about z with the given cosine and sine."""
    return np.array([[c, -s, 0 * c], [s, c, 0 * c], [0 * c, 0 * c, 1 + 0 * c]])


def triad(arithmetic: Arithmetic, joint: Joint) -> Numbers:
    """Compute axes (columns) in the child frame, the third of which is the axis of a joint with one."""
    if joint.kind not in ("revolute", "continuous", "prismatic", "screw"):
        return arithmetic.array(np.eye(3))
    z = arithmetic.array(joint.axis)
    z = z / arithmetic.sqrt(z @ z)
    x = cross(np.eye(3)[int(np.argmin(np.abs(joint.axis)))], z)
    x = x / arithmetic.sqrt(x @ x)
    return np.array([x, cross(z, x), z]).T


def displacement(arithmetic: Arithmetic, joint: Joint, q: Numbers) -> tuple[Numbers, Numbers]:
    """Compute rotation and position of B in A from a joint's coordinates."""
    R, t, kind = arithmetic.array(np.eye(3)), arithmetic.array(np.zeros(3)), joint.kind
    if kind in ("revolute", "screw"):
        R = rotation_about_z(arithmetic.cos(q[0]), arithmetic.sin(q[0]))
    elif kind in ("continuous", "planar"):
        R = rotation_about_z(*(q[-2:] / arithmetic.sqrt(q[-2:] @ q[-2:])))
    elif kind in ("spherical", "floating"):
        R = quaternion_matrix(q[-4:])
    if kind in ("prismatic", "screw"):
        t[2] = q[0] * (joint.pitch if kind == "screw" else 1)
    elif kind == "planar":
        t[:2] = q[:2]
    elif kind == "floating":
        t = q[:3]
    return R, t


def moved(arithmetic: Arithmetic, kind: JointKind, x: Numbers, d: Numbers) -> Numbers:
    """Integrate a step d of velocity x time from positions x, to first order and on the joint's manifold."""
    out: Numbers = x.copy()
    if kind in ("revolute", "prismatic", "screw"):
        out[:] = x + d
    if kind == "planar":
        out[:2] = x[:2] + rotation_about_z(x[2], x[3])[:2, :2] @ d[:2]
    if kind == "floating":
        out[:3] = x[:3] + quaternion_matrix(x[3:]) @ d[:3]
    if kind in ("continuous", "planar"):
        c, s = arithmetic.cos(d[-1]), arithmetic.sin(d[-1])
        out[-2:] = np.array([c * x[-2] - s * x[-1], s * x[-2] + c * x[-1]])
    if kind in ("spherical", "floating"):
        u, w, half = x[-4:-1], x[-1], d[-3:] / 2
        out[-4:] = np.concatenate([u + w * half + cross(u, half), [w - u @ half]])
        out[-4:] = out[-4:] / arithmetic.sqrt(out[-4:] @ out[-4:])
    return out


def between(arithmetic: Arithmetic, kind: JointKind, x: Numbers, y: Numbers) -> Numbers:
    """Compute the constant velocity, in B, that moves positions x to y, close by, in a unit of time."""
    if kind in ("revolute", "prismatic", "screw"):
        return y - x
    if kind in ("continuous", "planar"):
        (c, s), (k, z) = x[-2:], y[-2:]
        turn = np.array([0 * c, 0 * c, arithmetic.atan2(c * z - s * k, c * k + s * z)])
        R = rotation_about_z(c, s)
    else:
        (u, w), (r, o) = (x[-4:-1], x[-1]), (y[-4:-1], y[-1])
        half = w * r - o * u - cross(u, r)
        size = arithmetic.sqrt(half @ half)
        turn = half * (2 * arithmetic.atan2(size, w * o + u @ r) / size if size else 2)
        R = quaternion_matrix(x[-4:])
    if kind not in ("planar", "floating"):
        return turn[2:] if kind == "continuous" else turn
    shift = R.T @ np.concatenate([(y - x)[: SLIDES[kind]], turn[: 3 - SLIDES[kind]] * 0])
    square = turn @ turn  # the inverse of the series of what turns on the way
    bent = cross(turn, cross(turn, shift)) * (1 / 12 + square / 720 + square * square / 30240)
    shift = shift - cross(turn, shift) / 2 + bent
    return np.concatenate([shift[: SLIDES[kind]], turn[2:] if kind == "planar" else turn])
