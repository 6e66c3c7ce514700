"""Which modules a pose couples: those between the two links that what else is given leaves open."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import NamedTuple

from ...description.groups import Groups
from ...errors import AssemblyError
from ...structure.robot import HybridRobot
from ..module_request import module_request
from ..poses import PoseRequest
from ..requests import Requests
from ..task import module_task

#: Modules with their body on the way from a link to the root, the outermost first.
Way = list[tuple[int, int]]


class Chain(NamedTuple):
    """Modules that are assembled together, and the poses that couple them.

    Attributes:
        modules: Numbers of the modules, those nearer to the root first.
        poses: The poses.
    """

    modules: tuple[int, ...]
    poses: tuple[PoseRequest, ...]


def way_to_root(robot: HybridRobot, body: int) -> Way:
    """Return the modules that move a body, with the body of each that carries the rest of the way."""
    out = []
    first = 1 if robot.base == "floating" else 0
    while (owner := robot.body_owner[body])[0] >= first:
        out.append(owner)
        body = robot.bodies.place[robot.modules[owner[0]].base][0]
    return out


def ways_between(robot: HybridRobot, pose: PoseRequest) -> tuple[Way, Way]:
    """Return the ways from the link of a pose, and from its other link, to where they meet."""
    link, other = (way_to_root(robot, robot.bodies.place[x][0]) for x in (pose.link, pose.other))
    while link and other and link[-1] == other[-1]:
        link, other = link[:-1], other[:-1]
    return link, other


def is_own(pose: PoseRequest, ways: tuple[Way, Way]) -> bool:
    """Return whether a pose is that of a link in the base of the link's own module."""
    return pose.frame is None and len(ways[0]) == 1 and not ways[1]


def own_request(robot: HybridRobot, requests: Requests, number: int) -> Requests:
    """Return the requests with those poses of a module alone that are in its own base."""
    poses = [
        pose
        for pose in requests.poses
        if is_own(pose, ways := ways_between(robot, pose)) and ways[0][0][0] == number
    ]
    return requests._replace(poses=tuple(poses))


def chains_of(robot: HybridRobot, requests: Requests) -> tuple[Requests, list[Chain]]:
    """Return the requests that each module meets alone, and the chains that meet the other poses.

    A whole pose of a link whose own module alone is open is met by that module alone.
    """
    known = [(ways_between(robot, pose), pose) for pose in requests.poses]
    if all(is_own(pose, way) for way, pose in known):
        return requests, []
    known.sort(key=lambda pair: pair[0][0][0][0] if pair[0][0] else -1)  # the poses nearer to the root first
    ways, poses = [way for way, _ in known], [pose for _, pose in known]
    own = [is_own(pose, way) for way, pose in known]
    between = {k for way, alone in zip(ways, own, strict=True) if not alone for side in way for k, _ in side}
    still_open = {k for k in between if not _is_determined(robot, requests, k)}
    coupled: list[set[int]] = []
    for (way, pose), meets in zip(known, own, strict=True):
        coupled.append(set() if meets else _coupled(way, pose, still_open))
        if not (coupled[-1] or meets):
            still_open.discard(way[0][0][0])
    passed = [
        set() if meets else {k for side in way for k, _ in side} for way, meets in zip(ways, own, strict=True)
    ]
    groups: Groups[int] = Groups()
    members, wanted = set[int](), coupled
    while True:
        for modules in wanted:
            groups.join_all(sorted(modules))
            members |= modules
        # A pose through a module of a chain belongs to it, also if its link's own module could meet it alone.
        grown = [
            one | (modules & members) | ({way[0][0][0]} if modules & members and not one else set())
            for one, modules, way in zip(coupled, passed, ways, strict=True)
        ]
        if grown == wanted:
            break
        wanted = grown
    alone = tuple(pose for pose, modules in zip(poses, wanted, strict=True) if not modules)
    chains = [
        Chain(tuple(modules), tuple(_within(modules, poses, wanted)))
        for modules in groups.classes(sorted(members))
    ]
    return requests._replace(poses=alone), chains


def _coupled(ways: tuple[Way, Way], pose: PoseRequest, still_open: Collection[int]) -> set[int]:
    """Return the modules that a pose couples; none where the link's own module meets it alone."""
    link, other = ({k for k, _ in way} for way in ways)
    left = (link | other) & set(still_open)
    owner = ways[0][0][0] if ways[0] else -1
    if pose.motion is not None and left <= {owner} and owner not in other and max(other, default=-1) < owner:
        return set()
    return left or {max(link | other)}


def _within(
    modules: Iterable[int], poses: Iterable[PoseRequest], wanted: Iterable[set[int]]
) -> Iterable[PoseRequest]:
    """Return the poses that couple some modules."""
    return (pose for pose, coupled in zip(poses, wanted, strict=True) if coupled & set(modules))


def _is_determined(robot: HybridRobot, requests: Requests, number: int) -> bool:
    """Return whether what is given in a module's own base determines its posture."""
    request = module_request(own_request(robot, requests, number), robot, number, {})
    try:
        module_task(robot, robot.modules[number], request)
    except AssemblyError:
        return False
    return True
