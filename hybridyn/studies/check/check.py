"""Check a robot's files. Each finding names its place and how to mend it.

    finding       one finding; every code with its severity
    subject       the file as XML, as records and as a robot
    shapes        bounding boxes of the links, from visuals, collisions and meshes
    elements, axes, loops      the checks of links and joints, of hinges in loops, and of modules

`hybridyn.check("robot.urdf")` returns all findings, the worst first.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from os import PathLike, fspath

import numpy as np

from ...description import read
from ...description.names import drops
from ...description.notes import place_of
from ...description.reading import open_robot
from ...errors import AssemblyError, HybridynError, ModelError
from ...structure.building import build_robot
from ...structure.robot import HybridRobot
from .axes import check_axes, check_same_loops
from .elements import check_limits, check_masses, check_mimics, check_units
from .finding import CODES, SEVERITIES, Finding, Severity
from .loops import check_dangling_chains, check_lost_loops, check_modules
from .shapes import check_shapes, read_shapes
from .subject import Subject

__all__ = ["CODES", "SEVERITIES", "Finding", "Severity", "check", "is_readable"]

REPORTED_ELSEWHERE = ("unphysical inertia", "no file says which joints", "both ignored")


def check(
    path: str | PathLike[str],
    robot: HybridRobot | None = None,
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
        robot: The robot as loaded from the files with the options below; by default it is built.
        motors: Names of the driven joints, instead of those that the files state.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `$(find package)` and `package://` search.
        rank_tolerance: As for `hybridyn.load`.
        closure_tolerance: As for `hybridyn.load`.
        meshes: Whether mesh files are searched for and loaded.

    Returns:
        The findings; an empty list if there are none. If the file cannot be read, only the reasons.
    """
    from ...description.shipped import find_robot

    try:
        file = find_robot(path)
        root = open_robot(file, xacro_args, package_dirs)
    except ModelError as error:
        return [_unreadable(error, fspath(path))]
    if robot is not None:
        description = robot.description
    else:
        try:
            description = read(file, motors=motors, xacro_args=xacro_args, package_dirs=package_dirs)
        except HybridynError as error:
            return [_unreadable(error, file)]
    found = list[Finding]()
    with np.errstate(all="ignore"):  # overflow and underflow are findings, not NumPy warnings
        subject = Subject(root, description, read_shapes(root, package_dirs, meshes=meshes), robot)
        if robot is None:
            try:
                subject.robot = build_robot(
                    description, rank_tolerance=rank_tolerance, closure_tolerance=closure_tolerance
                )
            except HybridynError as error:
                found.append(_not_built(subject, error))
        checks = (
            check_masses, check_units, check_limits, check_mimics, check_notes, check_shapes,
            check_lost_loops, check_dangling_chains, check_axes, check_same_loops, check_modules,
        )  # fmt: skip
        found += [finding for run_check in checks for finding in run_check(subject)]
    return sorted(found, key=lambda finding: (SEVERITIES.index(finding.severity), finding.line or 0))


def is_readable(findings: Sequence[Finding]) -> bool:
    """Return whether the file of these findings could be read."""
    return not any(finding.code == "unreadable" for finding in findings)


def check_notes(subject: Subject) -> Iterator[Finding]:
    """Pass on the reader's remarks."""
    description = subject.description
    dropped = drops(description.notes)
    for note in dropped:
        file, line, text = place_of(note)
        yield Finding(
            "dropped",
            "",
            text,
            "an engine that reads it computes another motion, or other efforts",
            "state it in model.toml or in a form that is read, or nothing if you do without it",
            file or description.source,
            line,
        )
    for note in description.notes:
        if note not in dropped and not any(text in note for text in REPORTED_ELSEWHERE):
            file, line, text = place_of(note)
            yield Finding(
                "reader",
                "",
                text,
                "something in the file was ignored or interpreted in a particular way",
                "nothing to do if that is what you intend",
                file or description.source,
                line,
            )


def _not_built(subject: Subject, error: HybridynError) -> Finding:
    """Return the finding that says why the robot cannot be built."""
    element = getattr(error, "module" if isinstance(error, AssemblyError) else "element", None)
    closures = sorted(
        subject.description.closures,
        key=lambda closure: (closure.name != element, element not in (closure.link_a, closure.link_b)),
    )
    place = subject.first_place(closure.name for closure in closures[:1])
    if isinstance(error, AssemblyError):
        return Finding(
            "loops-close-nowhere",
            f"module '{element}'",
            str(error),
            "the robot cannot be assembled in any posture",
            "check the frames and the axes of its closures, one after the other",
            *place,
        )
    doubt = "rank_tolerance" in str(error)
    return Finding(
        "rank-in-doubt" if doubt else "no-robot",
        f"'{element}'" if element else "",
        getattr(error, "message", str(error)),
        "every result depends on the number of freedoms" if doubt else "nothing can be computed",
        "pass --rank-tolerance as the message says, or write more digits"
        if doubt
        else "correct the element that the message names",
        *place,
    )


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
