"""Which modules a pose couples: those between the two links that what else is given leaves open."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from ...description.groups import Groups
from ...structure.robot import HybridRobot
from ..module_request import ModuleRequest, module_request
from ..poses import PoseRequest
from ..requests import Requests
from ..task import left_open
from .least import driven_alone

#: Modules with their body on the way from a link to the root, the outermost first.
Way = list[tuple[int, int]]


class CoupledModules(NamedTuple):
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


class _Passing(NamedTuple):
    """A pose and the modules that it passes.

    Attributes:
        pose: The pose.
        modules: Modules between its two links.
        beyond: Those of them that move the other link.
        owner: The module that moves its link in the body where both ways meet; -1 if none does.
        own: Whether it is relative to the base of that module.
    """

    pose: PoseRequest
    modules: frozenset[int]
    beyond: frozenset[int]
    owner: int
    own: bool

    def alone(self, robot: HybridRobot) -> PoseRequest | None:
        """Return the pose as one in the base of its link's module, if this module can meet it alone.

        Only what it determines is the same there.
        """
        if self.own:
            return self.pose
        if self.pose.motion is None or max(self.beyond, default=-1) >= self.owner:
            return None
        return self.pose._replace(other=robot.modules[self.owner].base, frame=None)


def own_requests(robot: HybridRobot, requests: Requests, chain: CoupledModules) -> list[ModuleRequest]:
    """Return what is given in each module of a chain alone, and not by the chain's poses."""
    rest = [one for one in _passing(robot, requests) if all(one.pose is not pose for pose in chain.poses)]
    own = [requests._replace(poses=_own_poses(rest, k)) for k in chain.modules]
    return [module_request(one, robot, k, {}) for k, one in zip(chain.modules, own, strict=True)]


def chains_of(robot: HybridRobot, requests: Requests) -> tuple[Requests, list[CoupledModules]]:
    """Return the requests that each module meets alone, and the chains that meet the other poses.

    A pose that determines what is open of its link's module is met by this module alone. Poses of a module
    alone that leave it freedoms of its motors are met by a chain of that module.
    """
    poses = _passing(robot, requests)
    still_open = _open_modules(robot, requests, poses)
    coupled = _coupled(robot, requests, poses, still_open)
    while True:
        members = frozenset[int]().union(*coupled)
        # A pose through a module of a chain belongs to it, also if its link's own module could meet it alone.
        grown = [
            now
            if one.own or not one.modules & members
            else (now or frozenset({one.owner})) | one.modules & members
            for one, now in zip(poses, coupled, strict=True)
        ]
        if grown == coupled:
            break
        coupled = grown
    groups: Groups[int] = Groups()
    for modules in coupled:
        groups.join_all(sorted(modules))
    chains = []
    for own in groups.classes(sorted(members)):
        met = (one.pose for one, modules in zip(poses, coupled, strict=True) if modules & {*own})
        chains.append(CoupledModules(tuple(own), tuple(met)))
    alone = [one for one, modules in zip(poses, coupled, strict=True) if not modules]
    for k in sorted(still_open - members):
        if (own_poses := _own_poses(alone, k)) and driven_alone(robot.modules[k]):
            chains.append(CoupledModules((k,), own_poses))
            alone = [one for one in alone if not (one.own and one.owner == k)]
    chains.sort(key=lambda chain: chain.modules)
    return requests._replace(poses=tuple(one.pose for one in alone)), chains


def _passing(robot: HybridRobot, requests: Requests) -> list[_Passing]:
    """Return the poses of requests, those nearer to the root first."""
    out = []
    for pose in requests.poses:
        ways = ways_between(robot, pose)
        link, other = (frozenset(k for k, _ in way) for way in ways)
        owner = ways[0][0][0] if ways[0] else -1
        out.append(_Passing(pose, link | other, other, owner, is_own(pose, ways)))
    return sorted(out, key=lambda one: one.owner)


def _own_poses(poses: Iterable[_Passing], number: int) -> tuple[PoseRequest, ...]:
    """Return those of some poses that are in the base of a module."""
    return tuple(one.pose for one in poses if one.own and one.owner == number)


def _open_modules(robot: HybridRobot, requests: Requests, poses: Sequence[_Passing]) -> set[int]:
    """Return the modules that poses pass, and that what is given in their own base leaves open."""
    still_open, known = set[int](), dict[object, bool]()
    for k in sorted(frozenset[int]().union(*(one.modules for one in poses))):
        module, request = robot.modules[k], _at_first(robot, requests, k, _own_poses(poses, k))
        equal = module.mechanism, tuple(module.motor_columns), tuple(request.given)
        kind = k if request.targets else equal
        if kind not in known:
            known[kind] = left_open(robot, module, request) > 0
        if known[kind]:
            still_open.add(k)
    return still_open


def _coupled(
    robot: HybridRobot, requests: Requests, poses: Sequence[_Passing], still_open: set[int]
) -> list[frozenset[int]]:
    """Return the modules that each pose couples; none where its link's own module meets it alone.

    Modules that are met alone by poses of other bases are taken from `still_open`.
    """
    out = list[frozenset[int]]()
    for one in poses:
        left, k = one.modules & still_open, one.owner
        alone = one.alone(robot) if left <= {k} else None
        if alone and left and not one.own:
            request = _at_first(robot, requests, k, (*_own_poses(poses, k), alone))
            alone = None if left_open(robot, robot.modules[k], request) > 0 else alone
        if one.own or alone:
            out.append(frozenset())
            still_open -= set() if one.own else {k}
        else:
            out.append(left or frozenset({max(one.modules)}))
    return out


def _at_first(
    robot: HybridRobot, requests: Requests, number: int, poses: Iterable[PoseRequest]
) -> ModuleRequest:
    """Return what is given in a module at the first sample: joints, and some poses in its base."""
    first = requests._replace(poses=tuple(poses)).part(0, 1)
    return module_request(first, robot, number, {})
