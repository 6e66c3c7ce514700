"""Which modules a closing program closes: each alone, or coupled by poses; what requests ask of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ....assembly.module_request import ModuleRequest
from ....assembly.requests import Requests
from ....structure.robot import HybridRobot
from .coupled import Coupled, Split, coupled_of
from .given import Part, module_requests, parts_of


class Wanted(NamedTuple):
    """What requests ask.

    Attributes:
        requests: All requests.
        own: What is asked of each module alone.
        chains: Modules that other poses couple, and the numbers of these.
    """

    requests: Requests
    own: list[ModuleRequest]
    chains: Sequence[tuple[tuple[int, ...], tuple[int, ...]]]


def wanted_of(robot: HybridRobot, requests: Requests, split: Split) -> Wanted | None:
    """Return what is asked of the modules; None if a module alone needs the posture of another one.

    Raises:
        HybridynError: As in `module_requests`.
    """
    alone, chains = split
    own = module_requests(robot, requests._replace(poses=tuple(requests.poses[i] for i in alone)))
    return None if own is None else Wanted(requests, own, chains)


def members_of(robot: HybridRobot, wanted: Wanted) -> tuple[list[Part], list[Coupled]] | None:
    """Return the parts of a closing program, and those that poses couple; None for the general path.

    Raises:
        AssemblyError: What is given does not determine the posture, or modules cannot move it.
    """
    coupled = list[Coupled]()
    for modules, poses in wanted.chains:
        one = coupled_of(robot, wanted.requests, modules, poses, wanted.own)
        if one is None:
            return None
        if any(set(one.parts) & set(other.parts) for other in coupled):
            return None
        coupled.append(one)
    parts = parts_of(robot, wanted.own, coupled)
    return None if parts is None else (parts, coupled)
