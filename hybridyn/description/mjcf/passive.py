"""Damping, friction, springs and armature of joints in a compiled MJCF model; other forces are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..names import listed
from ..records import Joint
from ..robot_file import FREEDOMS, RobotFile
from .compiling import Compiled
from .fields import nonzero, number
from .roots import Root, tied_bodies
from .tendons import limited, refuse_forces

#: What a joint may not have, by the name of MuJoCo's array: its name in the file, and the correction.
JOINT_FORCES = {
    "jnt_stiffnesspoly": ("stiffness that depends on the position", "keep its first number"),
    "jnt_springyield": ("springyield", "remove it"),
    "jnt_actgravcomp": ("actuatorgravcomp", "remove it"),
}
DOF_FORCES = {"dof_dampingpoly": ("damping that depends on the speed", "keep its first number")}

#: What only a joint with one freedom may have here; armature also a ball.
SINGLE = {"stiffness": "a spring", "frictionloss": "frictionloss", "armature": "armature"}


def add_passive(robot: RobotFile, compiled: Compiled, root: Root) -> None:
    """Add damping, friction, armature and springs to the robot's joints.

    Args:
        robot: The robot, with its joints.
        root: The robot's root, whose free joint is no joint of the tree.

    Raises:
        ModelError: The file states a passive force that hybridyn does not have.
    """
    _refuse_others(compiled)
    model = compiled.model
    numbers = {name: index for index, name in enumerate(compiled.joints)}
    stiffness: dict[str, float] = {}
    rest: dict[str, float] = {}
    if root.joint is not None:
        _refuse_on_base(compiled, root.joint)
    joints: list[Joint] = []
    for joint in robot.joints:
        if joint.kind != "fixed":
            index = numbers[joint.name]
            dof = int(model.jnt_dofadr[index])
            _refuse_on_joint(compiled, index, dof, FREEDOMS[joint.kind])
            joint = replace(
                joint,
                damping=number(model, "dof_damping", dof),
                friction=number(model, "dof_frictionloss", dof),
                rotor_inertia=number(model, "dof_armature", dof),
                effort=_effort(model, index),
            )
            if nonzero(model, "jnt_stiffness", index):
                stiffness[joint.name] = number(model, "jnt_stiffness", index)
                rest[joint.name] = float(model.qpos_spring[model.jnt_qposadr[index]])
        joints.append(joint)
    robot.joints = joints
    if stiffness:
        robot.effects += (("spring", {"stiffness": stiffness, "rest": rest}),)
    if still := [compiled.bodies[body] for body in np.flatnonzero(np.asarray(model.body_mocapid) >= 0)]:
        robot.notes.append(f"mocap bodies are read as fixed: {listed(still)}")
    if fluid := [word for word in ("density", "viscosity") if getattr(model.opt, word)]:
        robot.notes.append(f"forces of a fluid are not read: <option {' '.join(fluid)}>")
    if tendons := limited(compiled):
        robot.notes.append(f"limits of tendons are not read: {listed(tendons)}")


def _effort(model: Any, joint: int) -> float:
    """Return the largest effort of all actuators together at a joint, infinite where the file states none."""
    if model.jnt_actfrclimited[joint]:
        return float(np.abs(model.jnt_actfrcrange[joint]).max())
    return float(np.inf)


def _refuse_others(compiled: Compiled) -> None:
    """Refuse forces that act on bodies and tendons."""
    model = compiled.model
    for body in range(model.nbody):
        if model.body_gravcomp[body]:
            raise compiled.error("body", body, "gravcomp is not read; remove it, or state it as a wrench")
    refuse_forces(compiled)
    tied = {body for pair in tied_bodies(compiled).values() for body in pair}
    for body in sorted(tied):
        if model.body_mocapid[body] >= 0:
            raise compiled.error(
                "body", body, "a program moves a mocap body; remove mocap, or give it joints"
            )


def _refuse_on_base(compiled: Compiled, joint: int) -> None:
    """Refuse springs, damping, friction and armature of the free joint of a floating base."""
    model = compiled.model
    dof = int(model.jnt_dofadr[joint])
    stated = {"stiffness": nonzero(model, "jnt_stiffness", joint)}
    for word in ("damping", "frictionloss", "armature"):
        stated[word] = bool(np.any(getattr(model, f"dof_{word}")[dof : dof + 6]))
    for word, present in stated.items():
        if present:
            raise compiled.error(
                "joint", joint, f"{word} of a free joint is not read; set it to 0, or write <freejoint/>, "
                "which takes no defaults",
            )  # fmt: skip
    _refuse_unread_forces(compiled, joint, dof)


def _refuse_unread_forces(compiled: Compiled, joint: int, dof: int) -> None:
    """Refuse forces of any joint that are not read."""
    for row, table in ((joint, JOINT_FORCES), (dof, DOF_FORCES)):
        for field, (word, correction) in table.items():
            if nonzero(compiled.model, field, row):
                raise compiled.error("joint", joint, f"{word} is not read; {correction}")


def _refuse_on_joint(compiled: Compiled, joint: int, dof: int, freedoms: int) -> None:
    """Refuse what a joint of the tree may not have."""
    model = compiled.model
    _refuse_unread_forces(compiled, joint, dof)
    if freedoms == 1:
        return
    present = {
        "stiffness": nonzero(model, "jnt_stiffness", joint),
        "frictionloss": nonzero(model, "dof_frictionloss", dof),
        "armature": freedoms > 3 and nonzero(model, "dof_armature", dof),
    }
    for word, name in SINGLE.items():
        if present[word]:
            raise compiled.error(
                "joint", joint, f"{name} of a joint with several freedoms is not read; set {word} to 0"
            )
