"""An excavator as people write it: boom, stick, bucket, three cylinders, a bucket linkage; and closed forms.

Everything moves in the plane of x (forward) and z (up); a positive angle turns x down, as the pitch does.
"""

from pathlib import Path

import numpy as np

Point = np.ndarray

#: Angles of boom, stick and bucket at home, relative to the body before [rad].
HOME = np.array([-0.7, 1.7, 0.6])
BOOM, STICK, TEETH = np.array([5.0, 0.0]), np.array([2.5, 0.0]), np.array([1.2, -0.3])
#: Pins of the cylinders: on the body before, and on the body that they move.
PINS = ((np.array([0.8, -0.6]), np.array([2.2, -0.3])), (np.array([2.6, 0.6]), np.array([-0.7, 0.3])))
#: Pins of the bucket cylinder and of the rocker on the stick, that of the coupler on the bucket.
BARREL, ROCKER, BUCKET = np.array([0.3, 0.5]), np.array([2.1, 0.05]), np.array([0.15, 0.4])
#: Lengths of the rocker and of its coupler.
LONG, COUPLER = 0.55, 0.6
MOTORS = ("boom_rod", "stick_rod", "bucket_rod")


def turned(angle: float, p: Point) -> Point:
    """Turn a point of the plane by a pitch."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([c * p[0] + s * p[1], c * p[1] - s * p[0]])


def rocker_end(bucket: float) -> Point:
    """Return the rocker's end on the stick, from the angle of the bucket: two circles meet above."""
    pin = STICK + turned(bucket, BUCKET)
    way = pin - ROCKER
    d = np.linalg.norm(way)
    along = (d * d + LONG * LONG - COUPLER * COUPLER) / (2 * d)
    up = np.array([-way[1], way[0]]) / d
    return ROCKER + along * way / d + np.sqrt(LONG * LONG - along * along) * up


def cylinders(angles: np.ndarray) -> np.ndarray:
    """Compute the lengths of the three cylinders, shape (3,), [m], by triangles."""
    boom, stick, bucket = angles
    first = PINS[0][0] - turned(boom, PINS[0][1])
    second = PINS[1][0] - BOOM - turned(stick, PINS[1][1])
    return np.array([np.linalg.norm(x) for x in (first, second, BARREL - rocker_end(bucket))])


def teeth(angles: np.ndarray) -> np.ndarray:
    """Compute x, z and pitch of the teeth, shape (3,), [m, rad]."""
    boom, stick, bucket = angles
    at = turned(boom, BOOM + turned(stick, STICK + turned(bucket, TEETH)))
    return np.array([*at, boom + stick + bucket])


def _angle(way: Point) -> float:
    """Return the pitch of a direction."""
    return float(np.arctan2(-way[1], way[0]))


def _link(name: str, mass: float, at: Point) -> str:
    inertia = " ".join(f'{axis}="{0.1 * mass}"' for axis in ("ixx", "iyy", "izz"))
    return (
        f'<link name="{name}"><inertial><origin xyz="{at[0]} 0 {at[1]}"/><mass value="{mass}"/>'
        f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def _joint(name: str, parent: str, child: str, at: Point, pitch: float, kind: str = "continuous") -> str:
    axis = "1 0 0" if kind == "prismatic" else "0 1 0"
    limit = '<limit lower="-1.5" upper="1.5" effort="1e6" velocity="1"/>' if kind == "prismatic" else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{float(at[0])!r} 0 {float(at[1])!r}" rpy="0 {pitch!r} 0"/>'
        f'<axis xyz="{axis}"/>{limit}</joint>'
    )


def _loop(name: str, one: str, other: str, at: Point, there: Point) -> str:
    a, b = (f'<origin xyz="{float(p[0])!r} 0 {float(p[1])!r}"/>' for p in (at, there))
    return (
        f'<loop name="{name}" type="revolute"><predecessor link="{one}">{a}</predecessor>'
        f'<successor link="{other}">{b}</successor><axis xyz="0 1 0"/></loop>'
    )


def _cylinder(name: str, base: str, at: Point, pin: Point) -> str:
    """Return barrel and rod between a pin on a body and another, both given on that body at home."""
    way, barrel, rod = pin - at, f"{name}_barrel", f"{name}_rod"
    out = _link(barrel, 40.0, np.array([0.4, 0.0])) + _link(rod, 20.0, np.array([-0.4, 0.0]))
    out += _joint(f"{name}_pivot", base, barrel, at, _angle(way))
    return out + _joint(rod, barrel, rod, np.array([np.linalg.norm(way), 0.0]), 0.0, "prismatic")


def text() -> str:
    """Return the robot's URDF."""
    boom, stick, bucket = (float(x) for x in HOME)
    end = rocker_end(bucket)
    out = '<link name="cab"/>' + _link("boom", 1500.0, BOOM / 2) + _link("stick", 700.0, STICK / 2)
    out += _link("bucket", 500.0, np.array([0.5, 0.0])) + _link("rocker", 30.0, np.array([LONG / 2, 0.0]))
    out += _link("coupler", 30.0, np.array([COUPLER / 2, 0.0])) + '<link name="teeth"/>'
    out += _joint("boom_joint", "cab", "boom", np.zeros(2), boom)
    out += _joint("stick_joint", "boom", "stick", BOOM, stick)
    out += _joint("bucket_joint", "stick", "bucket", STICK, bucket)
    out += _joint("teeth_joint", "bucket", "teeth", TEETH, 0.0, "fixed")
    pins = turned(boom, PINS[0][1]), BOOM + turned(stick, PINS[1][1])
    out += _cylinder("boom", "cab", PINS[0][0], pins[0]) + _cylinder("stick", "boom", PINS[1][0], pins[1])
    out += _cylinder("bucket", "stick", BARREL, end)
    rocking = _angle(end - ROCKER)
    out += _joint("rocker_joint", "stick", "rocker", ROCKER, rocking)
    way = STICK + turned(bucket, BUCKET) - end
    out += _joint("coupler_joint", "rocker", "coupler", np.array([LONG, 0.0]), _angle(way) - rocking)
    none, far = np.zeros(2), np.array([LONG, 0.0])
    out += _loop("boom_pin", "boom_rod", "boom", none, PINS[0][1])
    out += _loop("stick_pin", "stick_rod", "stick", none, PINS[1][1])
    out += _loop("rocker_pin", "bucket_rod", "rocker", none, far)
    out += _loop("bucket_pin", "coupler", "bucket", np.array([COUPLER, 0.0]), BUCKET)
    return f'<robot name="excavator">{out}</robot>'


def excavator(folder: Path) -> Path:
    """Write the robot's file and return its path."""
    path = folder / "excavator.urdf"
    path.write_text(text())
    return path
