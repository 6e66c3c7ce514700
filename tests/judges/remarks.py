"""What looks wrong in a robot in memory, as `hybridyn info` says it of the robot's files."""

from hybridyn import HybridRobot
from hybridyn.description.urdf.xml_node import parse
from hybridyn.loading import of_files
from hybridyn.studies.check.finding import Finding
from hybridyn.studies.check.loops import check_modules
from hybridyn.studies.check.subject import Subject

#: Findings about modules that are more than notes on redundant closures, motors and motions.
SAID = (
    "open-at-home", "singular-closures", "singular-parallel", "architectural", "motor-cannot-move",
    "massless-motion", "no-mass",
)  # fmt: skip


def module_findings(robot: HybridRobot) -> list[Finding]:
    """Return what looks wrong in the modules of a robot, without lines of its files."""
    subject = Subject(parse(b"<robot/>", ""), robot.description, robot=robot)
    return [found for found in check_modules(subject) if found.code in SAID]


def findings(robot: HybridRobot) -> list[str]:
    """Return what looks wrong in a robot, one sentence per finding, the reader's notes first."""
    found = [f"{one.element}: {one.message}; {one.mend}" for one in module_findings(robot)]
    return [*robot.notes, *of_files(robot.description), *found]
