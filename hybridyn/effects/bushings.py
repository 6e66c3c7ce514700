"""Bushings: springs and dampers in all six directions between two frames of links, compliant closures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from ..errors import ModelError
from ..linkage.motion import Motion
from ..spatial import LARGEST, Array, cross, rotate, rotate_back, rotation_from_quaternion
from ..structure.forms import check_form
from .link_effect import LinkEffect, Moving, Three
from .springs import UNIT_QUATERNION

#: Fields of the law that hold three numbers by bushing.
WORDS = ("torque_stiffness", "torque_damping", "force_stiffness", "force_damping")
#: Least cosine of the pitch of a bushing by which is divided: roll and yaw are about one axis there.
STEEPEST_PITCH = 1e-18


class Loaded(NamedTuple):
    """What a bushing does to its second frame; the first one has the opposite force and torque.

    Attributes:
        force: Force, world axes [N], at the point halfway between the two origins.
        torque: Torque about this point, world axes [N m].
        energy: Energy of the springs [J].
        lost: Power that the bushing takes, less the rate of its energy [W].
    """

    force: list[Any]
    torque: list[Any]
    energy: Any
    lost: Any


@dataclass(frozen=True)
class Bushings(LinkEffect):
    """Springs and dampers between a frame A of a link and a frame C of another one.

    Roll, pitch and yaw q of C in A have the torques -(k q + d q_dot). The way x from A to C, in axes halfway
    between both, has the force -(k x + d x_dot); it acts at the point halfway between both origins, and x_dot
    counts the turn of these axes as half of that of C in A. A force that is not along x, so of three unequal
    stiffnesses, is not quite that of a potential: what is left counts as lost. At a pitch of 90 degrees the
    torque has no bound.

    `ends`: the links of A and C by bushing; `frames`: A and C in their links, x, y, z [m] and the quaternion
    x, y, z, w, the links' own frames by default; `torque_stiffness` [N m/rad], `torque_damping` [N m s/rad]
    of roll, pitch and yaw, `force_stiffness` [N/m], `force_damping` [N s/m] along x, y and z: zeros by
    default. Source: Drake's LinearBushingRollPitchYaw.
    """

    ends: Mapping[str, Sequence[str]]
    frames: Mapping[str, Sequence[Sequence[float]]] = field(default_factory=dict)
    torque_stiffness: Mapping[str, Sequence[float]] = field(default_factory=dict)
    torque_damping: Mapping[str, Sequence[float]] = field(default_factory=dict)
    force_stiffness: Mapping[str, Sequence[float]] = field(default_factory=dict)
    force_damping: Mapping[str, Sequence[float]] = field(default_factory=dict)
    name: ClassVar[str] = "bushings"

    def __post_init__(self) -> None:
        check_form(self)
        for one, links in self.ends.items():
            if len(links) != 2 or links[0] == links[1]:
                raise self._error(one, "needs two links in 'ends'")
            poses = np.asarray(self.frames.get(one, [[0, 0, 0, 0, 0, 0, 1]] * 2), dtype=float)
            if poses.shape != (2, 7) or not (np.abs(poses) <= LARGEST).all():
                raise self._error(one, "needs two frames in 'frames', each of seven finite numbers")
            if not (np.abs(np.sum(poses[:, 3:] ** 2, axis=1) - 1) <= UNIT_QUATERNION).all():
                raise self._error(one, "needs quaternions of length one in 'frames'")
        for word in ("frames", *WORDS):
            for one in getattr(self, word):
                if one not in self.ends:
                    raise self._error(one, f"has numbers in '{word}' and no links in 'ends'")
        for word in WORDS:
            for one, three in getattr(self, word).items():
                if len(three) != 3 or not all(0 <= x <= LARGEST for x in three):
                    raise self._error(one, f"needs three finite numbers in '{word}', none of them negative")

    def _error(self, bushing: str, what: str) -> ModelError:
        return ModelError(f"{self.name}: '{bushing}' {what}", element=bushing)

    @property
    def links(self) -> tuple[str, ...]:
        """The links with bushings."""
        return tuple(dict.fromkeys(link for links in self.ends.values() for link in links))

    def at(self, link: str) -> Iterable[str]:
        """Return the bushings at a link."""
        return (one for one, links in self.ends.items() if link in links)

    def watched(self, link: str) -> tuple[str, ...]:
        """Return the links whose motion the wrench on a link depends on."""
        return tuple(dict.fromkeys(other for one in self.at(link) for other in self.ends[one]))

    @cached_property
    def placements(self) -> dict[str, tuple[tuple[Array, Array], tuple[Array, Array]]]:
        """Axes (3, 3) and origin (3,) [m] of A and C in their links, by bushing."""
        own = ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),) * 2
        poses = {one: np.asarray(self.frames.get(one, own), dtype=float) for one in self.ends}
        return {
            one: ((rotation_from_quaternion(a[3:]), a[:3]), (rotation_from_quaternion(c[3:]), c[:3]))
            for one, (a, c) in poses.items()
        }

    def load(self, bushing: str, A: Moving, C: Moving) -> Loaded:
        """Compute what a bushing does to its frame C."""
        none = (0.0, 0.0, 0.0)
        k_turn, d_turn, k_way, d_way = (getattr(self, word).get(bushing, none) for word in WORDS)
        turn, w, r, v = _seen(A, C)
        half = half_turn(turn)
        back = [-half[0], -half[1], -half[2], half[3]]
        x = _by_quaternion(back, r)
        x_dot = _by_quaternion(back, [a - 0.5 * b for a, b in zip(v, _cross(w, r), strict=True)])
        # The axes halfway turn by w / 2 and half of w x (axis tan(angle / 4)); x_dot leaves the latter out.
        rest = _by_quaternion(back, _cross(_cross(w, [h / half[3] for h in half[:3]]), r))
        q, rows = _roll_pitch_yaw(turn)
        q_dot = [_dot(row, w) for row in rows]
        springs = [(*k_turn, *k_way), (*q, *x)]
        dampers = [(*d_turn, *d_way), (*q_dot, *x_dot)]
        efforts = [-k * a - d * b for k, a, d, b in zip(*springs, *dampers, strict=True)]
        torque = [_dot(efforts[:3], column) for column in zip(*rows, strict=True)]
        force = _by_quaternion(half, efforts[3:])
        energy = 0.5 * sum(k * a * a for k, a in zip(*springs, strict=True))
        lost = sum(d * b * b for d, b in zip(*dampers, strict=True))
        lost = lost + 0.5 * sum(k * a * b for k, a, b in zip(k_way, x, rest, strict=True))
        return Loaded(_turned(A.R, force), _turned(A.R, torque), energy, lost)

    def _loads(self, motions: Mapping[str, Motion]) -> Iterable[tuple[str, tuple[Moving, Moving], Loaded]]:
        """Yield each bushing, the motion of its frames, and what it does."""
        for one, links in self.ends.items():
            moving = []
            for link, (R, p) in zip(links, self.placements[one], strict=True):
                m = motions[link]
                arm = rotate(m.R, np.broadcast_to(p, m.p.shape))
                axes, velocity = m.R @ R, m.p_dot + cross(m.w, arm)
                moving.append(Moving(np.moveaxis(axes, 0, -1), (m.p + arm).T, velocity.T, m.w.T))
            A, C = moving
            yield one, (A, C), self.load(one, A, C)

    def wrenches(self, time: Array | None, motions: Mapping[str, Motion], samples: int) -> dict[str, Array]:
        """Compute the wrench of all bushings on each link."""
        out = {link: np.zeros((samples, 6)) for link in self.links}
        for one, (A, C), load in self._loads(motions):
            force, torque = np.stack(load.force, axis=1), np.stack(load.torque, axis=1)
            middle = 0.5 * (A.p + C.p).T
            for link, sign in zip(self.ends[one], (-1.0, 1.0), strict=True):
                m = motions[link]
                about = torque + cross(middle - m.p, force)
                out[link][:, :3] += sign * rotate_back(m.R, force)
                out[link][:, 3:] += sign * rotate_back(m.R, about)
        return out

    def energy(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the sum of k q^2 / 2 and k x^2 / 2."""
        return np.asarray(sum((load.energy for _, _, load in self._loads(motions)), np.zeros(())))

    def power(self, motions: Mapping[str, Motion]) -> Array:
        """Compute the power that the bushings take, less the rate of their energy."""
        return np.asarray(sum((load.lost for _, _, load in self._loads(motions)), np.zeros(())))


def half_turn(R: Any) -> list[Any]:
    """Return the quaternion x, y, z, w of half the turn of a rotation, the short way: stable at every angle.

    Args:
        R: Three rows of three scalars, arrays or expressions.
    """
    m = R[0][0], R[1][1], R[2][2]
    xy, xz, yz = R[0][1] + R[1][0], R[0][2] + R[2][0], R[1][2] + R[2][1]
    wx, wy, wz = R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1]
    rows = [
        [1.0 + m[0] - m[1] - m[2], xy, xz, wx],
        [xy, 1.0 - m[0] + m[1] - m[2], yz, wy],
        [xz, yz, 1.0 - m[0] - m[1] + m[2], wz],
        [wx, wy, wz, 1.0 + m[0] + m[1] + m[2]],
    ]
    # Row i of 4 q q^T is 4 q_i q; the one of the largest component is the best multiple of q.
    best, largest = rows[3], rows[3][3]
    for i in range(3):
        larger = 1.0 * (rows[i][i] > largest)
        best = [larger * a + (1.0 - larger) * b for a, b in zip(rows[i], best, strict=True)]
        largest = np.maximum(rows[i][i], largest)
    sign = 1.0 - 2.0 * (best[3] < 0.0)
    size = np.sqrt(sum(a * a for a in best))
    x, y, z, w = (sign * a / size for a in best)
    length = np.sqrt(2.0 + 2.0 * w)
    return [x / length, y / length, z / length, (1.0 + w) / length]


def _seen(A: Moving, C: Moving) -> tuple[list[list[Any]], list[Any], list[Any], list[Any]]:
    """Return axes (3, 3), angular velocity, origin and velocity of C as seen in A, in its axes."""
    way = _minus(C.p, A.p)
    columns = [_turned_back(A.R, [row[i] for row in C.R]) for i in range(3)]
    turn = [[column[i] for column in columns] for i in range(3)]
    velocity = _minus(_minus(C.v, A.v), _cross(A.w, way))
    return turn, _turned_back(A.R, _minus(C.w, A.w)), _turned_back(A.R, way), _turned_back(A.R, velocity)


def _roll_pitch_yaw(R: Any) -> tuple[list[Any], list[list[Any]]]:
    """Return roll, pitch and yaw of a rotation, and the rows by which they follow its angular velocity."""
    cosine = np.maximum(np.sqrt(R[0][0] * R[0][0] + R[1][0] * R[1][0]), STEEPEST_PITCH)
    q = [np.arctan2(R[2][1], R[2][2]), np.arctan2(-R[2][0], cosine), np.arctan2(R[1][0], R[0][0])]
    c, s = R[0][0] / cosine, R[1][0] / cosine
    tangent = -R[2][0] / cosine
    return q, [[c / cosine, s / cosine, 0.0], [-s, c, 0.0], [c * tangent, s * tangent, 1.0]]


def _dot(a: Three, b: Three) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _minus(a: Three, b: Three) -> list[Any]:
    return [x - y for x, y in zip(a, b, strict=True)]


def _cross(a: Three, b: Three) -> list[Any]:
    return [a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))]


def _turned(R: Any, x: Three) -> list[Any]:
    return [_dot(row, x) for row in R]


def _turned_back(R: Any, x: Three) -> list[Any]:
    return [_dot(column, x) for column in zip(*R, strict=True)]


def _by_quaternion(q: Sequence[Any], x: Three) -> list[Any]:
    """Return a vector turned by a unit quaternion x, y, z, w."""
    twice = [2.0 * a for a in _cross(q[:3], x)]
    return [a + q[3] * b + c for a, b, c in zip(x, twice, _cross(q[:3], twice), strict=True)]
