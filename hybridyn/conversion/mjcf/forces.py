"""Write limits, damping, friction, rotors, springs and motors of joints."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import Description
from ...description.robot_file import FREEDOMS
from ..numerals import add, put
from ..request import Losses, add_limits
from .bodies import Tree

#: Effects that stand in the file itself; the others go to model.toml.
SAID = ("spring", "damper")


def with_effects(d: Description) -> Description:
    """Return a robot whose joints have the damping of dampers and the friction of its effects, too."""
    effects = dict(d.effects)
    dampers = effects.get("damper", {}).get("coefficient", {})
    levels = effects.get("coulomb_friction", {}).get("level", {})
    joints = (
        replace(
            joint,
            damping=joint.damping + dampers.get(joint.name, 0.0),
            friction=levels.get(joint.name, joint.friction),
        )
        for joint in d.joints
    )
    return replace(d, joints=tuple(joints))


def add_forces(root: ET.Element, d: Description, tree: Tree) -> None:
    """Add limits and forces to the joints of a robot of `parts`, and its motors to the root element.

    A motor has no gear: its control is the effort at the joint.
    """
    springs, driven = {spring.name: spring for spring in d.springs if spring.stiffness}, {*d.motors}
    limits = {joint.name: joint.effort_limit for joint in d.joints}
    for joint in d.joints:
        if joint.kind in ("fixed", "floating"):
            continue
        element = tree.joints[joint.name]
        put(element, damping=joint.damping or None, armature=joint.armature or None)
        if joint.kind == "spherical":
            continue
        put(element, frictionloss=joint.friction or None)
        if joint.lower < joint.upper and np.isfinite([joint.lower, joint.upper]).any():
            put(element, range=(joint.lower, joint.upper), limited="true")
        if joint.name not in driven and limits[joint.name] < np.inf:
            put(element, actuatorfrcrange=(-joint.effort, joint.effort), actuatorfrclimited="true")
        if spring := springs.get(joint.name):
            put(element, stiffness=spring.stiffness, springref=spring.rest)
    actuator = add(root, "actuator") if d.motors else root
    for motor in d.motors:
        element = add(actuator, "motor", name=motor, joint=motor)
        if limits[motor] < np.inf:
            put(element, ctrlrange=(-limits[motor], limits[motor]), ctrllimited="true")


def list_losses(d: Description, tree: Tree, losses: Losses) -> None:
    """List what MuJoCo cannot say of the joints of a robot as it is, without its effects."""
    springs = {spring.name for spring in d.springs if spring.stiffness}
    for old, joint in zip(d.joints, with_effects(d).joints, strict=True):
        freedoms, endless = FREEDOMS[joint.kind], joint.kind == "continuous"
        lost = {
            "dampers are read back as viscous friction, to which they are added": old.damping - joint.damping,
            "damping of free joints": joint.damping
            and joint.kind == "floating"
            and joint.name in tree.joints,
            "dry friction and rotors of joints with several freedoms": freedoms > 1
            and (old.friction or (joint.armature and joint.kind != "spherical")),
            "continuous joints, which MuJoCo does not have: read back as hinges": endless,
            "speed limits, which MuJoCo does not have": freedoms and np.isfinite(joint.speed_limit),
            "gear ratios: the rotor's inertia is written as that at the joint": freedoms
            and joint.gear_ratio != 1,
            "position limits without room between them, which MuJoCo refuses": freedoms == 1
            and not joint.lower < joint.upper,
            "levels of coulomb_friction are read back as dry friction, too": freedoms == 1
            and old.friction != joint.friction,
            "springs of continuous joints: MuJoCo counts whole turns": endless and joint.name in springs,
        }
        for reason, is_lost in lost.items():
            if is_lost:
                losses.add(reason, joint.name)
        if freedoms:
            add_limits(joint, losses, ("lower", "upper", "effort_limit"))
