"""Motions that no motor drives or that have no inertia, in sentences, beside results."""

from __future__ import annotations

from ...assembly.free_motions import free_motions
from ...description.names import listed
from ...structure.robot import HybridRobot


def free_motions_of(robot: HybridRobot) -> list[str]:
    """Describe the motions of a robot that lack a motor or inertia, one sentence per kind.

    Args:
        robot: The robot; the motion of its free base is left out.
    """
    found: dict[str, list[str]] = {"uncontrolled": [], "idle": [], "massless": []}
    for module in robot.modules[robot.base == "floating" :]:
        free = free_motions(module)
        for kind, names in found.items():
            names += getattr(free, kind)
    sentences = {
        "uncontrolled": "no motor drives the motion of {}",
        "idle": "idle, it moves no output and no centre of mass: the motion of {}",
        "massless": "the motion of {} has no inertia",
    }
    return [
        sentences[kind].format(listed(dict.fromkeys(names)).replace("'", ""))
        for kind, names in found.items()
        if names
    ]
