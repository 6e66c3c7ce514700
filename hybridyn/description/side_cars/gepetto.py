"""Read the side-car `robot.yaml` of the Gepetto models (arXiv 2504.04767, example-parallel-robots).

    closed_loop: [[frame_a, frame_b], ...]   # links or joints of the URDF; a joint stands for its child link
    type: ['6d', '3d', ...]                  # weld or point, one per pair
    name_mot: [joint, ...]                   # driven joints
    joint_name: [joint, ...]                 # joints to retype ...
    joint_type: [SPHERICAL, FIXED, UJOINT_XY, ...]

A retyped joint keeps the placement of the URDF joint. SPHERICAL makes it a spherical joint. FIXED welds it at
position zero. UJOINT_XY replaces it by two revolutes, about x and then y of its frame, and ignores its axis.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...errors import ModelError
from ...joints.kinds import JointKind
from ..closure_forms import FORMS, FREE, closure_of
from ..joint_words import NICKNAMES, called
from ..names import closest, did_you_mean, listed
from ..records import Joint, Link, MotorStatement, RobotFile
from .tables import Schema
from .yaml_file import Place, YamlFile, checked, read_yaml

#: Joints by the type that they get.
RETYPED = called("gepetto")
UNIVERSAL = re.compile(r"UJOINT_([XYZ])([XYZ])")
#: Types of closures.
TYPES = ("3d", "6d")
AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}


class SideCar(Schema):
    """The keys of a side-car."""

    closed_loop: list[list[str]] | None = None
    type: list[str] | str | None = None
    name_mot: list[str] | str | None = None
    joint_name: list[str] | None = None
    joint_type: list[str] | None = None


def read_side_car(robot: RobotFile, text: bytes, file: str) -> None:
    """Add the closures and motors of a side-car, and retype joints; note a YAML file of another tool.

    Raises:
        ModelError: The text is not strict YAML, a key resembles `closed_loop`, or a key, name or type is
            wrong; the message names file, line and column.
    """
    own = {*SideCar.model_fields} - {"type"}
    document = read_yaml(text, file) if any(key.encode() in text for key in own) else YamlFile(file)
    if not isinstance(document.data, dict):
        words = re.findall(r"^\s*[\"']?([A-Za-z_]+)[\"']?\s*:", text.decode("utf-8", "replace"), re.MULTILINE)
        if misspelt := [word for word in words if closest(word, ["closed_loop"])]:
            raise ModelError(f"unknown key '{misspelt[0]}' (did you mean 'closed_loop'?)", file=file)
        robot.notes.append(f"{file} is not a side-car (no key {listed(sorted(own))}) and was not read")
        return
    side_car = checked(document, SideCar)
    _retype(robot, side_car, document)
    _close(robot, side_car, document)
    if side_car.name_mot is not None:
        names = _motor_names(robot, side_car.name_mot)
        line = document.lines[("name_mot",)][0]
        where = f"name_mot of {Path(document.file).name}"
        robot.motors.append(MotorStatement("side-car", where, names, document.file, line))


def _close(robot: RobotFile, side_car: SideCar, document: YamlFile) -> None:
    """Add a closure for each pair of frames: the link of that name, or the child of the joint."""
    pairs, types = side_car.closed_loop or [], side_car.type
    if types is None and pairs:
        robot.notes.append("the side-car states no closure type; every pair is taken as 6d (a weld)")
    if types is None or isinstance(types, str):
        types = [types or "6d"] * len(pairs)
    if len(types) != len(pairs):
        raise document.error(("type",), f"{len(types)} types for {len(pairs)} pairs of closed_loop")
    children = {joint.name: joint.child for joint in robot.joints}
    frames = children | {link.name: link.name for link in robot.links}
    for index, (pair, stated) in enumerate(zip(pairs, types, strict=True)):
        place: Place = ("closed_loop", index)
        if stated.lower() not in TYPES:
            raise document.error(("type", index), f"unknown type '{stated}'; known: '3d' and '6d'")
        if len(pair) != 2:
            raise document.error(place, f"{len(pair)} frames instead of a pair")
        document.refuse_unknown(place, pair, frames, "link or joint")
        sides = [(frames[name], np.eye(4)) for name in pair]
        kind, line = stated.lower(), document.lines[place][0]
        robot.closures.append(closure_of("-".join(pair), kind, sides, form=FORMS[NICKNAMES[kind]], line=line))


def _retype(robot: RobotFile, side_car: SideCar, document: YamlFile) -> None:
    """Replace the joints that the side-car retypes."""
    names, types = side_car.joint_name or [], side_car.joint_type or []
    if len(names) != len(types):
        raise document.error(("joint_type",), f"{len(types)} types for {len(names)} names in joint_name")
    if len(names) != len({*names}):
        raise document.error(("joint_name",), "a joint is named twice")
    document.refuse_unknown(("joint_name",), names, (joint.name for joint in robot.joints), "joint")
    kinds = dict(zip(names, types, strict=True))
    joints: list[Joint] = []
    for joint in robot.joints:
        try:
            joints += _retyped(joint, kinds[joint.name], robot.links) if joint.name in kinds else [joint]
        except ValueError as error:
            raise document.error(("joint_type", names.index(joint.name)), str(error)) from None
    robot.joints = joints


def _retyped(joint: Joint, kind: str, links: list[Link]) -> list[Joint]:
    """Return the joints that replace a joint; a universal joint appends a massless link to `links`.

    This link is between the two revolutes of the universal joint.

    Raises:
        ValueError: The kind is unknown; the message lists the known ones.
    """
    free = replace(joint, **FREE)
    if kind in RETYPED:
        return [replace(free, kind=RETYPED[kind].chain[0])]
    match = UNIVERSAL.fullmatch(kind)
    if match is None or match[1] == match[2]:
        known = [*reversed(RETYPED), "UJOINT_XY", "UJOINT_YZ", "UJOINT_ZX", "UJOINT_ZY"]
        raise ValueError(f"unknown type '{kind}'{did_you_mean(kind, known)}; known: {listed(known)}")
    first, second = (
        replace(free, name=f"{joint.name}_{x}", kind=JointKind.REVOLUTE, axis=AXES[x]) for x in match.groups()
    )
    links.append(Link(first.name, 0.0, np.zeros(3), np.zeros((3, 3)), joint.line))
    return [replace(first, child=first.name), replace(second, parent=first.name, placement=np.eye(4))]


def _motor_names(robot: RobotFile, stated: list[str] | str) -> tuple[str, ...]:
    """Return the driven joints; a word that names no joint means every joint whose name contains it."""
    joints = [joint.name for joint in robot.joints]
    names: dict[str, None] = {}
    for word in [stated] if isinstance(stated, str) else stated:
        found = [word] if word in joints else [name for name in joints if word and word in name] or [word]
        if found != [word]:
            robot.notes.append(f"name_mot '{word}' names no joint; it stands for {listed(found)}")
        names |= dict.fromkeys(found)
    return tuple(names)
