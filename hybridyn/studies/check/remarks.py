"""What looks wrong in a robot that was built, in sentences: for `hybridyn info`, and beside results."""

from __future__ import annotations

from ...assembly.free_motions import free_motions
from ...description.names import listed
from ...description.urdf.xml_node import parse
from ...loading import of_files
from ...structure.robot import HybridRobot
from .finding import Finding
from .loops import check_modules
from .subject import Subject

#: Findings about modules of which `info` speaks; it shows the others beside the modules.
SAID = (
    "open-at-home", "singular-closures", "singular-parallel", "architectural", "motor-cannot-move",
    "massless-motion", "no-mass",
)  # fmt: skip


def module_findings(robot: HybridRobot) -> list[Finding]:
    """Return what looks wrong in the modules of a robot, without lines of its files."""
    nowhere = parse(b"<robot/>", robot.description.source or "")
    subject = Subject(nowhere, robot.description, robot=robot)
    return [found for found in check_modules(subject) if found.code in SAID]


def findings(robot: HybridRobot) -> list[str]:
    """Return what looks wrong in a robot, one sentence per finding, the reader's notes first."""
    found = [f"{one.element}: {one.message}; {one.mend}" for one in module_findings(robot)]
    return [*robot.notes, *of_files(robot.description), *found]


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
