"""Make a tree with closures of bodies and joints that a file states in any order.

    tree = span(bodies, joints)            which joints carry bodies, and which close loops
    graph = JointGraph(robot, links, ...)  the record that they fill
    graph.fill(tree, poses, welds, ...)    the root link, joints of the tree as chains, others as closures

Bodies have keys; the key of the world is "".
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from ..joints.kinds import JointKind
from .closure_forms import closure_of
from .groups import Groups
from .joint_chains import add_chain, pose_coordinates, step
from .names import unique
from .placement import inverse
from .records import Array, Closure, Joint, RobotFile, massless

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
class GraphTree(Generic[J]):
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


def span(bodies: Iterable[str], joints: Sequence[J]) -> GraphTree[J]:
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
    return GraphTree(branches, [joint for joint in joints if joint not in kept], roots[1:], held)


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


#: Joints from a parent link to a child link, without links, whose axes are in the frame of the stated joint
#: (any axis where a joint has none), and this frame in both links, shapes (4, 4).
Chain = tuple[Sequence[Joint], tuple[Array, Array]]


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
        tree: GraphTree[J],
        poses: Mapping[str, Array],
        welds: Iterable[J],
        chain: Callable[[J, bool], Chain],
        closing: Callable[[J, tuple[str, str]], Closure],
    ) -> None:
        """Add the joints to the record, and choose its root.

        Args:
            tree: The tree.
            poses: Pose of each body in the world, shapes (4, 4).
            welds: Joints that hold a body with the frame of the world.
            chain: Returns a joint as a chain; its second argument says whether the second body is the child.
            closing: Returns a joint as a closure between links of these names.
        """
        for joint, forward in self._stand(tree, poses, welds):
            self._carry(joint, forward, *chain(joint, forward), *self._ends(joint, forward))
        for joint in tree.cut:
            if joint.needed:
                forward = joint.ends[1] != WORLD
                self._carry_and_weld(joint, forward, *chain(joint, forward))
            else:
                self.robot.closures.append(closing(joint, self._ends(joint, True)))

    def _stand(
        self, tree: GraphTree[J], poses: Mapping[str, Array], welds: Iterable[J]
    ) -> list[tuple[J, bool]]:
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
        self.links[WORLD] = unique("world", self._taken)
        robot.links.insert(0, massless(self.links[WORLD]))
        for root in tree.roots:
            name = self.joint_name(f"{self.links[root]}_free")
            add_chain(robot, [step(name, JointKind.FLOATING)], [self.links[WORLD], self.links[root]])
            robot.home[name] = pose_coordinates(poses[root])
        return tree.branches

    def _ends(self, stated: StatedJoint, forward: bool) -> tuple[str, str]:
        """Return the names of a joint's parent and child link."""
        first, second = (self.links[end] for end in stated.ends)
        return (first, second) if forward else (second, first)

    def _carry(
        self,
        stated: StatedJoint,
        forward: bool,
        steps: Sequence[Joint],
        frames: tuple[Array, Array],
        parent: str,
        child: str,
    ) -> None:
        """Add a joint of the tree as a chain of joints, with massless links between them.

        If an axis does not pass through the origin of the child link, the chain ends in a massless link at
        the joint, to which the child is welded.
        """
        chain, (at, far) = [*steps] or [step(stated.name, JointKind.FIXED)], frames
        if steps and _misses(chain[-1], far):
            chain.append(
                step(self.joint_name(self.weld.format(child=child, joint=chain[-1].name)), JointKind.FIXED)
            )
        places, turns = [np.eye(4)] * len(chain), [np.eye(3)] * len(chain)
        places[-1], turns[-1] = inverse(far), far[:3, :3]
        places[0] = at @ places[0]
        sign = 1.0 if forward else -1.0
        chain = [
            replace(
                one,
                line=stated.line,
                placement=place,
                axis=turn @ one.axis * sign if one.kind.single else one.axis,
            )
            for one, place, turn in zip(chain, places, turns, strict=True)
        ]
        between = [unique(f"{child}_{one.name}", self._taken) for one in chain[:-1]]
        add_chain(self.robot, chain, [parent, *between, child])

    def _carry_and_weld(
        self, stated: StatedJoint, forward: bool, steps: Sequence[Joint], frames: tuple[Array, Array]
    ) -> None:
        """Add a joint whose position is needed and that closes a loop: its massless child is welded on."""
        parent, child = self._ends(stated, forward)
        name = unique(f"{child}_at_{stated.name}", self._taken)
        self._carry(stated, forward, steps, frames, parent, name)
        self.robot.links.append(massless(name, stated.line, between=True))
        taken = {closure.name for closure in self.robot.closures}
        sides = (name, np.eye(4)), (child, np.eye(4))
        own = unique(f"{stated.name}_closure", taken)
        self.robot.closures.append(closure_of(own, "fixed", sides, line=stated.line))

    def joint_name(self, name: str) -> str:
        """Return a name for a joint that none has, and take it."""
        return unique(name, self.joints)


def _misses(step: Joint, far: Array) -> bool:
    """Return whether the motion of a joint is no motion about or along the origin of its child."""
    offset = far[:3, 3]
    if not offset.any() or step.kind.slides:
        return False
    axis = far[:3, :3] @ step.axis
    across = offset - axis * (axis @ offset)
    return step.kind.ball or bool(np.abs(across).max() > ON_AXIS * np.abs(offset).max())
