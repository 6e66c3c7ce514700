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

from ..closure_forms import ROWS, form_of_rows
from ..names import did_you_mean, listed
from ..placement import turned
from ..poses import poses_at_zero, relative
from ..records import Closure
from ..robot_file import MotorStatement, RobotFile
from .yaml_file import Place, YamlFile

#: Rows by the position in HyRoDyn's spatial vectors: rotations first.
ORDER = (*ROWS[3:], *ROWS[:3])

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
    entries = _list(document, (), "submechanisms")
    known = {joint.name for joint in robot.joints}
    poses = poses_at_zero(robot.joints)
    motors: dict[str, None] = {}
    for number, entry in enumerate(entries):
        place: Place = ("submechanisms", number)
        if not isinstance(entry, dict):
            raise document.error(place, "a submechanism is a table of keys")
        active, spanning = (
            _names(document, place, entry, key) for key in ("jointnames_active", "jointnames_spanningtree")
        )
        if not active and not set(spanning) & known:
            continue  # HyRoDyn's free joint of a floating base
        for key, names in (("jointnames_spanningtree", spanning), ("jointnames_active", active)):
            for index, name in enumerate(names):
                if name not in known:
                    raise document.error(
                        (*place, key, index), f"no joint is called '{name}'{did_you_mean(name, known)}"
                    )
        motors |= dict.fromkeys(active)
        _apply(robot, document, place, entry, (active, spanning), poses)
    if motors:
        line = document.lines[("submechanisms",)][0]
        where = f"jointnames_active of {file}"
        robot.motors.append(MotorStatement("side-car", where, tuple(motors), document.file, line))
    if document.data.get("exoskeletons"):
        robot.notes.append(f"exoskeletons of {file} are not read")


def _apply(
    robot: RobotFile,
    document: YamlFile,
    place: Place,
    entry: dict[str, Any],
    joints: tuple[list[str], list[str]],
    poses: dict[str, Any],
) -> None:
    """Add the closures of one submechanism."""
    active, spanning = joints
    kind = str(entry.get("type", ""))
    constraints = entry.get("loop_constraints")
    if constraints is not None:
        for index in range(len(_list(document, place, "loop_constraints"))):
            here = (*place, "loop_constraints", index)
            robot.closures.append(_closure(robot, document, here, constraints[index], poses))
        return
    coupled = {coupling.name for coupling in robot.couplings}
    passive = [name for name in spanning if name not in active and name not in coupled]
    if not passive:
        return  # serial, or every passive joint mimics another
    name = entry.get("contextual_name") or entry.get("name") or kind
    if kind in BY_MIMIC:
        raise document.error(
            (*place, "type"), f"submechanism '{name}': joints {listed(passive)} mimic no other joint in the "
            "URDF; write <mimic> in them",
        )  # fmt: skip
    if kind == "NUMERICAL":
        missing = "loop_constraints is missing"
    else:
        missing = f"type '{kind}' states no geometry (which bodies meet where is in HyRoDyn's own code)"
    raise document.error(
        (*place, "type"), f"submechanism '{name}': {missing}, so nothing closes its loop over the passive "
        f"joints {listed(passive)}. Write type: NUMERICAL with loop_constraints (predecessor_body, "
        "successor_body, constraint_axes), or <loop> in the URDF",
    )  # fmt: skip


def _closure(
    robot: RobotFile, document: YamlFile, place: Place, entry: Any, poses: dict[str, Any]
) -> Closure:
    """Return one loop constraint as a closure."""
    if not isinstance(entry, dict):
        raise document.error(place, "a loop constraint is a table of keys")
    links = []
    for key in ("predecessor_body", "successor_body"):
        name = entry.get(key)
        if name not in poses:
            hint = did_you_mean(str(name), poses)
            raise document.error(
                (*place, key), f"no link is called '{name}'{hint}" if name else f"{key} is missing"
            )
        links.append(str(name))
    axes = _list(document, place, "constraint_axes")
    words = [_row(document, (*place, "constraint_axes", i), axis) for i, axis in enumerate(axes)]
    try:
        form = form_of_rows(" ".join(words))
    except ValueError as error:
        raise document.error((*place, "constraint_axes"), str(error)) from None
    turn = form.rotation_of_frames
    cut = next((joint.child for joint in robot.joints if joint.name == entry.get("cut_joint")), None)
    closing = links[1] if cut == links[1] else links[0]
    frame_a, frame_b = (
        turned(np.eye(4) if link == closing else relative(poses[link], poses[closing]), turn)
        for link in links
    )
    taken = {closure.name for closure in robot.closures}
    name = str(entry.get("cut_joint") or "-".join(links))
    name = next(one for one in (name, "-".join(links), f"{name}_{len(taken)}") if one not in taken)
    return Closure(
        name, "rows", links[0], frame_a, links[1], frame_b, form.translations, form.rotation,
        document.lines[place][0], turn,
    )  # fmt: skip


def _row(document: YamlFile, place: Place, axis: Any) -> str:
    """Return the row of one constraint axis: a unit vector of six numbers, rotation first."""
    numbers = axis.get("axis") if isinstance(axis, dict) else None
    if (
        not isinstance(numbers, list)
        or len(numbers) != 6
        or not all(isinstance(x, int | float) and not isinstance(x, bool) and np.isfinite(x) for x in numbers)
    ):
        raise document.error(place, "needs axis: six numbers, the rotation first")
    (found, *others) = np.flatnonzero(numbers).tolist() or [-1, -1]
    if others:
        raise document.error(
            (*place, "axis"),
            "must have one number that is not zero: an axis of the predecessor's frame, turned about or "
            "moved along; write other directions as <loop> in the URDF",
        )
    return ORDER[found]


def _list(document: YamlFile, place: Place, key: str) -> list[Any]:
    """Return a list below a place of the document; it must not be missing or empty."""
    value = document.data
    for part in place:
        value = value[part]
    found = value.get(key) if isinstance(value, dict) else None
    if not isinstance(found, list) or not found:
        here = (*place, key) if isinstance(value, dict) and key in value else place
        raise document.error(here, f"needs a list '{key}' with at least one entry")
    return found


def _names(document: YamlFile, place: Place, entry: dict[str, Any], key: str) -> list[str]:
    """Return a list of joint names, empty if it is missing."""
    value = entry.get(key) or []
    if not isinstance(value, list) or not all(isinstance(name, str) for name in value):
        raise document.error((*place, key), "must be a list of joint names")
    return value
