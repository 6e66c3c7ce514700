"""Which modules a closing program closes: each alone, or coupled by poses; what requests ask of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ....assembly.module_request import ModuleRequest
from ....assembly.requests import Requests
from ....assembly.task import module_task
from ....structure.robot import HybridRobot
from .coupled import Coupled, Split, coupled_of
from .given import given_of
from .module_parts import CONTRADICTING_FILE, MOST_FREEDOMS, Part
from .own_requests import module_requests, modules_of


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


def parts_of(
    robot: HybridRobot, wanted: list[ModuleRequest], coupled: Sequence[Coupled] = ()
) -> list[Part] | None:
    """Return the parts of a closing program; None if the general path must close the loops.

    Of motions that are left to the least norm, kernels know idle ones alone. They do not average loops that
    contradict each other by a file's rounding.

    Args:
        wanted: What is asked of each module alone.
        coupled: Those of them that poses couple.

    Raises:
        AssemblyError: What is given does not determine the posture of a module.
    """
    from ...equations.idle.motion import left_open

    parts: list[Part] = []
    carrying = {part: one.ports(i) for one in coupled for i, part in enumerate(one.parts)}
    for (_, module), request in zip(modules_of(robot), wanted, strict=True):
        given, m, number = given_of(request), module.mechanism, len(parts)
        task = module_task(robot, module, request, alone=number not in carrying)
        free = int(task.problem.free.sum())
        idle = left_open(module, task.problem) if task.problem.rank != free else ()
        if number in carrying:
            idle = tuple(motion for motion in idle if not motion.moves(m.tree, carrying[number]))
        elif task.problem.rank != free - len(idle):
            return None
        if free > MOST_FREEDOMS or m.rounding > CONTRADICTING_FILE:
            return None
        parts.append(Part(module, given, tuple(task.problem.blocks), idle))
    return parts if coupled or sum(part.given.rates for part in parts) else None
