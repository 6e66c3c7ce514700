"""Which joints of an SDF file make the tree, and which close loops.

Joints that only hold (balls first) are cut before joints with limits, those before joints with springs,
damping, motors or couplings, fixed joints last. Among equals the later one is cut, and a joint whose child
hangs on another joint already.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from ..groups import Groups
from .joints import Stated
from .scopes import Item

#: Importance from which a joint keeps its position: a loop is cut beside it, not at it.
KEPT = 4


@dataclass(frozen=True)
class Branch:
    """A joint of the tree.

    Attributes:
        forward: Whether its parent link is nearer to the root than its child link.
    """

    joint: Stated
    forward: bool

    @property
    def above(self) -> Item | None:
        """The link nearer to the root, None for the world."""
        return self.joint.parent if self.forward else self.joint.child

    @property
    def below(self) -> Item | None:
        """The link farther from the root."""
        return self.joint.child if self.forward else self.joint.parent


@dataclass(frozen=True)
class Tree:
    """A spanning tree of every group of links that joints connect.

    Attributes:
        roots: The first link of each group, None (the world) first if joints join links to it.
        branches: The joints of the trees, in the order of the file.
        cut: The other joints, in the order of the file.
    """

    roots: list[Item | None]
    branches: list[Branch]
    cut: list[Stated]


def importance(joint: Stated, named: Collection[Item]) -> int:
    """Return how much would be lost if a joint were only a closure."""
    if joint.kind == "fixed":
        return KEPT + 1
    moved = any(axis.forceful or axis.mimic or axis.initial is not None for axis in joint.axes)
    if joint.kind == "screw" or moved or joint.rotor_inertia or joint.item in named:
        return KEPT
    if any(axis.limited for axis in joint.axes):
        return 3
    return 1 if joint.kind == "ball" else 2


def span(links: Iterable[Item], joints: list[Stated], named: Collection[Item], first: Item | None) -> Tree:
    """Return the spanning trees of links and joints.

    Args:
        links: Every link, in the order of the file.
        joints: Every joint that connects links, in the order of the file.
        named: Joints that motors and couplings name.
        first: The link at which a group without the world starts, or None for one without a parent joint.
    """
    ranks: dict[tuple[bool, int], list[int]] = {}
    for number, joint in enumerate(joints):
        ranks.setdefault((joint.cut, -importance(joint, named)), []).append(number)
    groups: Groups[Item | None] = Groups()
    kept: set[int] = set()
    parented: set[Item | None] = {None}
    for rank in sorted(ranks):
        for either in (False, True):
            for number in ranks[rank]:
                joint = joints[number]
                if (either or joint.child not in parented) and groups.join(joint.parent, joint.child):
                    kept.add(number)
                    parented.add(joint.child)
    around: dict[Item | None, list[tuple[int, Item | None]]] = {}
    for number in sorted(kept):
        joint = joints[number]
        around.setdefault(joint.parent, []).append((number, joint.child))
        around.setdefault(joint.child, []).append((number, joint.parent))
    roots: list[Item | None] = [None] if None in around else []
    forward: dict[int, bool] = {}
    reached: set[Item | None] = set()
    _reach(None, around, joints, reached, forward)
    every = list(links)
    starts = ([first] if first is not None else []) + [link for link in every if link not in parented] + every
    for link in starts:
        if link not in reached:
            roots.append(link)
            _reach(link, around, joints, reached, forward)
    branches = [Branch(joints[number], forward[number]) for number in sorted(kept)]
    return Tree(roots, branches, [joint for n, joint in enumerate(joints) if n not in kept])


def _reach(
    start: Item | None,
    around: dict[Item | None, list[tuple[int, Item | None]]],
    joints: list[Stated],
    reached: set[Item | None],
    forward: dict[int, bool],
) -> None:
    """Walk from a root over the joints of its tree, and record their directions."""
    waiting = [start]
    reached.add(start)
    while waiting:
        link = waiting.pop()
        for number, other in around.get(link, ()):
            if other not in reached:
                reached.add(other)
                forward[number] = joints[number].parent is link
                waiting.append(other)
