"""Read `submechanisms.yml` of HyRoDyn and Phobos: loop constraints and active joints.

    submechanisms:
    - type: NUMERICAL
      jointnames_active: [motor, ...]
      jointnames_spanningtree: [...]
      loop_constraints:
      - cut_joint: rod
        predecessor_body: rod_link
        successor_body: wrist_link
        constraint_axes: [{axis: [0, 0, 0, 1, 0, 0]}, ...]    # rotation, then translation

A constraint lives in the frame of the child link of its cut joint, which is one of its two bodies, or else in
that of its predecessor. On the other body it is where this frame stands when all joints are at zero, as in
HyRoDyn's NumericalLoopConstraints. Some types that name a mechanism (2SPU+1U, rrPr) say how its legs end
(`hyrodyn_types`); others hold no geometry that follows from the tree.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, FiniteFloat

from ..closure_forms import ROWS, closure_of, form_of_rows
from ..names import listed, unique
from ..placement import poses_at_zero, relative
from ..records import Closure, MotorStatement, RobotFile
from .hyrodyn_types import LEGS, Legs, closures_of
from .tables import Open, table
from .yaml_file import Place, YamlFile, checked

#: Rows by the position in HyRoDyn's spatial vectors: rotations first.
ORDER = (*ROWS[3:], *ROWS[:3])

#: Keys of the two links of a constraint.
BODIES = ("predecessor_body", "successor_body")

#: The keys that are read.
Axis: Any = table("Axis", Open, axis=Annotated[list[FiniteFloat], Field(min_length=6, max_length=6)])
Constraint: Any = table(
    "Constraint", Open, predecessor_body=str, successor_body=str, cut_joint=str | None,
    constraint_axes=Annotated[list[Axis], Field(min_length=1)],
)  # fmt: skip
Submechanism: Any = table(
    "Submechanism", Open, type=(str, ""), name=str | None, contextual_name=str | None,
    jointnames_active=list[str] | None, jointnames_spanningtree=list[str] | None,
    jointnames_independent=list[str] | None,
    loop_constraints=Annotated[list[Constraint], Field(min_length=1)] | None,
)  # fmt: skip
File: Any = table(
    "File", Open, submechanisms=Annotated[list[Submechanism], Field(min_length=1)], exoskeletons=(Any, None)
)


def apply_submechanisms(robot: RobotFile, document: YamlFile) -> None:
    """Add the closures and motors of a `submechanisms.yml` to the robot.

    Raises:
        ModelError: The file is wrong, names what the robot does not have, or states a loop without geometry.
    """
    file = Path(document.file).name
    if robot.closures:
        robot.notes.append(f"{file} is beside the robot file, which states closures itself, and was not read")
        return
    content, poses = checked(document, File), poses_at_zero(robot.joints)
    motors: dict[str, None] = {}
    for number, entry in enumerate(content.submechanisms):
        place: Place = ("submechanisms", number)
        motors |= dict.fromkeys(_active(robot, document, place, entry))
        if entry.loop_constraints is None and entry.type in LEGS:
            robot.closures += _of_type(robot, document, place, entry, poses)
        for i, constraint in enumerate(entry.loop_constraints or ()):
            here = (*place, "loop_constraints", i)
            robot.closures.append(_closure(robot, document, here, constraint, poses))
    if motors:
        line = document.lines[("submechanisms",)][0]
        where = f"jointnames_active of {file}"
        robot.motors.append(MotorStatement("side-car", where, tuple(motors), document.file, line))
    if content.exoskeletons:
        robot.notes.append(f"exoskeletons of {file} are not read")


def _active(robot: RobotFile, document: YamlFile, place: Place, entry: Any) -> list[str]:
    """Return the active joints of a submechanism; none of HyRoDyn's free joint.

    Raises:
        ModelError: A joint is unknown, or nothing closes its loop: it is numerical, or has passive joints
            that mimic no other.
    """
    known = [joint.name for joint in robot.joints]
    active: list[str] = entry.jointnames_active or []
    spanning = entry.jointnames_spanningtree or []
    if not active and not set(spanning) & set(known):
        return []
    document.refuse_unknown((*place, "jointnames_spanningtree"), spanning, known, "joint")
    document.refuse_unknown((*place, "jointnames_active"), active, known, "joint")
    moved = {*active, *(joint for coupling in robot.couplings for joint, _ in coupling.terms)}
    passive = [name for name in spanning if name not in moved]
    if entry.type not in LEGS and entry.loop_constraints is None and (passive or entry.type == "NUMERICAL"):
        name = entry.contextual_name or entry.name or entry.type
        raise document.error(
            (*place, "type"),
            f"submechanism '{name}' of type '{entry.type}' has no loop_constraints, so nothing closes its "
            f"loop over the joints {listed(passive or spanning)}. Write type: NUMERICAL with "
            "loop_constraints (predecessor_body, successor_body, constraint_axes), or <loop> or <mimic> in "
            f"the URDF; types that close themselves: {listed(LEGS)}",
        )
    return active


def _of_type(
    robot: RobotFile, document: YamlFile, place: Place, entry: Any, poses: dict[str, Any]
) -> list[Closure]:
    """Return the closures of a mechanism that the name of its type closes.

    Raises:
        ModelError: Its joints are unknown, or not those of its type.
    """
    spanning, independent = entry.jointnames_spanningtree or [], entry.jointnames_independent or []
    known = [joint.name for joint in robot.joints]
    document.refuse_unknown((*place, "jointnames_independent"), independent, known, "joint")
    legs = Legs(entry.type, spanning, independent, entry.jointnames_active or [])
    try:
        return closures_of(legs, robot.joints, poses, document.lines[place][0])
    except ValueError as error:
        name = entry.contextual_name or entry.name or entry.type
        text = f"submechanism '{name}': a mechanism of type '{entry.type}' {error}"
        raise document.error((*place, "type"), text) from None


def _closure(
    robot: RobotFile, document: YamlFile, place: Place, entry: Any, poses: dict[str, Any]
) -> Closure:
    """Return one loop constraint as a closure."""
    links = [entry.predecessor_body, entry.successor_body]
    for key, link in zip(BODIES, links, strict=True):
        document.refuse_unknown((*place, key), [link], poses, "link")
    axes = [(*place, "constraint_axes", i) for i in range(len(entry.constraint_axes))]
    words = [_row(document, *axis) for axis in zip(axes, entry.constraint_axes, strict=True)]
    try:
        form = form_of_rows(" ".join(words))
    except ValueError as error:
        raise document.error((*place, "constraint_axes"), str(error)) from None
    cut = next((joint.child for joint in robot.joints if joint.name == entry.cut_joint), None)
    closing = links[1] if cut == links[1] else links[0]
    sides = [
        (link, np.eye(4) if link == closing else relative(poses[link], poses[closing])) for link in links
    ]
    name = unique(entry.cut_joint or "-".join(links), {closure.name for closure in robot.closures})
    turns = (form.rotation_of_frames,) * 2
    return closure_of(name, "rows", sides, turns, form, document.lines[place][0])


def _row(document: YamlFile, place: Place, axis: Any) -> str:
    """Return the row of one constraint axis: a unit vector of six numbers, rotation first."""
    (found, *others) = np.flatnonzero(axis.axis).tolist() or [-1, -1]
    if others:
        raise document.error(
            (*place, "axis"),
            "must have one number that is not zero: an axis of the predecessor's frame, turned about or "
            "moved along; write other directions as <loop> in the URDF",
        )
    return ORDER[found]
