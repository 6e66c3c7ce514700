"""Make a tree with closures of bodies and joints that a file states in any order.

    tree = span(bodies, joints)            which joints carry bodies, and which close loops
    graph = JointGraph(robot, links, ...)  the record that they fill
    graph.fill(tree, poses, welds, ...)    the root link, joints of the tree as chains, others as closures

Bodies have keys; the key of the world is "".
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from ..spatial import quaternion_from_rotation
from .closure_forms import FORMS
from .groups import Groups
from .names import unique
from .placement import inverse, turned
from .records import Array, Closure, Joint, JointKind, Link, RotationKind
from .robot_file import RobotFile

#: Key of the world among those of bodies.
WORLD = ""

#: Largest distance from a body's origin at which an axis still passes through it, relative to its offset.
ON_AXIS = 4 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class StatedJoint:
    """A joint as a file states it.

    Attributes:
        name: Its name.
        ends: Keys of the two bodies that it joins; its position moves the second against the first.
        rank: Place in the order in which the tree takes joints, the least first.
        line: Line in the robot's file, or None.
        closes: Whether the file asks that it closes a loop.
        needed: Whether something needs its position: it stays a joint where it closes a loop.
    """

    name: str
    ends: tuple[str, str]
    rank: tuple[float, ...]
    line: int | None
    closes: bool
    needed: bool


J = TypeVar("J", bound=StatedJoint)


@dataclass(frozen=True)
class Tree(Generic[J]):
    """A spanning tree of every group of bodies that joints connect.

    Attributes:
        branches: The joints of the trees in the order of the file, each with whether its second body is the
            child.
        cut: The joints that close loops, in the order of the file.
        roots: The first body of each group without the world.
        held: Whether joints of the trees join bodies to the world.
    """

    branches: list[tuple[J, bool]]
    cut: list[J]
    roots: list[str]
    held: bool


def starts(bodies: Iterable[str], joints: Iterable[J], first: Collection[str]) -> list[str]:
    """Return the bodies in the order in which groups without the world start at them.

    Args:
        bodies: Keys of the bodies in the order of the file.
        joints: The joints; bodies that are never the second of one stand before others.
        first: Bodies that the file names as roots, which stand before all others.
    """
    seconds = {joint.ends[1] for joint in joints if not joint.closes}
    return sorted(bodies, key=lambda body: (body not in first, body in seconds))


def span(bodies: Iterable[str], joints: Sequence[J]) -> Tree[J]:
    """Return the spanning trees of bodies and joints.

    Args:
        bodies: Keys of the bodies, see `starts`; a group without the world starts at its first one.
        joints: The joints that connect them, in the order of the file.
    """
    groups: Groups[str] = Groups()
    kept = {joint for joint in sorted(joints, key=lambda joint: joint.rank) if groups.join(*joint.ends)}
    roots: list[str] = []
    directions: dict[J, bool] = {}
    for body, joint, _ in outwards((WORLD, *bodies), kept):
        if joint is None:
            roots.append(body)
        else:
            directions[joint] = joint.ends[1] == body
    branches = [(joint, directions[joint]) for joint in joints if joint in kept]
    held = any(WORLD in joint.ends for joint in kept)
    return Tree(branches, [joint for joint in joints if joint not in kept], roots[1:], held)


def outwards(bodies: Iterable[str], joints: Iterable[J]) -> Iterator[tuple[str, J | None, str]]:
    """Yield each body that joints reach, those near the first ones first.

    Args:
        bodies: The bodies from which it goes on, in order, unless an earlier one reached them.
        joints: The joints.

    Yields:
        A body, the joint that leads to it, and the body before; None and "" for one of `bodies`.
    """
    near: dict[str, list[tuple[str, J | None, str]]] = {}
    for joint in joints:
        first, second = joint.ends
        near.setdefault(first, []).append((second, joint, first))
        near.setdefault(second, []).append((first, joint, second))
    reached: set[str] = set()
    for start in bodies:
        waiting: list[tuple[str, J | None, str]] = [(start, None, "")]
        for body, joint_to, before in waiting:
            if body not in reached:
                reached.add(body)
                yield body, joint_to, before
                waiting += near.get(body, ())


@dataclass(frozen=True, eq=False)
class Step:
    """A joint of a chain.

    Attributes:
        name: Its name.
        kind: Its kind.
        axis: Unit vector in the frame of the stated joint, shape (3,); any where it has none.
        numbers: Limits, friction and rotor, as in `records.Joint`.
    """

    name: str
    kind: JointKind
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    numbers: Mapping[str, float] = field(default_factory=dict)


#: Joints from a parent link to a child link, and the stated joint's frame in both, shapes (4, 4).
Chain = tuple[Sequence[Step], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class Closing:
    """What a joint locks that closes a loop.

    Attributes:
        kind: The author's word for its kind.
        frames: Its frames in its two bodies, shapes (4, 4).
        translations, rotation: What it locks, as in `records.Closure`.
        turns: Axes of the closure's frames in those of the joint, shapes (3, 3).
    """

    kind: str
    frames: Sequence[Array]
    translations: tuple[int, ...]
    rotation: RotationKind
    turns: Sequence[Array]


@dataclass
class JointGraph:
    """The record of a robot whose joints become chains and closures.

    Attributes:
        robot: The record.
        links: Name of the link of each body by key, and of the world once it is chosen.
        joints: Taken names of joints.
        weld: Name of the fixed joint behind a chain, made of "{child}" and "{joint}".
    """

    robot: RobotFile
    links: dict[str, str]
    joints: set[str]
    weld: str

    def __post_init__(self) -> None:
        self._taken = set(self.links.values())

    def fill(
        self,
        tree: Tree[J],
        poses: Mapping[str, Array],
        welds: Iterable[J],
        chain: Callable[[J, bool], Chain],
        closing: Callable[[J], Closing],
    ) -> None:
        """Add the joints to the record, and choose its root.

        Args:
            tree: The tree.
            poses: Pose of each body in the world, shapes (4, 4).
            welds: Joints that hold a body with the frame of the world.
            chain: Returns a joint as a chain; its second argument says whether the second body is the child.
            closing: Returns what a joint locks.
        """
        for joint, forward in self._stand(tree, poses, welds):
            steps, frames = chain(joint, forward)
            self._carry(steps, self._ends(joint, forward), frames, joint, forward)
        for joint in tree.cut:
            if joint.needed:
                forward = joint.ends[1] != WORLD
                self._carry_and_weld(*chain(joint, forward), joint, forward)
            else:
                self._close(joint, closing(joint))

    def _stand(self, tree: Tree[J], poses: Mapping[str, Array], welds: Iterable[J]) -> list[tuple[J, bool]]:
        """Choose the root link, let bodies float that nothing holds, and return the joints that are left.

        A body is the root if everything hangs on it and nothing on the world, or if one of the joints that
        weld a body where the world is holds it, and no other body.
        """
        robot = self.robot
        if len(tree.roots) == 1 and not tree.held:
            robot.base, robot.base_home = "floating", pose_coordinates(poses[tree.roots[0]])
            return tree.branches
        held = [branch for branch in tree.branches if WORLD in branch[0].ends]
        if not tree.roots and len(held) == 1 and held[0][0] in {*welds}:
            first, second = held[0][0].ends
            self.links[WORLD] = self.links[first or second]
            return [branch for branch in tree.branches if branch is not held[0]]
        self.links[WORLD] = self._link("world", None, between=False)
        robot.links.insert(0, robot.links.pop())
        for root in tree.roots:
            name = self.joint_name(f"{self.links[root]}_free")
            robot.joints.append(_joint(Step(name, "floating"), self.links[WORLD], self.links[root], None))
            robot.home[name] = pose_coordinates(poses[root])
        return tree.branches

    def _ends(self, stated: StatedJoint, forward: bool) -> tuple[str, str]:
        """Return the names of a joint's parent and child link."""
        first, second = (self.links[end] for end in stated.ends)
        return (first, second) if forward else (second, first)

    def _carry(
        self,
        steps: Sequence[Step],
        ends: tuple[str, str],
        frames: tuple[Array, Array],
        stated: StatedJoint,
        forward: bool,
    ) -> None:
        """Add a joint of the tree as a chain of joints, with massless links between them.

        If an axis does not pass through the origin of the child link, the chain ends in a massless link at
        the joint, to which the child is welded.
        """
        (parent, child), (at, far) = ends, frames
        chain = [*steps] or [Step(stated.name, "fixed")]
        if steps and _misses(chain[-1], far):
            name = self.joint_name(self.weld.format(child=child, joint=chain[-1].name))
            chain.append(Step(name, "fixed"))
        for step in chain[:-1]:
            link = self._link(f"{child}_{step.name}", stated.line)
            self.robot.joints.append(_joint(step, parent, link, stated.line, at, forward=forward))
            parent, at = link, np.eye(4)
        self.robot.joints.append(_joint(chain[-1], parent, child, stated.line, at, far, forward))

    def _close(self, stated: StatedJoint, closing: Closing) -> None:
        """Add a joint as a closure."""
        (link_a, link_b), (first, second) = self._ends(stated, True), closing.turns
        frame_a, frame_b = closing.frames
        self.robot.closures.append(Closure(
            stated.name, closing.kind, link_a, turned(frame_a, first), link_b, turned(frame_b, second),
            closing.translations, closing.rotation, stated.line, first,
        ))  # fmt: skip

    def _carry_and_weld(
        self, steps: Sequence[Step], frames: tuple[Array, Array], stated: StatedJoint, forward: bool
    ) -> None:
        """Add a joint whose position is needed and that closes a loop: its massless child is welded on."""
        parent, child = self._ends(stated, forward)
        name = unique(f"{child}_at_{stated.name}", self._taken)
        self._carry(steps, (parent, name), frames, stated, forward)
        self._massless(name, stated.line)
        taken = {closure.name for closure in self.robot.closures}
        self.robot.closures.append(Closure(
            unique(f"{stated.name}_closure", taken), "fixed", name, np.eye(4), child, np.eye(4),
            FORMS["fixed"].translations, FORMS["fixed"].rotation, stated.line,
        ))  # fmt: skip

    def joint_name(self, name: str) -> str:
        """Return a name for a joint that none has, and take it."""
        return unique(name, self.joints)

    def _link(self, name: str, line: int | None, *, between: bool = True) -> str:
        """Add a massless link, and return its name, which none has."""
        out = unique(name, self._taken)
        self._massless(out, line, between=between)
        return out

    def _massless(self, name: str, line: int | None, *, between: bool = True) -> None:
        self.robot.links.append(Link(name, 0.0, np.zeros(3), np.zeros((3, 3)), line, between))


def pose_coordinates(frame: Array) -> tuple[float, ...]:
    """Return x, y, z [m] and the quaternion x, y, z, w of a placement (4, 4), shape (7,)."""
    return tuple(float(x) for x in (*frame[:3, 3], *quaternion_from_rotation(frame[:3, :3])))


def _misses(step: Step, far: Array) -> bool:
    """Return whether the motion of a joint is no motion about or along the origin of its child."""
    offset = far[:3, 3]
    if not offset.any() or step.kind == "prismatic":
        return False
    axis = far[:3, :3] @ step.axis
    across = offset - axis * (axis @ offset)
    return step.kind == "spherical" or bool(np.abs(across).max() > ON_AXIS * np.abs(offset).max())


def _joint(
    step: Step,
    parent: str,
    child: str,
    line: int | None,
    at: Array | None = None,
    far: Array | None = None,
    forward: bool = True,
) -> Joint:
    """Return the record of a step; `at` and `far` are the stated joint's frames in its links."""
    at, far = (np.eye(4) if frame is None else frame for frame in (at, far))
    bare = step.kind in ("fixed", "floating", "spherical")
    axis = step.axis if bare else far[:3, :3] @ step.axis * (1.0 if forward else -1.0)
    return Joint(step.name, step.kind, parent, child, at @ inverse(far), axis, line=line, **step.numbers)
