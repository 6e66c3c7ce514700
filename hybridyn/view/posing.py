"""Move one motor or one link by hand while the loops stay closed; it stops where they can no longer close.

A drag sets the position of one joint. The other joints that determine its module's posture keep their
positions: the other motors, except redundant ones, and passive joints if there are too few motors.

A drag of a link moves all modules that carry it. A link with six freedoms takes the whole pose, another one
those coordinates that it can move independently, and keeps its angles. A rule takes further freedoms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..assembly.chain.between import Between, end_link, moving, tools_of
from ..assembly.chain.coordinates import coordinates_at, independent_coordinates
from ..assembly.moving import move_link, move_module
from ..assembly.redundancy import LEAST
from ..errors import AssemblyError, HybridynError
from ..joints.kinds import JointKind
from ..linkage.targets import COORDINATES
from ..spatial import Array, quaternion_from_rotation, rotation_from_vector, rotation_vector
from ..structure.module import Module
from ..structure.robot import HybridRobot, joint_position
from .placing import place_bodies

#: Number of bisections that find the last reachable position on the way to one out of reach.
HALVINGS = 6
#: Smallest part of a joint in the motions that the joints before it leave free. A smaller part is rounding.
LEAST_SHARE = 1e-3
#: Range of a slide without limits to either side of home, relative to the module's length.
STROKE = 1.0
#: Range of a hinge without limits to either side of home [rad].
TURN = np.pi


@dataclass(frozen=True)
class Lever:
    """A joint that can be moved by hand.

    Attributes:
        module: Number of its module.
        low: Lowest position [m or rad].
        high: Highest position [m or rad].
        unit: "m" or "rad".
    """

    joint: str
    module: int
    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class Moved:
    """Result of a move.

    Attributes:
        q: The posture reached, shape (nq,).
        value: Position of the joint reached [m or rad]; of a link, the part of its way.
        message: Why the joint or link stopped early, or an empty text.
    """

    q: Array
    value: float
    message: str = ""


class Poser:
    """Moves single joints and links of a robot.

    Attributes:
        robot: The robot.
        levers: The joints that can be moved.
        links: The links that can be moved: the tools, or platforms, of modules that carry no other module.
        redundancy: The rule for freedoms that a dragged link leaves, as in `hybridyn.assemble`.
    """

    def __init__(self, robot: HybridRobot, redundancy: str = LEAST) -> None:
        self.robot, self.redundancy = robot, redundancy
        movable = [name for name in robot.motors if self._kind(name).single]
        joints = movable or [*self._independent_joints()]
        self.levers = tuple(self._lever(name) for name in joints)
        self._others: dict[str, tuple[str, ...]] = {}
        carrying = {module.parent for module in robot.modules}
        tips = [k for k in range(len(robot.modules)) if k not in carrying]
        ends = [link for k in tips for link in tools_of(robot, k) or [end_link(robot, k)]]
        self.links = tuple(link for link in ends if moving(robot, link, robot.description.root))

    def value(self, q: Array, joint: str) -> float:
        """Return the position of a joint [m or rad]; for a continuous joint the angle in [-pi, pi]."""
        return float(joint_position(self.robot, q, joint))

    def move(self, q: Array, joint: str, value: float) -> Moved:
        """Move one joint towards a position, as far as the loops close.

        Args:
            q: The current posture, shape (nq,).
            value: Requested position [m or rad].

        Returns:
            The posture reached, with a message if the joint stopped before the requested position.
        """
        lever = next(lever for lever in self.levers if lever.joint == joint)
        start = self.value(q, joint)
        way = value - start
        if self._kind(joint).endless:
            way = float((way + np.pi) % (2 * np.pi) - np.pi)
        reached, done, stopped = _as_far(q, lambda q, part: self._close(q, lever, start + part * way))
        if not stopped:
            return Moved(reached, value)
        at = start + done * way
        module = self.robot.modules[lever.module]
        return Moved(
            reached,
            at,
            f"{joint} stops at {at:.4g} {lever.unit}: beyond this, the loops of {module.name} do not close",
        )

    def pose(self, q: Array, link: str) -> tuple[Array, Array]:
        """Return position, shape (3,), [m], and axes, shape (3, 3), of a link in the world."""
        placement, (body, R, p) = place_bodies(self.robot, q), self.robot.bodies.place[link]
        return placement.p[body] + placement.R[body] @ p, placement.R[body] @ R

    def drag(self, q: Array, link: str, p: Array, R: Array | None = None) -> Moved:
        """Move a link towards a pose in the world, as far as loops close and motors are within their ranges.

        Args:
            q: The current posture, shape (nq,).
            link: One of `links`.
            p: Requested position, shape (3,), [m].
            R: Requested axes, shape (3, 3); by default those that it has.

        Returns:
            The posture reached, with a message if the link stopped before the requested pose.
        """
        p0, R0 = self.pose(q, link)
        turn = rotation_vector((R0.T @ (R0 if R is None else R))[None])

        def moved(q: Array, part: float) -> Array:
            axes = R0 @ rotation_from_vector(part * turn)[0]
            way = self._way(q, link, p0 + part * (p - p0), axes)
            out = move_link(self.robot, link, way, q, self.redundancy)
            self._check_ranges(q, out)
            return out

        reached, done, stopped = _as_far(q, moved)
        said = f"{link} stops after {done:.0%} of the way: {stopped}" if stopped else ""
        return Moved(reached, done, said)

    def _way(self, q: Array, link: str, p: Array, R: Array) -> Mapping[str, Array] | Array:
        """Return the present and the requested pose of a link in the root link, for `move_link`."""
        robot, root = self.robot, self.robot.description.root
        (p0, R0), now = self.pose(q, root), self.pose(q, link)
        J, values = coordinates_at(Between.of_coordinates(robot, moving(robot, link, root), link, root), q)
        places = np.stack([now[0] - p0, p - p0]) @ R0
        names = independent_coordinates(J, ())
        if len(names) == len(COORDINATES):
            axes = np.matmul(R0.T, np.stack([now[1], R]))
            return np.concatenate([places, quaternion_from_rotation(axes)], axis=1)
        held = np.concatenate([places, np.tile(values[3:], (2, 1))], axis=1)
        return {name: held[:, COORDINATES.index(name)] for name in names}

    def _check_ranges(self, before: Array, after: Array) -> None:
        """Raise if a motor leaves its range.

        Raises:
            AssemblyError: It does.
        """
        for lever in self.levers:
            here, there = (self.value(q, lever.joint) for q in (before, after))
            if max(lever.low - there, there - lever.high) > max(0.0, lever.low - here, here - lever.high):
                raise AssemblyError(f"{lever.joint} is at the end of its range")

    def _kind(self, joint: str) -> JointKind:
        return self.robot.kinds[self.robot.joint_index[joint]]

    def _close(self, q: Array, lever: Lever, value: float) -> Array:
        """Close the loops with a joint at a position, starting from posture `q`.

        Raises:
            HybridynError: The position is out of reach.
        """
        if lever.joint not in self._others:
            self._others[lever.joint] = self._find_others(q, lever)
        joints = {name: self.value(q, name) for name in self._others[lever.joint]} | {lever.joint: value}
        return move_module(self.robot, lever.module, joints, q)

    def _find_others(self, q: Array, lever: Lever) -> tuple[str, ...]:
        """Return the joints whose positions, together with that of the lever, determine the posture."""
        module = self.robot.modules[lever.module]
        first = lever.joint
        motors = [name for name in module.motors if name != first and self._kind(name).single]
        chosen = independent(module, [first, *motors])
        try:  # spinning rods need no further joint
            move_module(self.robot, lever.module, {name: self.value(q, name) for name in chosen}, q)
        except AssemblyError as error:
            if not error.open_freedoms:
                raise
            tree = [module.joints[i] for i in module.mechanism.spec.tree_joint if i is not None]
            passive = [name for name in tree if self._kind(name).single and name not in (first, *motors)]
            chosen = independent(module, [first, *motors, *passive])
        return tuple(name for name in chosen if name != first)

    def _independent_joints(self) -> list[str]:
        """Return joints whose positions determine the posture of a robot without motors."""
        out: list[str] = []
        for module in self.robot.modules:
            tree = [module.joints[i] for i in module.mechanism.spec.tree_joint if i is not None]
            known = [name for name in tree if name in self.robot.joint_index and self._kind(name).single]
            out += independent(module, known)
        return out

    def _lever(self, joint: str) -> Lever:
        """Build the lever of a joint; without limits its range is `TURN` or `STROKE` about home."""
        number = next(k for k, module in enumerate(self.robot.modules) if joint in module.joints)
        record = self.robot.records[joint]
        home = self.value(self.robot.home, joint)
        slides = record.kind.slides
        span = STROKE * float(self.robot.modules[number].mechanism.length) if slides else TURN
        if record.kind.endless:
            return Lever(joint, number, -TURN, TURN, "rad")
        low = record.lower if np.isfinite(record.lower) else home - span
        high = record.upper if np.isfinite(record.upper) else home + span
        if not low < high:  # exporters write limits of 0 and 0 for none
            low, high = home - span, home + span
        unit = "m" if slides else "rad"
        return Lever(joint, number, min(low, home), max(high, home), unit)


def _as_far(q: Array, move: Callable[[Array, float], Array]) -> tuple[Array, float, str]:
    """Go all the way by a move, which takes a posture and the part of the way to go to, or as far as it goes.

    Returns:
        The posture reached, the part of the way, and why it ended, or an empty text.
    """
    try:
        return move(q, 1.0), 1.0, ""
    except HybridynError as error:
        stopped = str(error)
    reached, done, high = q, 0.0, 1.0
    for _ in range(HALVINGS):
        middle = (done + high) / 2
        try:
            reached, done = move(reached, middle), middle
        except HybridynError as error:
            high, stopped = middle, str(error)
    return reached, done, stopped


def independent(module: Module, joints: Sequence[str]) -> list[str]:
    """Choose joints with independent positions, in the given order, at a generic posture.

    Args:
        joints: Joints of its tree with one freedom each.

    Returns:
        The chosen joints, at most as many as the module has freedoms.
    """
    m = module.mechanism
    motion = m.tree.sweep(m.postures[:1])
    Psi = m.basis(m.closures.matrix(motion)).Psi[0] / m.reduction.col_scale[:, None]
    if not Psi.shape[1]:
        return []
    left = np.linalg.qr(Psi)[0]  # motions that no chosen joint determines
    tree = {source: i for i, source in enumerate(m.spec.tree_joint) if source is not None}
    chosen: list[str] = []
    for joint in joints:
        number = module.joints.index(joint)
        if number not in tree or len(chosen) == Psi.shape[1]:
            continue
        row = left[m.tree.v_slices[tree[number]].start]
        size = float(np.linalg.norm(row))
        if size > LEAST_SHARE:
            unit = row / size
            left = left - np.outer(left @ unit, unit)
            chosen.append(joint)
    return chosen
