"""Stacks as people write them: URDF laid out at home, all link frames parallel to the world's.

Joints with an effort limit are motors. Each function gives the text of a file; `WRITTEN` names them.
"""

from collections.abc import Callable

import numpy as np

from tests.robots import excavator

Point = np.ndarray
X, Y, Z = np.eye(3)


def point(*numbers: float) -> Point:
    return np.array(numbers)


def ring(radius: float, angle: float, z: float) -> Point:
    """Return a point of a level circle, its angle in degrees."""
    a = np.radians(angle)
    return point(radius * np.cos(a), radius * np.sin(a), z)


def across(way: Point) -> Point:
    """Return a level direction at a right angle to another."""
    out = np.cross(Z, way)
    return X if np.linalg.norm(out) < 1e-9 else out / np.linalg.norm(out)


class Sheet:
    """A file in the making.

    Attributes:
        at: Where each link's frame stands at home [m].
    """

    def __init__(self, root: str) -> None:
        self.at, self._text = {root: np.zeros(3)}, [f'<link name="{root}"/>']

    def joint(
        self,
        kind: str,
        parent: str,
        child: str,
        at: Point,
        axis: Point = Z,
        *,
        motor: bool = False,
        limits: tuple[float, float] | None = None,
        mass: float = 1.0,
    ) -> str:
        """Write a joint and its child; give the child."""
        origin, self.at[child] = at - self.at[parent], at
        inertia = " ".join(f'{name}="{0.02 * mass!r}"' for name in ("ixx", "iyy", "izz"))
        self._text.append(
            f'<link name="{child}"><inertial><origin xyz="0.02 0.01 0.03"/><mass value="{mass!r}"/>'
            f'<inertia {inertia} ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        low, high = limits or (-3.0, 3.0)
        limit = f'<limit lower="{low!r}" upper="{high!r}" effort="{200 * motor}" velocity="9"/>'
        axes = "" if kind == "fixed" else f'<axis xyz="{_numbers(axis)}"/>{limit}'
        self._text.append(
            f'<joint name="{child}_joint" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{_numbers(origin)}"/>{axes}</joint>'
        )
        return child

    def loop(self, kind: str, one: str, other: str, at: Point, axis: Point = Z) -> None:
        """Write a closure at a point between two links."""
        ends = (f'<origin xyz="{_numbers(at - self.at[link])}"/>' for link in (one, other))
        a, b = ends
        self._text.append(
            f'<loop name="{one}_{other}" type="{kind}"><predecessor link="{one}">{a}</predecessor>'
            f'<successor link="{other}">{b}</successor><axis xyz="{_numbers(axis)}"/></loop>'
        )

    def universal(self, parent: str, name: str, at: Point, first: Point, second: Point) -> str:
        """Write a universal joint as two revolute ones; give what it carries."""
        cross = self.joint("revolute", parent, f"{name}_cross", at, first, mass=0.1)
        return self.joint("revolute", cross, name, at, second)

    def cylinder(self, base: str, name: str, low: Point, high: Point, stroke: float) -> str:
        """Write a driven slide on a universal joint from one point to another; give its rod."""
        way = (high - low) / np.linalg.norm(high - low)
        barrel = self.universal(base, f"{name}_barrel", low, across(way), np.cross(way, across(way)))
        return self.joint(
            "prismatic", barrel, f"{name}_rod", high - 0.3 * way, way, motor=True, limits=(-stroke, stroke)
        )

    def text(self, name: str) -> str:
        """Return the whole file."""
        return f'<robot name="{name}">{"".join(self._text)}</robot>'


def _numbers(p: Point) -> str:
    return " ".join(repr(float(x)) for x in p)


def planar_under_arm() -> str:
    """Write a 3-RPR in the floor's plane that carries an arm of two joints."""
    s, center = Sheet("floor"), point(0.05, 0.02, 0.1)
    for k, name in enumerate("abc"):
        low, high = ring(0.9, 120 * k + 10, 0.1), center + ring(0.25, 120 * k + 40, 0.0)
        way = (high - low) / np.linalg.norm(high - low)
        foot = s.joint("revolute", "floor", f"{name}_foot", low, Z)
        rod = s.joint("prismatic", foot, f"{name}_rod", low + 0.2 * way, way, motor=True, limits=(-0.5, 0.5))
        if k == 0:
            s.joint("revolute", rod, "plate", high, Z, mass=5.0)
        else:
            s.loop("revolute", rod, "plate", high, Z)
    arm = s.joint("revolute", "plate", "upper", center + point(0, 0, 0.1), Y, motor=True)
    arm = s.joint("revolute", arm, "fore", center + point(0.3, 0, 0.5), Y, motor=True)
    s.joint("fixed", arm, "tool", center + point(0.7, 0, 0.4))
    return s.text("planar_under_arm")


def leg() -> str:
    """Write a leg whose ankle is moved by two cylinders between shank and foot."""
    s, ankle = Sheet("pelvis"), point(0.02, 0.0, -0.85)
    link = "pelvis"
    for name, axis in (("yaw", Z), ("roll", X), ("thigh", Y)):
        link = s.joint("revolute", link, name, point(0.0, 0.0, -0.1), axis, motor=True)
    shank = s.joint("revolute", link, "shank", point(0.05, 0.0, -0.45), Y, motor=True, mass=3.0)
    foot = s.universal(shank, "foot", ankle, Y, X)
    for side, y in (("left", 0.05), ("right", -0.05)):
        high = ankle + point(-0.09, y, -0.02)
        rod = s.cylinder(shank, side, point(-0.05, y, -0.6), high, 0.1)
        s.loop("spherical", rod, foot, high)
    s.joint("fixed", foot, "sole", ankle + point(0.05, 0, -0.06))
    return s.text("leg")


def delta_on_gantry() -> str:
    """Write a Delta of pairs of rods, hung from a gantry of three slides."""
    s, link = Sheet("frame"), "frame"
    for name, axis in (("bridge", X), ("cart", Y), ("column", Z)):
        link = s.joint("prismatic", link, name, point(0, 0, 1.0), axis, motor=True, limits=(-1.0, 1.0))
    center = point(0.0, 0.0, 0.3)
    for k, name in enumerate("abc"):
        out, side = ring(1.0, 120 * k, 0.0), ring(1.0, 120 * k + 90, 0.0)
        elbow, wrist = 0.45 * out + point(0, 0, 0.85), center + 0.1 * out
        arm = s.joint("revolute", link, f"{name}_arm", 0.2 * out + Z, side, motor=True)
        for end, y in (("l", 0.06), ("r", -0.06)):
            way = (wrist - elbow) / np.linalg.norm(wrist - elbow)
            rod = s.universal(arm, f"{name}_{end}", elbow + y * side, side, np.cross(way, side))
            if (k, y) == (0, 0.06):
                ball = s.universal(rod, "ball", wrist + y * side, side, np.cross(way, side))
                s.joint("revolute", ball, "plate", wrist + y * side, way)
            else:
                s.loop("spherical", rod, "plate", wrist + y * side)
    s.joint("fixed", "plate", "tool", center - point(0, 0, 0.1))
    return s.text("delta_on_gantry")


def arm_on_hexapod() -> str:
    """Write a UR5 on a platform of six cylinders."""
    s, height = Sheet("ground"), 0.7
    for k in range(6):
        side = (-1) ** k
        low = ring(0.5, 120 * (k // 2) + 12 * side, 0.0)
        high = ring(0.32, 120 * (k // 2) + 48 * side, height)
        rod = s.cylinder("ground", f"leg{k}", low, high, 0.4)
        if k == 0:
            way = (high - low) / np.linalg.norm(high - low)
            ball = s.universal(rod, "ball", high, across(way), np.cross(way, across(way)))
            s.joint("revolute", ball, "platform", high, way, mass=18.0)
        else:
            s.loop("spherical", rod, "platform", high)
    at, link = point(0, 0, height), "platform"
    for name, way, axis in (
        ("shoulder", point(0, 0, 0.089), Z), ("upper_arm", point(0, 0.136, 0), Y),
        ("forearm", point(0.3, -0.12, 0.3), Y), ("wrist_1", point(0.39, 0, 0.05), Y),
        ("wrist_2", point(0, 0.093, 0), Z), ("wrist_3", point(0, 0, -0.095), Y),
    ):  # fmt: skip
        at = at + way
        link = s.joint("revolute", link, name, at, axis, motor=True, limits=(-6.28, 6.28))
    s.joint("fixed", link, "tool", at + point(0, 0.08, 0))
    return s.text("arm_on_hexapod")


#: The texts, each with the link whose pose is given, what it is seen from, and whether the base floats.
WRITTEN: dict[str, tuple[Callable[[], str], str, str, bool]] = {
    "excavator": (excavator.text, "teeth", "cab", False),
    "planar_under_arm": (planar_under_arm, "tool", "floor", False),
    "leg": (leg, "sole", "world", True),
    "delta_on_gantry": (delta_on_gantry, "tool", "frame", False),
    "arm_on_hexapod": (arm_on_hexapod, "tool", "ground", False),
}
