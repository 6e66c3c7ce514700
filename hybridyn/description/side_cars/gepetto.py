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
from typing import Literal

import numpy as np
from pydantic import ValidationError

from ...errors import ModelError
from ..frame_names import CLOSURE_TYPES, weld_or_point
from ..names import closest, did_you_mean, listed
from ..records import Joint, Link
from ..robot_file import MotorStatement, RobotFile
from .schema import Schema, first_problem
from .yaml_file import Place, YamlFile, read_yaml

#: Keys of early side-cars, which named frames by a pattern.
OLD_KEYS = ("name_closedloop", "closed_loop_number", "name_spherical")

UNIVERSAL = re.compile(r"UJOINT_([XYZ])([XYZ])")
AXES = {"X": np.array([1.0, 0.0, 0.0]), "Y": np.array([0.0, 1.0, 0.0]), "Z": np.array([0.0, 0.0, 1.0])}


class SideCar(Schema):
    """The keys of a side-car."""

    closed_loop: list[list[str]] | None = None
    type: list[str] | str | None = None
    name_mot: list[str] | str | None = None
    joint_name: list[str] | None = None
    joint_type: list[str] | None = None


def read_side_car(robot: RobotFile, text: bytes, file: str) -> None:
    """Read a YAML file beside the robot if it is a side-car; note it if it is a file of another tool.

    Raises:
        ModelError: As in `apply_side_car`; or the text is not strict YAML, or a key resembles `closed_loop`.
    """
    own = {*SideCar.model_fields, *OLD_KEYS} - {"type"}
    if any(key.encode() in text for key in own):
        document = read_yaml(text, file)
        if isinstance(document.data, dict):
            return apply_side_car(robot, document)
    words = re.findall(r"^\s*[\"']?([A-Za-z_]+)[\"']?\s*:", text.decode("utf-8", "replace"), re.MULTILINE)
    if misspelt := [word for word in words if closest(word, ["closed_loop"])]:
        raise ModelError(f"unknown key '{misspelt[0]}' (did you mean 'closed_loop'?)", file=file)
    robot.notes.append(
        f"{file} is not a side-car (no key {listed(sorted(own - {*OLD_KEYS}))}) and was not read"
    )
    return None


def apply_side_car(robot: RobotFile, document: YamlFile) -> None:
    """Add the closures and motors of a side-car to the robot, and retype its joints.

    Raises:
        ModelError: A key, name or type is wrong; the message names file, line and column.
    """
    for key in OLD_KEYS:
        if key in document.data:
            raise document.error(
                (key,), "an early form that is not read; list the frame pairs in closed_loop"
            )
    try:
        side_car = SideCar.model_validate(document.data)
    except ValidationError as error:
        place, message = first_problem(error, SideCar.model_fields)
        raise document.error(place, message) from None
    _retype(robot, side_car, document)
    _close(robot, side_car, document)
    if side_car.name_mot is not None:
        names = _motor_names(robot, side_car.name_mot)
        line = document.lines[("name_mot",)][0]
        where = f"name_mot of {Path(document.file).name}"
        robot.motors.append(MotorStatement("side-car", where, names, document.file, line))


def _close(robot: RobotFile, side_car: SideCar, document: YamlFile) -> None:
    pairs = side_car.closed_loop or []
    types = side_car.type
    if types is None:
        if pairs:
            robot.notes.append("the side-car states no closure type; every pair is taken as 6d (a weld)")
        types = "6d"
    if isinstance(types, str):
        types = [types] * len(pairs)
    if len(types) != len(pairs):
        raise document.error(("type",), f"{len(types)} types for {len(pairs)} pairs of closed_loop")
    for index, (pair, stated) in enumerate(zip(pairs, types, strict=True)):
        place: Place = ("closed_loop", index)
        kind = stated.lower()
        if kind not in CLOSURE_TYPES:
            raise document.error(("type", index), f"unknown type '{stated}'; known: '3d' and '6d'")
        if len(pair) != 2:
            raise document.error(place, f"{len(pair)} frames instead of a pair")
        links = [_link_of(robot, name, document, (*place, at)) for at, name in enumerate(pair)]
        robot.closures.append(
            weld_or_point("-".join(pair), kind, links[0], links[1], document.lines[place][0])
        )


def _link_of(robot: RobotFile, name: str, document: YamlFile, place: Place) -> str:
    """Return the link that a frame name means: the link of that name, or the child of the joint."""
    links = {link.name for link in robot.links}
    if name in links:
        return name
    children = {joint.name: joint.child for joint in robot.joints}
    if name in children:
        return children[name]
    raise document.error(
        place, f"no link or joint is called '{name}'{did_you_mean(name, [*links, *children])}"
    )


def _retype(robot: RobotFile, side_car: SideCar, document: YamlFile) -> None:
    names, types = side_car.joint_name or [], side_car.joint_type or []
    if len(names) != len(types):
        raise document.error(("joint_type",), f"{len(types)} types for {len(names)} names in joint_name")
    places = {name: index for index, name in enumerate(names)}
    if len(places) != len(names):
        raise document.error(("joint_name",), "a joint is named twice")
    known = [joint.name for joint in robot.joints]
    for name, index in places.items():
        if name not in known:
            raise document.error(
                ("joint_name", index), f"no joint is called '{name}'{did_you_mean(name, known)}"
            )
    joints: list[Joint] = []
    for joint in robot.joints:
        if joint.name not in places:
            joints.append(joint)
            continue
        index = places[joint.name]
        try:
            joints += retyped(joint, types[index], robot.links)
        except ValueError as error:
            raise document.error(("joint_type", index), str(error)) from None
    robot.joints = joints


def retyped(joint: Joint, kind: str, links: list[Link]) -> list[Joint]:
    """Return the joints that replace a joint; a universal joint appends a massless link to `links`.

    This link is between the two revolutes of the universal joint.

    Raises:
        ValueError: The kind is unknown; the message lists the known ones.
    """
    free = replace(joint, lower=-np.inf, upper=np.inf, velocity=np.inf, effort=np.inf)
    if kind == "SPHERICAL":
        return [replace(free, kind="spherical")]
    if kind == "FIXED":
        return [replace(free, kind="fixed")]
    match = UNIVERSAL.fullmatch(kind)
    if match is None or match[1] == match[2]:
        known = ["SPHERICAL", "FIXED", "UJOINT_XY", "UJOINT_YZ", "UJOINT_ZX", "UJOINT_ZY"]
        raise ValueError(f"unknown type '{kind}'{did_you_mean(kind, known)}; known: {listed(known)}")
    first, second = match[1], match[2]
    between = f"{joint.name}_{first}"
    links.append(Link(between, 0.0, np.zeros(3), np.zeros((3, 3)), joint.line))
    revolute: Literal["revolute"] = "revolute"
    return [
        replace(free, name=between, kind=revolute, child=between, axis=AXES[first]),
        replace(
            free,
            name=f"{joint.name}_{second}",
            kind=revolute,
            parent=between,
            placement=np.eye(4),
            axis=AXES[second],
        ),
    ]


def _motor_names(robot: RobotFile, stated: list[str] | str) -> tuple[str, ...]:
    """Return the driven joints; a word that names no joint means every joint whose name contains it."""
    joints = [joint.name for joint in robot.joints]
    names: list[str] = []
    for word in [stated] if isinstance(stated, str) else stated:
        found = [word] if word in joints else [name for name in joints if word and word in name] or [word]
        if found != [word]:
            robot.notes.append(f"name_mot '{word}' names no joint; it stands for {listed(found)}")
        names += [name for name in found if name not in names]
    return tuple(names)
