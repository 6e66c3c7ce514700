"""Read an MJCF file: MuJoCo compiles it, and the compiled model becomes records.

Forces and constraints that hybridyn does not have are errors. Contacts and servos are noted.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from ..robot_file import RobotFile
from ..urdf.xml_node import Node
from .actuators import add_actuators
from .bodies import add_bodies
from .compiling import Compiled, compile_text
from .document import Document
from .equalities import add_equalities
from .keyframes import add_home
from .meshes import take_meshes
from .passive import add_passive
from .roots import find_root
from .screening import screen

#: Parts of dynamics that `<flag>` can disable; hybridyn takes them by `effects=` instead.
FLAGS = ("passive", "spring", "damper", "frictionloss", "limit", "actuation")


def read_mjcf(root: Node, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> RobotFile:
    """Read the root element of an MJCF file.

    Args:
        root: Root element `<mujoco>`; it is changed.
        package_dirs: Folders, beside the robot's own, from which includes and meshes may be read.

    Raises:
        ModelError: MuJoCo is not installed, MuJoCo refuses the file, or the file states something that
            hybridyn does not have.
    """
    document = Document(root, [os.fspath(folder) for folder in package_dirs])
    pairs = any(node.tag == "pair" for node in document.nodes())
    meshes: dict[str, bytes] = {}
    for one in document.every():
        screen(one)
        take_meshes(one, meshes)
    compiled = compile_text(document, meshes)
    if compiled.model.nbody == 1:
        raise root.error("no <body> stands in <worldbody>; a robot has at least one")
    start = find_root(compiled)
    robot = RobotFile(str(root.xml.get("model", "")).strip() or "robot", root.file, format="MJCF")
    robot.base = "fixed" if start.joint is None else "floating"
    add_bodies(robot, compiled, start)
    add_passive(robot, compiled, start)
    add_equalities(robot, compiled)
    add_actuators(robot, compiled)
    add_home(robot, compiled, start)
    robot.gravity = _gravity(compiled)
    robot.notes += [note for one in document.every() for note in one.notes]
    robot.notes += _notes(compiled, start.note, pairs or _can_touch(compiled))
    return robot


def _can_touch(compiled: Compiled) -> bool:
    """Say whether geoms of two bodies could touch in MuJoCo."""
    model = compiled.model
    if model.opt.disableflags & compiled.code("mjDSBL_CONTACT"):
        return False
    geoms = {*zip(model.geom_bodyid, model.geom_contype, model.geom_conaffinity, strict=True)}
    masks: dict[tuple[int, int], set[int]] = {}
    for body, contype, conaffinity in geoms:
        masks.setdefault((int(contype), int(conaffinity)), set()).add(int(body))
    return any(
        first[0] & second[1] and len(bodies | others) > 1
        for first, bodies in masks.items()
        for second, others in masks.items()
    )


def _gravity(compiled: Compiled) -> tuple[float, float, float]:
    """Return the acceleration of gravity that the file states [m/s^2]."""
    if compiled.model.opt.disableflags & compiled.code("mjDSBL_GRAVITY"):
        return 0.0, 0.0, 0.0
    x, y, z = (float(number) for number in np.asarray(compiled.model.opt.gravity))
    return x, y, z


def _notes(compiled: Compiled, left_out: str, contacts: bool) -> list[str]:
    """Return remarks on what is not read though MuJoCo computes with it."""
    out = [left_out] if left_out else []
    if contacts:
        out.append(
            "contacts between geoms are not read: the robot touches nothing (the effect ground_contact has "
            "points on compliant ground)"
        )
    flags = compiled.model.opt.disableflags
    disabled = [word for word in FLAGS if flags & max(compiled.code(f"mjDSBL_{word.upper()}"), 0)]
    if disabled:
        out.append(f"<flag> disables {', '.join(disabled)}; hybridyn reads them all the same, for effects=")
    return out
