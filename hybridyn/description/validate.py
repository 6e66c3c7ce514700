"""Check the description from every format: one tree, unique and known names, physical bodies."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import ModelError
from .names import LISTED_NAMES, counted, did_you_mean, listed
from .placement import outwards
from .records import Closure, Coupling, Joint, Link, RobotFile

#: Tolerance of the triangle inequality, relative to the largest moment: CAD keeps 3 to 6 digits.
INERTIA_SLACK = 1e-3

TWO_PARENTS_ADVICE = (
    "a robot file is a tree plus closures: keep one of the joints, and state the other as a closure, e.g. "
    '<loop name=".." type="revolute"><predecessor link=".."><origin xyz=".."/></predecessor>'
    '<successor link=".."><origin xyz=".."/></successor><axis xyz=".."/></loop>'
)


def validate(robot: RobotFile) -> None:
    """Check names and structure, drop crossed limits, and note links with an unphysical inertia.

    Raises:
        ModelError: A name is duplicated or unknown, a link has two parents, the joints form a cycle, there is
            not exactly one root, or a coupled joint does not have exactly one freedom.
    """
    if not robot.links:
        raise ModelError("the robot has no link", file=robot.file)
    for items in (robot.links, robot.joints, robot.closures):
        _refuse_duplicates(robot, items)
    _refuse_unknown_links(robot)
    _check_tree(robot)
    _check_couplings(robot)
    _drop_crossed(robot)
    _note_unphysical(robot)


def _refuse_duplicates(robot: RobotFile, items: Sequence[Link | Joint | Closure]) -> None:
    lines: dict[str, int | None] = {}
    for item in items:
        if item.name in lines:
            first = f" (first in line {lines[item.name]})" if lines[item.name] else ""
            raise _error(robot, item, f" is stated twice{first}; rename one")
        lines[item.name] = item.line


def _refuse_unknown_links(robot: RobotFile) -> None:
    """Raise for joints and closures that name links which the robot does not have, or one link twice."""
    names = {link.name for link in robot.links}
    ends: list[tuple[Joint | Closure, tuple[tuple[str, str], tuple[str, str]]]] = [
        *((joint, (("parent link", joint.parent), ("child link", joint.child))) for joint in robot.joints),
        *((closure, (("link", closure.link_a), ("link", closure.link_b))) for closure in robot.closures),
    ]
    for item, links in ends:
        for role, link in links:
            if link not in names:
                raise _error(robot, item, f": unknown {role} '{link}'{did_you_mean(link, names)}")
        if links[0][1] == links[1][1]:
            raise _error(robot, item, f": joins link '{links[0][1]}' to itself")


def _check_tree(robot: RobotFile) -> None:
    parents: dict[str, Joint] = {}
    for joint in robot.joints:
        if joint.child in parents:
            other = parents[joint.child].name
            message = f": link '{joint.child}' is already the child of joint '{other}'; {TWO_PARENTS_ADVICE}"
            raise _error(robot, joint, message)
        parents[joint.child] = joint
    roots = [link.name for link in robot.links if link.name not in parents]
    if not roots:
        raise ModelError(
            f"the joints form a cycle and no link is the root; {TWO_PARENTS_ADVICE}", file=robot.file
        )
    if len(roots) > 1:
        raise ModelError(
            f"{len(roots)} links have no parent joint: {_with_sizes(robot, roots)}; a robot has one root. To "
            'weld another on, write <joint name="weld" type="fixed"><parent link="ROOT"/><child '
            'link="OTHER"/></joint>; type="floating" leaves it free; to choose one of them, remove the links '
            "of the others",
            file=robot.file,
            element=roots[1],
        )
    reached = {roots[0], *(joint.child for joint in outwards(robot.joints, roots))}
    lost = [link for link in robot.links if link.name not in reached]
    if lost:  # each has one parent
        raise ModelError(
            f"links {listed(link.name for link in lost)} form a cycle of joints apart from the root "
            f"'{roots[0]}'; {TWO_PARENTS_ADVICE}",
            file=robot.file,
            line=lost[0].line,
            element=lost[0].name,
        )


def _with_sizes(robot: RobotFile, roots: list[str]) -> str:
    """Return the names of roots, each with the number of links that joints hang on it."""
    below = {root: sum(1 for _ in outwards(robot.joints, [root])) for root in roots[:LISTED_NAMES]}
    told = [
        f"'{root}' ({counted(size, 'link') if size else 'nothing'} on it)" for root, size in below.items()
    ]
    return ", ".join(told) + (f" and {len(roots) - len(told)} more" if len(roots) > len(told) else "")


def _check_couplings(robot: RobotFile) -> None:
    kinds = {joint.name: joint.kind for joint in robot.joints}
    counted = Counter(coupling.name for coupling in robot.couplings)
    for coupling in robot.couplings:
        wrong = f"is stated {counted[coupling.name]} times" if counted[coupling.name] > 1 else ""
        for name, _ in coupling.terms:
            if name not in kinds:
                wrong = f"unknown joint '{name}'{did_you_mean(name, kinds)}"
            elif not kinds[name].single:
                wrong = f"joint '{name}' is {kinds[name]}; only joints with one freedom can be coupled"
        if wrong:
            raise _error(robot, coupling, f": {wrong}")


def _drop_crossed(robot: RobotFile) -> None:
    """Drop and note position limits of which the lower is above the upper."""
    for number, joint in enumerate(robot.joints):
        if joint.lower > joint.upper:
            told = f"lower limit {joint.lower:g} above upper {joint.upper:g}, both ignored, as in PyBullet"
            robot.notes.append(f"joint '{joint.name}': {told}")
            robot.crossed[joint.name] = joint.lower, joint.upper
            robot.joints[number] = replace(joint, lower=-np.inf, upper=np.inf)


def _note_unphysical(robot: RobotFile) -> None:
    """Note the links whose inertia no distribution of mass can have; the dynamics is still defined."""
    moments = np.linalg.eigvalsh([link.inertia for link in robot.links])
    slack = INERTIA_SLACK * np.abs(moments).max(axis=1)
    wrong = (moments[:, 0] < -slack) | (moments[:, 2] > moments[:, 0] + moments[:, 1] + slack)
    unphysical = [link.name for link, one in zip(robot.links, wrong, strict=True) if one]
    if unphysical:
        robot.notes.append(
            f"{len(unphysical)} of {len(robot.links)} links have an unphysical inertia "
            f"(a negative principal moment, or one larger than the sum of the others): {listed(unphysical)}"
        )


def _error(robot: RobotFile, item: Link | Joint | Closure | Coupling, message: str) -> ModelError:
    """Return the error of an element, with its kind, name, file and line."""
    what = f"{type(item).__name__.lower()} '{item.name}'"
    return ModelError(f"{what}{message}", file=robot.file, line=item.line, element=item.name)
