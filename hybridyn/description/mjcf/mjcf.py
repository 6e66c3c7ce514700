"""Read an MJCF file: MuJoCo compiles it, and the compiled model becomes records.

Forces and constraints that hybridyn does not have are errors. Contacts and servos are noted.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

import numpy as np

from ..names import listed
from ..records import Array, RobotFile
from ..urdf.xml_node import Node
from .bodies import add_bodies, find_root
from .compiling import Compiled, compile_text
from .document import Document
from .relations import add_actuators, add_equalities
from .screening import screen

#: Name of the keyframe that is home where there are several.
HOME = "home"
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
    pairs = bool(document.nodes("//pair"))
    meshes: dict[str, bytes] = {}
    for one in document.every():
        screen(one, meshes)
    compiled = compile_text(document, meshes)
    robot = RobotFile(str(root.xml.get("model", "")).strip() or "robot", root.file, format="MJCF")
    start = find_root(robot, compiled)
    add_bodies(robot, compiled, start, _home(robot, compiled))
    add_equalities(robot, compiled)
    add_actuators(robot, compiled)
    robot.notes += [note for one in document.every() for note in one.notes]
    robot.notes += _notes(compiled, start, pairs)
    x, y, z = (float(number) for number in compiled.model.opt.gravity)
    off = compiled.model.opt.disableflags & compiled.code("mjDSBL_GRAVITY")
    robot.gravity = (0.0, 0.0, 0.0) if off else (x, y, z)
    return robot


def _home(robot: RobotFile, compiled: Compiled) -> Array:
    """Return the home posture, MuJoCo's `qpos`: the keyframe "home", else the first, else `qpos0`."""
    model = compiled.model
    if not model.nkey:
        return np.array(model.qpos0)
    names = [compiled.name("key", number) for number in range(model.nkey)]
    if model.nkey > 1 and HOME not in names:
        robot.notes.append(
            f"home is the first of {model.nkey} keyframes ('{names[0]}'); to use another one, rename it "
            f"to 'home': {listed(names[1:])}"
        )
    return np.array(model.key_qpos[names.index(HOME) if HOME in names else 0])


def _notes(compiled: Compiled, root: int, pairs: bool) -> Iterator[str]:
    """Yield what is not read though MuJoCo computes with it; `pairs`: whether `<contact>` names geoms."""
    model = compiled.model
    if still := [compiled.bodies[body] for body in np.flatnonzero(np.asarray(model.body_mocapid) >= 0)]:
        yield f"mocap bodies are read as fixed: {listed(still)}"
    if fluid := [word for word in ("density", "viscosity") if getattr(model.opt, word)]:
        yield f"forces of a fluid are not read: <option {' '.join(fluid)}>"
    if model.tendon_limited.any():
        names = (compiled.name("tendon", n) or str(n) for n in np.flatnonzero(model.tendon_limited).tolist())
        yield f"limits of tendons are not read: {listed(names)}"
    others = [name for name, top in zip(compiled.bodies, model.body_rootid, strict=True) if top != root]
    if root and others[1:]:
        yield (
            f"bodies {listed(others[1:])} do not move and have no joint; they are left out, because the base "
            "floats"
        )
    of_free = model.dof_armature[model.jnt_dofadr[model.jnt_type == compiled.code("mjJNT_FREE")]]
    if of_free.any():
        yield "free joints with armature are read as three slides and a ball, which have it in MuJoCo's rates"
    if pairs or _can_touch(compiled):
        yield (
            "contacts between geoms are not read: the robot touches nothing (the effect ground_contact has "
            "points on compliant ground)"
        )
    flags = model.opt.disableflags
    if disabled := [word for word in FLAGS if flags & max(compiled.code(f"mjDSBL_{word.upper()}"), 0)]:
        yield f"<flag> disables {', '.join(disabled)}; hybridyn reads them all the same, for effects="


def _can_touch(compiled: Compiled) -> bool:
    """Say whether geoms of two bodies could touch in MuJoCo."""
    model = compiled.model
    if model.opt.disableflags & compiled.code("mjDSBL_CONTACT"):
        return False
    bodies, masks = model.geom_bodyid, (model.geom_contype, model.geom_conaffinity)
    for bit in range(32):
        first, second = ({*bodies[(mask >> bit) & 1 == 1].tolist()} for mask in masks)
        if first and second and len(first | second) > 1:
            return True
    return False
