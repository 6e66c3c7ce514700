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
HyRoDyn's NumericalLoopConstraints. Types that name a mechanism (2SPU+1U, rrPr)
hold no geometry: HyRoDyn has it in its own code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..closure_forms import ROWS, closure_of, form_of_rows
from ..names import did_you_mean, listed
from ..placement import poses_at_zero, relative
from ..records import Closure
from ..robot_file import MotorStatement, RobotFile
from .yaml_file import Place, YamlFile

#: Rows by the position in HyRoDyn's spatial vectors: rotations first.
ORDER = (*ROWS[3:], *ROWS[:3])

#: Keys of the two links of a constraint.
BODIES = ("predecessor_body", "successor_body")

#: Types whose loops are the mimicking joints of the URDF.
BY_MIMIC = ("TRANSMISSION", "PARALLELOGRAMCHAIN")


def apply_submechanisms(robot: RobotFile, document: YamlFile) -> None:
    """Add the closures and motors of a `submechanisms.yml` to the robot.

    Raises:
        ModelError: The file is wrong, names what the robot does not have, or states a loop without geometry.
    """
    file = Path(document.file).name
    if robot.closures:
        robot.notes.append(f"{file} is beside the robot file, which states closures itself, and was not read")
        return
    poses = poses_at_zero(robot.joints)
    motors: dict[str, None] = {}
    for place, entry in _entries(document, (), document.data, "submechanisms"):
        if not isinstance(entry, dict):
            raise document.error(place, "a submechanism is a table of keys")
        active, spanning = _joints(robot, document, place, entry)
        motors |= dict.fromkeys(active)
        if entry.get("loop_constraints") is None:
            passive = [name for name in spanning if name not in active]
            _refuse_without_geometry(robot, document, place, entry, passive)
        else:
            for here, constraint in _entries(document, place, entry, "loop_constraints"):
                robot.closures.append(_closure(robot, document, here, constraint, poses))
    if motors:
        line = document.lines[("submechanisms",)][0]
        where = f"jointnames_active of {file}"
        robot.motors.append(MotorStatement("side-car", where, tuple(motors), document.file, line))
    if document.data.get("exoskeletons"):
        robot.notes.append(f"exoskeletons of {file} are not read")


def _joints(
    robot: RobotFile, document: YamlFile, place: Place, entry: dict[str, Any]
) -> tuple[list[str], list[str]]:
    """Return the active joints of a submechanism and those of its tree; none of HyRoDyn's free joint."""
    known = [joint.name for joint in robot.joints]
    found: list[list[str]] = []
    for key in ("jointnames_active", "jointnames_spanningtree"):
        names = entry.get(key) or []
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise document.error((*place, key), "must be a list of joint names")
        found.append(names)
    active, spanning = found
    if not active and not set(spanning) & set(known):
        return [], []
    document.refuse_unknown((*place, "jointnames_spanningtree"), spanning, known, "joint")
    document.refuse_unknown((*place, "jointnames_active"), active, known, "joint")
    return active, spanning


def _refuse_without_geometry(
    robot: RobotFile, document: YamlFile, place: Place, entry: dict[str, Any], passive: list[str]
) -> None:
    """Raise for a submechanism of which nothing closes the loop: passive joints that mimic no other."""
    passive = [name for name in passive if name not in {coupling.name for coupling in robot.couplings}]
    kind = str(entry.get("type", ""))
    name = entry.get("contextual_name") or entry.get("name") or kind
    if kind in BY_MIMIC:
        problem = f"joints {listed(passive)} mimic no other joint in the URDF; write <mimic> in them"
    else:
        missing = f"type '{kind}' states no geometry (which bodies meet where is in HyRoDyn's own code)"
        missing = "loop_constraints is missing" if kind == "NUMERICAL" else missing
        problem = (
            f"{missing}, so nothing closes its loop over the passive joints {listed(passive)}. Write "
            "type: NUMERICAL with loop_constraints (predecessor_body, successor_body, constraint_axes), "
            "or <loop> in the URDF"
        )
    if passive:
        raise document.error((*place, "type"), f"submechanism '{name}': {problem}")


def _closure(
    robot: RobotFile, document: YamlFile, place: Place, entry: Any, poses: dict[str, Any]
) -> Closure:
    """Return one loop constraint as a closure."""
    if not isinstance(entry, dict):
        raise document.error(place, "a loop constraint is a table of keys")
    links = [str(entry.get(key) or "") for key in BODIES]
    for key, link in zip(BODIES, links, strict=True):
        if link not in poses:
            hint = did_you_mean(link, poses)
            problem = f"no link is called '{link}'{hint}" if link else f"{key} is missing"
            raise document.error((*place, key), problem)
    words = [_row(document, *axis) for axis in _entries(document, place, entry, "constraint_axes")]
    try:
        form = form_of_rows(" ".join(words))
    except ValueError as error:
        raise document.error((*place, "constraint_axes"), str(error)) from None
    cut = next((joint.child for joint in robot.joints if joint.name == entry.get("cut_joint")), None)
    closing = links[1] if cut == links[1] else links[0]
    sides = [
        (link, np.eye(4) if link == closing else relative(poses[link], poses[closing])) for link in links
    ]
    taken = {closure.name for closure in robot.closures}
    name = str(entry.get("cut_joint") or "-".join(links))
    name = next(one for one in (name, "-".join(links), f"{name}_{len(taken)}") if one not in taken)
    turns = (form.rotation_of_frames,) * 2
    return closure_of(name, "rows", sides, turns, form, document.lines[place][0])


def _row(document: YamlFile, place: Place, axis: Any) -> str:
    """Return the row of one constraint axis: a unit vector of six numbers, rotation first."""
    numbers = axis.get("axis") if isinstance(axis, dict) else None
    plain = isinstance(numbers, list) and all(type(x) in (int, float) and np.isfinite(x) for x in numbers)
    if not isinstance(numbers, list) or not plain or len(numbers) != 6:
        raise document.error(place, "needs axis: six numbers, the rotation first")
    (found, *others) = np.flatnonzero(numbers).tolist() or [-1, -1]
    if others:
        raise document.error(
            (*place, "axis"),
            "must have one number that is not zero: an axis of the predecessor's frame, turned about or "
            "moved along; write other directions as <loop> in the URDF",
        )
    return ORDER[found]


def _entries(document: YamlFile, place: Place, table: Any, key: str) -> list[tuple[Place, Any]]:
    """Return the entries of a list in a table at a place, each with its place; it must not be empty."""
    found = table.get(key) if isinstance(table, dict) else None
    if not isinstance(found, list) or not found:
        here = (*place, key) if isinstance(table, dict) and key in table else place
        raise document.error(here, f"needs a list '{key}' with at least one entry")
    return [((*place, key, index), entry) for index, entry in enumerate(found)]
