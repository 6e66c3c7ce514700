"""Check a robot's files. Each finding names its place and how to mend it.

    finding       one finding; every code with its severity
    subject       the file as XML, as records and as a robot
    shapes        bounding boxes of the links, from visuals, collisions and meshes
    masses, elements, meshes   the checks of links, of joints, of shapes
    axes, loops                those of hinges in loops, and of modules
    reader_said   what the readers and the build of a robot say

`hybridyn.check("robot.urdf")` returns all findings, the worst first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from typing import Any

import numpy as np

from ...description import read
from ...description.reading import open_robot
from ...description.shipped import find_robot
from ...errors import HybridynError, ModelError
from ...structure.building import build_robot
from ...structure.robot import HybridRobot
from .axes import check_axes, check_same_loops
from .elements import check_limits, check_mimics, check_units
from .finding import CODES, SEVERITIES, Finding, Severity
from .loops import check_dangling_chains, check_lost_loops, check_modules
from .masses import check_masses
from .meshes import check_shapes
from .reader_said import check_notes, not_built, unreadable
from .shapes import read_shapes
from .subject import Subject

__all__ = ["CODES", "SEVERITIES", "Finding", "Severity", "check", "is_readable"]

CHECKS = (
    check_masses, check_units, check_limits, check_mimics, check_notes, check_shapes,
    check_lost_loops, check_dangling_chains, check_axes, check_same_loops, check_modules,
)  # fmt: skip


def check(
    path: str | PathLike[str], robot: HybridRobot | None = None, *, motors: Sequence[str] | None = None,
    xacro_args: Mapping[str, str] | None = None, package_dirs: Sequence[str | PathLike[str]] = (),
    rank_tolerance: float | None = None, closure_tolerance: float = 1e-4, meshes: bool = True,
) -> list[Finding]:  # fmt: skip
    """Check a robot's files and return the findings, the worst first.

    Whatever the files contain, no error is raised.

    Args:
        path: The robot's file, or the name of a shipped robot.
        robot: The robot as loaded from the files with the options below; by default it is built.
        motors: Names of the driven joints, instead of those that the files state.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `$(find package)` and `package://` search.
        rank_tolerance: As for `hybridyn.load`, like the next.
        meshes: Whether mesh files are searched for and loaded.

    Returns:
        The findings; an empty list if there are none. If the file cannot be read, only the reasons.

    Example:
        >>> [finding.code for finding in hybridyn.check("five_bar") if finding.severity == "error"]
        []
    """
    try:
        file = find_robot(path)
        root = open_robot(file, xacro_args, package_dirs)
    except ModelError as error:
        return [unreadable(error, fspath(path))]
    if robot is not None:
        description = robot.description
    else:
        try:
            description = read(file, motors=motors, xacro_args=xacro_args, package_dirs=package_dirs)
        except HybridynError as error:
            return [unreadable(error, file)]
    found = list[Finding]()
    with np.errstate(all="ignore"):  # overflow and underflow are findings, not NumPy warnings
        subject = Subject(root, description, read_shapes(root, package_dirs, meshes=meshes), robot)
        if robot is None:
            found += _build(subject, rank_tolerance, closure_tolerance)
        found += [finding for run_check in CHECKS for finding in run_check(subject)]
    return sorted(found, key=lambda finding: (SEVERITIES.index(finding.severity), finding.line or 0))


def _build(subject: Subject, rank_tolerance: float | None, closure_tolerance: float) -> list[Finding]:
    """Build the robot of the records, or say why there is none."""
    tolerances: dict[str, Any] = {"rank_tolerance": rank_tolerance, "closure_tolerance": closure_tolerance}
    try:
        subject.robot = build_robot(subject.description, **tolerances)
    except HybridynError as error:
        return [not_built(subject, error)]
    return []


def is_readable(findings: Sequence[Finding]) -> bool:
    """Return whether the file of these findings could be read."""
    return not any(finding.code == "unreadable" for finding in findings)
