"""What is prescribed in a module or a chain, and its numbers at postures and in requests."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ....assembly.module_request import ModuleRequest
from ....joints.kinds import JointKind
from ....linkage.angles import angles_of, angular_drift, angular_map, rate_map
from ....linkage.motion import Motion
from ....linkage.targets import COORDINATES, CoordinateTarget, PoseTarget
from ....linkage.tree import Tree
from ....spatial import Array, Index, quaternion_from_rotation, rotate

#: Kinds of prescribed numbers: a length or an angle, an angle up to whole turns, a pose (7 numbers).
NUMBER, ANGLE, POSE = 0, 1, 2
#: Numbers of each kind, of its rates and of its accelerations.
WIDTH, RATES = (1, 1, 7), (1, 1, 6)
#: Axes that have directions.
AXES = COORDINATES[:3]


@dataclass(frozen=True)
class GivenCoordinates:
    """Some coordinates of a link's pose that are prescribed.

    Attributes:
        body: Body of the tree after the cuts.
        links: The link, and the link in which the coordinates are measured.
        names: The coordinates.
        target: The target with all coordinates zero, one sample.
    """

    body: int
    links: tuple[str, str]
    names: tuple[str, ...]
    target: CoordinateTarget = field(compare=False)

    @classmethod
    def of(cls, target: CoordinateTarget) -> GivenCoordinates:
        """Return the coordinates that a target prescribes."""
        zero = np.zeros((1, len(target.names)))
        at_zero = target._replace(value=zero, rate=zero, acceleration=zero, heading=None)
        return cls(target.body, target.links, target.names, at_zero)

    @property
    def rows(self) -> tuple[int, ...]:
        """Their places in `COORDINATES`."""
        return tuple(COORDINATES.index(name) for name in self.names)

    @property
    def kinds(self) -> tuple[int, ...]:
        """The kind of each: a number, or an angle."""
        return tuple(ANGLE if row >= 3 else NUMBER for row in self.rows)


@dataclass(frozen=True)
class Given:
    """What is prescribed in a module.

    Attributes:
        joints: Joints of the tree after the cuts whose positions are given; platforms are among them.
        kinds: Their kinds: `NUMBER`, `ANGLE` or `POSE`.
        bodies: Bodies of that tree whose poses are targets.
        coordinates: Links of which some coordinates of the pose are targets.
    """

    joints: tuple[int, ...]
    kinds: tuple[int, ...]
    bodies: tuple[int, ...]
    coordinates: tuple[GivenCoordinates, ...] = ()

    @property
    def all_kinds(self) -> tuple[int, ...]:
        """The kind of each prescribed position: those of the joints, the poses, and the coordinates."""
        return (
            *self.kinds,
            *(POSE,) * len(self.bodies),
            *(kind for one in self.coordinates for kind in one.kinds),
        )

    @property
    def size(self) -> int:
        """Number of prescribed numbers."""
        return sum(WIDTH[kind] for kind in self.all_kinds)

    @property
    def rates(self) -> int:
        """Number of prescribed rates."""
        return sum(RATES[kind] for kind in self.all_kinds)

    def columns(self, tree: Tree) -> Index:
        """Return the freedoms of the given joints, in their order."""
        every = np.arange(tree.nv)
        return np.concatenate([np.zeros(0, dtype=int), *(every[tree.v_slices[j]] for j in self.joints)])

    def of_posture(self, tree: Tree, x: Array) -> Array:
        """Compute the prescribed numbers at postures of the tree after the cuts, shape (T, size)."""
        parts = [np.zeros((len(x), 0))]
        for joint, kind in zip(self.joints, self.kinds, strict=True):
            own = x[:, tree.q_slices[joint]]
            parts.append(np.arctan2(own[:, 1:], own[:, :1]) if kind == ANGLE else own)
        motion = tree.sweep(x)
        for body in self.bodies:
            parts += [motion.p[:, body], quaternion_from_rotation(motion.R[:, body])]
        first = np.zeros(len(x), dtype=int)
        parts += [one.target.residual(motion, first) for one in self.coordinates]
        return np.concatenate(parts, axis=1)


def given_of(request: ModuleRequest) -> Given:
    """Return what a request prescribes."""
    tree = request.mechanism.tree
    kinds = {JointKind.CONTINUOUS: ANGLE, JointKind.FLOATING: POSE}
    return Given(
        tuple(request.given),
        tuple(kinds.get(tree.joints[joint].kind, NUMBER) for joint in request.given),
        tuple(pose.body for pose in _whole(request)),
        tuple(map(GivenCoordinates.of, _by_coordinates(request))),
    )


def _whole(request: ModuleRequest) -> list[PoseTarget]:
    """Return the targets that are whole poses."""
    return [one for _, one in request.targets if isinstance(one, PoseTarget) and one.lengths]


def _by_coordinates(request: ModuleRequest) -> list[CoordinateTarget]:
    """Return the targets that are no whole poses, by coordinates: orientations by their angles."""
    each = (_by_angles(one) if isinstance(one, PoseTarget) else one for _, one in request.targets)
    return [target for target in each if isinstance(target, CoordinateTarget)]


def _by_angles(target: PoseTarget) -> CoordinateTarget | None:
    """Return the target of a body's orientation by roll, pitch and yaw of the upright triples."""
    if target.lengths:
        return None
    goal, upright = target.goal, angles_of(target.goal.R)
    to_rates = rate_map(upright)
    rates = rotate(to_rates, goal.w)
    drift = angular_drift(angular_map(goal.R, upright), rates)
    levels = upright, rates, rotate(to_rates, goal.w_dot - drift)
    still = np.eye(3), np.zeros(3)
    return CoordinateTarget(
        target.body, ("body", "base"), COORDINATES[3:], *still, still, *levels, target.units
    )


def numbers_of(request: ModuleRequest, given: Given) -> tuple[Array, Array, Array]:
    """Return the prescribed numbers, shape (T, size), their rates and accelerations, shape (T, rates)."""
    tree, T = request.mechanism.tree, len(request.known)
    levels: list[tuple[Array, ...]] = [(np.zeros((T, 0)),) * 3]
    for joint, kind in zip(given.joints, given.kinds, strict=True):
        at, to = tree.q_slices[joint], tree.v_slices[joint]
        known = request.angles[joint][:, None] if kind == ANGLE else request.known[:, at]
        levels.append((known, request.known_v[:, to], request.known_a[:, to]))
    for goal in (target.goal for target in _whole(request)):
        pairs = (goal.p, quaternion_from_rotation(goal.R)), (goal.p_dot, goal.w), (goal.p_ddot, goal.w_dot)
        levels.append(tuple(np.concatenate(pair, axis=1) for pair in pairs))
    for some in _by_coordinates(request):
        levels.append((some.value, some.rate, some.acceleration))
    g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*levels, strict=True))
    return g, g_dot, g_ddot


@dataclass(frozen=True)
class Pointing:
    """A direction, a distance or an orientation that is prescribed.

    Attributes:
        what: The axis that has the direction ("x", "y", "z"), "distance" from a point, or "turn".
    """

    what: str

    @property
    def width(self) -> int:
        """Number of prescribed numbers: the direction's, the distance and the point, or a quaternion."""
        return 3 if self.what in AXES else 4

    @property
    def rates(self) -> int:
        """Number of their rates."""
        return 4 if self.what == "distance" else 3

    def at(self, motion: Motion, known: Array) -> Array:
        """Compute what a link has of it, shape (1, width), in the frame in which its motion is.

        Args:
            known: What is prescribed, shape (width,): of a point, it is where this says.
        """
        if self.what == "turn":
            return quaternion_from_rotation(motion.R[:, 1])
        if self.what in AXES:
            out: Array = motion.R[:, 1, :, AXES.index(self.what)]
            return out
        away = np.linalg.norm(motion.p[0, 1] - known[1:])
        return np.concatenate([[away], known[1:]])[None]


@dataclass(frozen=True)
class Prescribed(Given):
    """What poses through several modules prescribe: at the end a heading for each link with angles.

    Attributes:
        pointing: Directions, distances and orientations, after the coordinates.
    """

    pointing: tuple[Pointing, ...] = ()

    @property
    def all_kinds(self) -> tuple[int, ...]:
        """The kind of each prescribed position, then those of the headings."""
        more = sum(one.width for one in self.pointing) + len(self.turning)
        return (*super().all_kinds, *(NUMBER,) * more)

    @property
    def places(self) -> list[slice]:
        """The prescribed numbers of each target."""
        widths = [WIDTH[POSE]] * len(self.bodies) + [len(some.names) for some in self.coordinates]
        ends = np.cumsum([0, *widths, *(one.width for one in self.pointing)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @property
    def rate_places(self) -> list[slice]:
        """The prescribed rates of each target."""
        widths = [RATES[POSE]] * len(self.bodies) + [len(some.names) for some in self.coordinates]
        ends = np.cumsum([0, *widths, *(one.rates for one in self.pointing)]).tolist()
        return [slice(*pair) for pair in pairwise(ends)]

    @property
    def turning(self) -> list[int]:
        """Numbers of the coordinates with angles."""
        return [i for i, some in enumerate(self.coordinates) if ANGLE in some.kinds]

    @property
    def rates(self) -> int:
        """Number of prescribed rates."""
        return max((at.stop for at in self.rate_places), default=0)
