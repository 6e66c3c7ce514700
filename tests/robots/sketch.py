"""Lay out a mechanism in the world, posture first: joints and closures are then defined to hold there."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from hybridyn.description.records import Closure, Coupling, Description, Joint, JointKind, Link, RotationKind

CLOSURES: dict[str, tuple[tuple[int, ...], RotationKind]] = {
    "fixed": ((0, 1, 2), "fixed"),
    "revolute": ((0, 1, 2), "parallel"),
    "prismatic": ((0, 1), "fixed"),
    "cylindrical": ((0, 1), "parallel"),
    "universal": ((0, 1, 2), "perpendicular"),
    "planar": ((2,), "parallel"),
    "spherical": ((0, 1, 2), "free"),
    "rows_x": ((0,), "free"),
    "rows_yz": ((1, 2), "free"),
    "rows_y_perpendicular": ((1,), "perpendicular"),
    "rows_xz_parallel": ((0, 2), "parallel"),
    "rows_x_fixed": ((0,), "fixed"),
    "rows_parallel": ((), "parallel"),
    "rows_fixed": ((), "fixed"),
}
ROW_COUNT = {
    name: len(t) + {"free": 0, "perpendicular": 1, "parallel": 2, "fixed": 3}[r]
    for name, (t, r) in CLOSURES.items()
}


# -------------------------------------------------------------------- small geometry


def unit(x: Any) -> np.ndarray:
    return np.asarray(x, float) / np.linalg.norm(x)


def turn(axis: np.ndarray, angle: float) -> np.ndarray:
    """Return the rotation by `angle` about a unit axis."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def rotation_of(xyzw: np.ndarray) -> np.ndarray:
    angle = 2 * np.arctan2(np.linalg.norm(xyzw[:3]), xyzw[3])
    return turn(unit(xyzw[:3]), angle)


def placement(R: np.ndarray, t: np.ndarray) -> np.ndarray:
    M = np.eye(4)
    M[:3, :3], M[:3, 3] = R, t
    return M


def inverse(M: np.ndarray) -> np.ndarray:
    return placement(M[:3, :3].T, -M[:3, :3].T @ M[:3, 3])


@dataclass(frozen=True)
class Place:
    """A frame in the world on which a part of a mechanism is laid out."""

    origin: np.ndarray
    axes: np.ndarray

    def __call__(self, x: float, y: float, z: float = 0.0) -> np.ndarray:
        """Return a point of the place in the world."""
        return self.origin + self.axes @ [x, y, z]

    @property
    def normal(self) -> np.ndarray:
        """Third axis, the normal of what is planar."""
        return self.axes[:, 2]


# -------------------------------------------------------------------- laying out


class Sketch:
    """A mechanism in the making: links at their home placement in the world, the rest from there."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.fixed_links = rng, 1 / 3
        self.links: list[Link] = []
        self.joints: list[Joint] = []
        self.closures: list[Closure] = []
        self.couplings: list[Coupling] = []
        self.motors: list[str] = []
        self.home: dict[str, tuple[float, ...]] = {}
        self.poses = {"base": np.eye(4)}
        self._link("base", massless=False, size=0.3)

    def random_rotation(self) -> np.ndarray:
        """Draw a rotation matrix."""
        return rotation_of(unit(self.rng.normal(size=4)))

    def direction(self) -> np.ndarray:
        """Draw a unit vector."""
        return unit(self.rng.normal(size=3))

    def perpendicular(self, z: np.ndarray) -> np.ndarray:
        """Draw a unit vector at a right angle to z."""
        return unit(np.cross(z, self.direction()))

    def jitter(self, size: float = 0.08) -> float:
        """Draw a number in [-size, size]."""
        return float(self.rng.uniform(-size, size))

    def place(self, origin: np.ndarray | None = None) -> Place:
        """Return a random frame to lay a part out on."""
        origin = self.rng.uniform(-0.2, 0.2, 3) if origin is None else origin
        return Place(origin, self.random_rotation())

    def _name(self, stem: str) -> str:
        return f"{chr(97 + int(self.rng.integers(26)))}{len(self.links)}_{stem}"

    def _link(self, name: str, massless: bool, size: float) -> str:
        X = self.rng.normal(size=(3, 3))
        mass = 0.0 if massless else float(self.rng.uniform(0.5, 2.0))
        inertia = mass * size**2 * (0.3 * np.eye(3) + 0.1 * X @ X.T)
        com = np.zeros(3) if massless else self.rng.uniform(-size, size, 3)
        self.links.append(Link(name, mass, com, (inertia + inertia.T) / 2))
        return name

    def thin(self, link: str, along: np.ndarray) -> None:
        """Make a link a rod without thickness: no inertia about the line through its origin."""
        index = next(i for i, entry in enumerate(self.links) if entry.name == link)
        d = self.poses[link][:3, :3].T @ along
        mass = self.links[index].mass
        inertia = mass * 0.02 * (np.eye(3) - np.outer(d, d))
        self.links[index] = Link(link, mass, 0.1 * d, (inertia + inertia.T) / 2)

    def spot(self, link: str) -> str:
        """Return the link itself, or now and then a new link fixed to it."""
        if self.rng.random() > self.fixed_links:
            return link
        name = self._name("fixed")
        child = self._link(f"{name}_link", massless=bool(self.rng.random() < 0.5), size=0.05)
        M = placement(self.random_rotation(), self.rng.uniform(-0.1, 0.1, 3))
        self.joints.append(Joint(name, "fixed", link, child, M, np.array([1.0, 0.0, 0.0])))
        self.poses[child] = self.poses[link] @ M
        return child

    def joint(
        self,
        kind: JointKind,
        parent: str,
        at: np.ndarray,
        axis: np.ndarray | None = None,
        *,
        motor: bool = False,
        massless: bool = False,
        stem: str | None = None,
    ) -> str:
        """Add a joint at a world point about a world axis; give its child (the joint's name + "_link")."""
        axis = self.direction() if axis is None else axis
        R = self.random_rotation()
        if kind == "planar":
            x = self.perpendicular(axis)
            R = np.column_stack([x, np.cross(axis, x), axis])
        local = np.array([0.0, 0.0, 1.0]) if kind == "planar" else unit(R.T @ axis)
        q, J = self._home(kind, local)
        parent = self.spot(parent)
        name = self._name(stem or kind)
        W = placement(R, at)
        M = inverse(self.poses[parent]) @ W @ inverse(J)
        child = self._link(f"{name}_link", massless, size=0.12)
        self.joints.append(Joint(name, kind, parent, child, M, local))
        self.home[name], self.poses[child] = q, W
        if motor:
            self.motors.append(name)
        return child

    def _home(self, kind: JointKind, axis: np.ndarray) -> tuple[tuple[float, ...], np.ndarray]:
        angle, shift, xyzw = self.jitter(1.0), self.rng.uniform(0.1, 0.4, 3), unit(self.rng.normal(size=4))
        if kind == "prismatic":
            return (float(shift[0]),), placement(np.eye(3), axis * shift[0])
        if kind == "spherical":
            return tuple(map(float, xyzw)), placement(rotation_of(xyzw), np.zeros(3))
        if kind == "floating":
            return tuple(map(float, (*shift, *xyzw))), placement(rotation_of(xyzw), shift)
        R = turn(axis, angle)
        if kind == "planar":
            return (float(shift[0]), float(shift[1]), np.cos(angle), np.sin(angle)), placement(
                R, [*shift[:2], 0.0]
            )
        return (angle,) if kind == "revolute" else (float(np.cos(angle)), float(np.sin(angle))), placement(
            R, np.zeros(3)
        )

    def close(self, kind: str, a: str, b: str, at: np.ndarray, z: np.ndarray | None = None) -> None:
        """Close a loop at a world point; z is the third axis of frame A."""
        translations, rotation = CLOSURES[kind]
        z = self.direction() if z is None else z
        x = self.perpendicular(z)
        A = np.column_stack([x, np.cross(z, x), z])
        about_z = [turn(np.array([0.0, 0.0, 1.0]), self.jitter(3.0)) for _ in range(2)]
        B = {
            "fixed": A,
            "parallel": A @ about_z[0],
            "perpendicular": A @ about_z[0] @ turn(np.array([1.0, 0.0, 0.0]), np.pi / 2) @ about_z[1],
            "free": self.random_rotation(),
        }[rotation]
        left = [self.jitter(0.2) if i not in translations else 0.0 for i in range(3)]
        a, b = self.spot(a), self.spot(b)
        frame_a = inverse(self.poses[a]) @ placement(A, at)
        frame_b = inverse(self.poses[b]) @ placement(B, at + A @ left)
        if self.rng.random() < 0.5 and rotation != "perpendicular" and len(translations) in (0, 3):
            a, b, frame_a, frame_b = b, a, frame_b, frame_a
        self.closures.append(
            Closure(self._name("closure"), kind, a, frame_a, b, frame_b, translations, rotation)
        )

    def couple(self, links: Sequence[str], ratios: Sequence[float]) -> None:
        """Couple the joints above some links, at the offset that holds at home."""
        names = [link.removesuffix("_link") for link in links]
        values = [self.home[name] for name in names]
        angles = [x[0] if len(x) == 1 else float(np.arctan2(x[1], x[0])) for x in values]
        offset = float(np.dot(ratios, angles))
        self.couplings.append(
            Coupling(self._name("gear"), tuple(zip(names, map(float, ratios), strict=True)), offset)
        )

    def description(self, name: str) -> Description:
        """Return the finished record, links and joints in shuffled file order."""
        links = [self.links[i] for i in self.rng.permutation(len(self.links))]
        joints = [self.joints[i] for i in self.rng.permutation(len(self.joints))]
        return Description(
            name, tuple(links), tuple(joints), tuple(self.closures), tuple(self.couplings),
            tuple(self.motors), "drawn", dict(self.home),
        )  # fmt: skip


def rounded(description: Description, digits: int) -> Description:
    """Return the description as a CAD export would write it."""

    def short(M: np.ndarray) -> np.ndarray:
        return np.round(M, digits)

    joints = tuple(
        replace(j, placement=short(j.placement), axis=short(j.axis) / np.linalg.norm(short(j.axis)))
        for j in description.joints
    )
    closures = tuple(
        replace(c, frame_a=short(c.frame_a), frame_b=short(c.frame_b)) for c in description.closures
    )
    home = {name: tuple(np.round(x, digits)) for name, x in description.home.items()}
    return replace(description, joints=joints, closures=closures, home=home)
