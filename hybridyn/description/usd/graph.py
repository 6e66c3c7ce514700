"""Choose the spanning tree of a USD robot: which joints carry bodies, and which close loops.

A joint that USD excludes from the articulation closes a loop, unless bodies would hang on nothing without it.
Where joints close loops without this flag, those are cut that need the least of a tree: neither driven nor
coupled, without armature, friction and limits, ball joints first, far from the root first.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Hashable, Iterable
from dataclasses import dataclass

from ..groups import Groups
from ..names import listed
from .joints import UsdJoint
from .screening import weighs
from .stage import Prim

#: Path of the world among those of bodies.
WORLD = ""


@dataclass(frozen=True)
class Tree:
    """A spanning tree, with the joints that close loops.

    Attributes:
        joints: The joints of the tree, each with whether its second body is the child.
        closures: The joints that close loops.
        roots: Paths of the bodies from which trees grow that no joint ties to the world.
        parents: Path of the parent of each body that a joint carries.
    """

    joints: list[tuple[UsdJoint, bool]]
    closures: list[UsdJoint]
    roots: list[str]
    parents: dict[str, str]


def grow(bodies: Iterable[Prim], joints: list[UsdJoint], bound: Collection[str], notes: list[str]) -> Tree:
    """Return the spanning tree.

    Args:
        bound: Paths of joints that must be in the tree if possible: driven and coupled ones.
        notes: Remarks for the user, to which the choice is added.

    Raises:
        ModelError: A joint of the tree is one that only closes loops here.
    """
    parts: Groups[str] = Groups()
    chosen: Groups[str] = Groups()
    for joint in joints:
        parts.join(*joint.ends)
    roots = _roots(list(bodies), joints, parts)
    depths = _depths([WORLD, *roots], joints)

    def rank(joint: UsdJoint) -> tuple[bool, bool, bool, bool, bool, int]:
        """Return the key of a joint in the order in which the tree takes joints."""
        return (
            joint.prim.path not in bound,
            joint.excluded,
            not weighs(joint.prim),
            joint.is_ball,
            _only_closes(joint),
            sum(depths[end] for end in joint.ends),
        )

    carrying = {joint for joint in sorted(joints, key=rank) if chosen.join(*joint.ends)}
    directions, parents = _outwards([WORLD, *roots], [joint for joint in joints if joint in carrying])
    for joint in carrying:
        if _only_closes(joint):
            raise joint.prim.error(
                "this joint can only close a loop here, but its bodies hang on nothing else; write two "
                "revolute joints with a small body between them"
            )
    closures = [joint for joint in joints if joint not in carrying]
    _note(joints, closures, notes)
    return Tree(
        [(joint, directions[joint]) for joint in joints if joint in carrying], closures, roots, parents
    )


def _only_closes(joint: UsdJoint) -> bool:
    return sum(axis.startswith("rot") for axis in joint.free) == 2


def _note(joints: list[UsdJoint], closures: list[UsdJoint], notes: list[str]) -> None:
    """Add remarks where the cuts are not those of the file."""
    own = [joint.prim.path for joint in closures if not joint.excluded]
    if own:
        notes.append(
            f"joints {listed(own)} close loops and are cut there; to cut other joints, set "
            "physics:excludeFromArticulation = true on those"
        )
    kept = [joint.prim.path for joint in joints if joint.excluded and joint not in closures]
    if kept:
        notes.append(
            f"joints {listed(kept)} are excluded from the articulation, but are driven or coupled, or are "
            "the only joint of a body: they are joints of the tree"
        )


def _roots(bodies: list[Prim], joints: list[UsdJoint], parts: Groups[str]) -> list[str]:
    """Return the root of every part that no joint ties to the world.

    It is the body with ArticulationRootAPI, else the only body that is never the second of a joint, else the
    first in the file.
    """
    seconds = {joint.ends[1] for joint in joints if not joint.excluded}
    groups: dict[Hashable, list[Prim]] = {}
    for body in bodies:
        if parts.of(body.path) != parts.of(WORLD):
            groups.setdefault(parts.of(body.path), []).append(body)
    out = []
    for group in groups.values():
        named = [body for body in group if body.has("PhysicsArticulationRootAPI")]
        firsts = [body for body in group if body.path not in seconds]
        out.append((named or (firsts if len(firsts) == 1 else group))[0].path)
    return out


def _neighbours(joints: Iterable[UsdJoint]) -> dict[str, list[tuple[UsdJoint, str]]]:
    out: dict[str, list[tuple[UsdJoint, str]]] = {}
    for joint in joints:
        first, second = joint.ends
        out.setdefault(first, []).append((joint, second))
        out.setdefault(second, []).append((joint, first))
    return out


def _depths(roots: list[str], joints: Iterable[UsdJoint]) -> dict[str, int]:
    """Return how many joints lie between each body and its root."""
    near = _neighbours(joints)
    out, waiting = dict.fromkeys(roots, 0), deque(roots)
    while waiting:
        body = waiting.popleft()
        for _, other in near.get(body, ()):
            if other not in out:
                out[other] = out[body] + 1
                waiting.append(other)
    return out


def _outwards(roots: list[str], joints: list[UsdJoint]) -> tuple[dict[UsdJoint, bool], dict[str, str]]:
    """Return whether the second body of each joint is the child, and the parent of each body."""
    near = _neighbours(joints)
    directions: dict[UsdJoint, bool] = {}
    parents: dict[str, str] = {}
    reached, waiting = set(roots), deque(roots)
    while waiting:
        body = waiting.popleft()
        for joint, other in near.get(body, ()):
            if other not in reached:
                reached.add(other)
                directions[joint] = joint.ends[1] == other
                parents[other] = body
                waiting.append(other)
    return directions, parents
