"""Check a robot's files. Each finding names its place and how to mend it.

    finding       one finding; every code with its severity
    subject       the file as XML, as records and as a robot
    shapes        bounding boxes of the links, from visuals, collisions and meshes
    meshes        mesh files that MJCF and SDF name
    masses, units, limits, couplings, names, loops      the checks of one topic each

`hybridyn.check("robot.urdf")` returns all findings, the worst first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from os import PathLike, fspath

import numpy as np

from ...description import Description, read
from ...description.reading import open_robot
from ...description.urdf.xml_node import Node
from ...errors import AssemblyError, HybridynError, ModelError
from ...structure.building import build_robot
from ...structure.robot import HybridRobot
from .couplings import check_couplings
from .finding import CODES, SEVERITIES, Finding, Severity, worst
from .limits import check_limits
from .loops import check_branch, check_dangling_chains, check_lost_loops, check_modules
from .masses import check_masses
from .meshes import check_meshes
from .names import check_names, check_shapes, duplicated_names
from .places import Places
from .shapes import read_shapes
from .subject import Subject
from .units import check_units

__all__ = ["CODES", "SEVERITIES", "Finding", "Severity", "check", "is_readable", "worst"]

UNREADABLE = ("unreadable", "duplicate-name")


def check(
    path: str | PathLike[str],
    *,
    motors: Sequence[str] | None = None,
    xacro_args: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    meshes: bool = True,
) -> list[Finding]:
    """Check a robot's files and return the findings, the worst first.

    Whatever the files contain, no error is raised.

    Args:
        path: The robot's file, or the name of a shipped robot.
        motors: Names of the driven joints, instead of those that the files state.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `$(find package)` and `package://` search.
        rank_tolerance: As for `hybridyn.load`.
        closure_tolerance: As for `hybridyn.load`.
        meshes: Whether mesh files are searched for and loaded.

    Returns:
        The findings; an empty list if there are none. If the file cannot be read, only the reasons.
    """
    return findings(
        path, None, motors=motors, xacro_args=xacro_args, package_dirs=package_dirs,
        rank_tolerance=rank_tolerance, closure_tolerance=closure_tolerance, meshes=meshes,
    )  # fmt: skip


def findings(
    path: str | PathLike[str],
    robot: HybridRobot | None,
    *,
    motors: Sequence[str] | None,
    xacro_args: Mapping[str, str] | None,
    package_dirs: Sequence[str | PathLike[str]],
    rank_tolerance: float | None,
    closure_tolerance: float,
    meshes: bool,
) -> list[Finding]:
    """Check a robot's files as `check` does.

    Args:
        robot: The robot as loaded from the files with the options below, or None where it is to be built.
    """
    from ...description.shipped import find_robot

    try:
        file = find_robot(path)
        root = open_robot(file, xacro_args, package_dirs)
    except ModelError as error:
        return [_unreadable(error, fspath(path))]
    found = duplicated_names(root)
    if robot is not None:
        description = robot.description
    else:
        try:
            description = read(file, motors=motors, xacro_args=xacro_args, package_dirs=package_dirs)
        except HybridynError as error:
            return found or [_unreadable(error, file)]
    with np.errstate(all="ignore"):  # overflow and underflow are findings, not NumPy warnings
        if robot is None:
            robot, problem = _built(root, description, rank_tolerance, closure_tolerance)
            found += problem
        found += _all(root, description, robot, package_dirs, meshes)
    return sorted(found, key=lambda finding: (SEVERITIES.index(finding.severity), finding.line or 0))


def is_readable(findings: Sequence[Finding]) -> bool:
    """Return whether the file of these findings could be read."""
    return not any(finding.code in UNREADABLE for finding in findings)


def _all(
    root: Node,
    description: Description,
    robot: HybridRobot | None,
    package_dirs: Sequence[str | PathLike[str]],
    meshes: bool,
) -> Iterator[Finding]:
    shapes = read_shapes(root, package_dirs, meshes=meshes)
    subject = Subject(root, description, package_dirs, shapes, robot)
    checks = (
        check_masses, check_units, check_limits, check_couplings, check_names, check_shapes, check_lost_loops,
        check_dangling_chains, check_branch, check_modules,
    )  # fmt: skip
    for run_check in checks:
        yield from run_check(subject)
    if meshes:
        yield from check_meshes(subject)


def _built(
    root: Node, description: Description, rank_tolerance: float | None, closure_tolerance: float
) -> tuple[HybridRobot | None, list[Finding]]:
    """Build the robot, or return the finding with the reason why it cannot be built."""
    try:
        robot = build_robot(description, rank_tolerance=rank_tolerance, closure_tolerance=closure_tolerance)
        return robot, []
    except AssemblyError as error:
        return None, [
            Finding(
                "loops-close-nowhere",
                f"module '{error.module}'",
                str(error),
                "the robot cannot be assembled in any posture",
                "check the frames and the axes of its closures, one after the other",
                *_first_closure(root, description, error.module),
            )
        ]
    except ModelError as error:
        doubt = "rank_tolerance" in str(error)
        place = _first_closure(root, description, error.element)
        return None, [
            Finding(
                "rank-in-doubt" if doubt else "no-robot",
                f"'{error.element}'" if error.element else "",
                error.message,
                "every result depends on the number of freedoms" if doubt else "nothing can be computed",
                "pass --rank-tolerance as the message says, or write more digits"
                if doubt
                else "correct the element that the message names",
                *place,
            )
        ]


def _first_closure(root: Node, description: Description, element: str | None) -> tuple[str, int | None]:
    """Return the place of a closure: the one with this name, else one at this link, else the first one."""
    closures = sorted(
        description.closures,
        key=lambda closure: (closure.name != element, element not in (closure.link_a, closure.link_b)),
    )
    places = Places(root)
    for closure in closures[:1]:
        for tag in ("loop", "constraint", "loop_joint"):
            place = places.of(tag, closure.name, closure.line)
            if place[1]:
                return place
    return places.file, None


def _unreadable(error: HybridynError, file: str) -> Finding:
    place = (error.file, error.line) if isinstance(error, ModelError) else (file, None)
    message = error.message if isinstance(error, ModelError) else str(error)
    element = getattr(error, "element", None)
    return Finding(
        "unreadable",
        f"'{element}'" if element else "",
        message,
        "no other check can run before the file can be read",
        "correct the element that the message names, and check again",
        place[0] or file,
        place[1],
    )
