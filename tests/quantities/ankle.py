"""A parallel ankle: two motors on the shank move a foot about pitch and roll through cranks and rods."""

from pathlib import Path

import numpy as np
from pinocchio.rpy import rpyToMatrix

import hybridyn
from hybridyn.structure.robot import HybridRobot
from tests.support.files import save

JOINTS, MOTORS = ("pitch", "roll"), ("motor_left", "motor_right")
#: Of the left side, in the shank at home [m]: motor axis (along y), end of the crank, end of the rod.
AXIS, TIP, END = (np.array(p) for p in ([0.0, 0.05, 0.2], [-0.045, 0.055, 0.19], [-0.05, 0.04, -0.01]))
MIRROR = np.array([1.0, -1.0, 1.0])

INERTIAL = (
    '<inertial><origin xyz="{at}"/><mass value="{mass}"/>'
    '<inertia ixx="1e-4" iyy="2e-4" izz="1.5e-4" ixy="1e-5" ixz="0" iyz="0"/></inertial>'
)


def _link(name: str, mass: float = 0.0, at: np.ndarray | None = None) -> str:
    inside = INERTIAL.format(at=_text(np.zeros(3) if at is None else at), mass=mass) if mass else ""
    return f'<link name="{name}">{inside}</link>'


def _joint(name: str, parent: str, child: str, at: np.ndarray, axis: str) -> str:
    return (
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{_text(at)}"/><axis xyz="{axis}"/>'
        '<limit lower="-0.5" upper="0.4" effort="80" velocity="10"/></joint>'
    )


def _text(x: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in x)


def ankle_text(mount: str = "") -> str:
    """Return the ankle's URDF; `mount` stands before it and may hold joints from `base` to `shank`."""
    none = np.zeros(3)
    parts = [
        mount, _link("shank", 2.0), _link("cross"), _link("foot", 1.0, np.array([0.05, 0.0, -0.03])),
        _joint("pitch", "shank", "cross", none, "0 1 0"), _joint("roll", "cross", "foot", none, "1 0 0"),
    ]  # fmt: skip
    for side, sign in (("left", np.ones(3)), ("right", MIRROR)):
        axis, tip, end = AXIS * sign, TIP * sign, END * sign
        parts += [
            _link(f"crank_{side}", 0.1, (tip - axis) / 2), _link(f"fork_{side}"),
            _link(f"rod_{side}", 0.05, (end - tip) / 2),
            _joint(f"motor_{side}", "shank", f"crank_{side}", axis, "0 1 0"),
            _joint(f"fork_{side}_x", f"crank_{side}", f"fork_{side}", tip - axis, "1 0 0"),
            _joint(f"fork_{side}_y", f"fork_{side}", f"rod_{side}", none, "0 1 0"),
            f'<loop name="ball_{side}" type="spherical">'
            f'<predecessor link="rod_{side}"><origin xyz="{_text(end - tip)}"/></predecessor>'
            f'<successor link="foot"><origin xyz="{_text(end)}"/></successor></loop>',
        ]  # fmt: skip
    return f'<robot name="ankle">{"".join(parts)}</robot>'


def ankle(folder: Path) -> HybridRobot:
    """Load the ankle from a file in a folder."""
    return hybridyn.load(save(folder, ankle_text(), "ankle.urdf"), motors=MOTORS)


def leg(folder: Path) -> HybridRobot:
    """Load a leg: the ankle below a hip and a knee, which have motors too, and a toe that has none."""
    mount = _link("base", 3.0) + _link("thigh", 2.0, np.array([0.0, 0.0, -0.2])) + _link("toe", 0.2)
    mount += _joint("hip", "base", "thigh", np.zeros(3), "0 1 0")
    mount += _joint("knee", "thigh", "shank", np.array([0.0, 0.0, -0.4]), "0 1 0")
    mount += _joint("toe_hinge", "foot", "toe", np.array([0.1, 0.0, -0.03]), "0 1 0")
    return hybridyn.load(save(folder, ankle_text(mount), "leg.urdf"), motors=("hip", "knee", *MOTORS))


def closed_form(pitch: float, roll: float, motors: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much the rods' lengths miss (2,) [m^2], and d(motors)/d(pitch, roll), shape (2, 2).

    A rod keeps its length: r . (d(crank end) dm - d(foot's end) dy) = 0, with r from the one to the other.
    """
    miss, H, x = np.zeros(2), np.zeros((2, 2)), rpyToMatrix(0.0, pitch, 0.0)[:, 0]
    for i, sign in enumerate((np.ones(3), MIRROR)):
        axis, tip, end = AXIS * sign, TIP * sign, END * sign
        arm = rpyToMatrix(0.0, motors[i], 0.0) @ (tip - axis)
        foot = rpyToMatrix(roll, pitch, 0.0) @ end
        r = foot - axis - arm
        miss[i] = r @ r - (end - tip) @ (end - tip)
        along = r @ np.cross([0.0, 1.0, 0.0], arm)
        H[i] = r @ np.cross([0.0, 1.0, 0.0], foot) / along, r @ np.cross(x, foot) / along
    return miss, H
