"""Write limits, damping, friction, rotors, springs and motors of joints."""

from __future__ import annotations

from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import Description, Joint
from ..numerals import numeral, numerals
from ..request import Losses, add_limits
from .bodies import PARTS, Tree

#: Effects that stand in the file itself; the others go to model.toml.
SAID = ("spring", "damper")


def add_forces(d: Description, tree: Tree, losses: Losses) -> None:
    """Add to each joint its limits and the forces that act in it.

    Args:
        losses: Receives what MuJoCo cannot say.
    """
    effects = dict(d.effects)
    driven = set(d.motors)
    for joint in d.joints:
        if joint.kind == "fixed":
            continue
        several = PARTS.get(joint.kind, ())
        names = [joint.name + ending for ending in several or ("",)]
        damping = joint.damping + effects.get("damper", {}).get("coefficient", {}).get(joint.name, 0.0)
        for name in names:
            element = tree.joints.get(name, tree.balls.get(name))
            if damping and element is not None:
                element.set("damping", numeral(damping))
        if damping != joint.damping:
            losses.add("dampers are read back as viscous friction, to which they are added", joint.name)
        if damping and names[0] not in {**tree.joints, **tree.balls}:
            losses.add("damping of free joints", joint.name)
        armature = joint.armature
        if armature and joint.kind == "spherical":
            tree.balls[joint.name].set("armature", numeral(armature))
            armature = 0.0
        if several and (joint.friction or armature):
            losses.add("dry friction and rotors of joints with several freedoms", joint.name)
        add_limits(joint, losses, ("lower", "upper", "effort_limit"))
        if joint.kind == "continuous":
            losses.add("continuous joints, which MuJoCo does not have: read back as hinges", joint.name)
        if np.isfinite(joint.speed_limit):
            losses.add("speed limits, which MuJoCo does not have", joint.name)
        if joint.gear_ratio != 1:
            losses.add("gear ratios: the rotor's inertia is written as that at the joint", joint.name)
        if joint.name in tree.joints:
            _add_to_single(joint, tree.joints[joint.name], effects, joint.name in driven, losses)


def _add_to_single(
    joint: Joint, element: ET.Element, effects: dict[str, dict[str, Any]], driven: bool, losses: Losses
) -> None:
    """Add limits, friction, rotor and spring to a joint with one freedom."""
    if np.isfinite(joint.lower) or np.isfinite(joint.upper):
        if joint.lower < joint.upper:
            bounds = (joint.lower, joint.upper)
            element.set("range", " ".join(numeral(x) if np.isfinite(x) else str(x) for x in bounds))
            element.set("limited", "true")
        else:
            losses.add("position limits without room between them, which MuJoCo refuses", joint.name)
    friction = effects.get("coulomb_friction", {}).get("level", {}).get(joint.name, joint.friction)
    for word, value in (("frictionloss", friction), ("armature", joint.armature)):
        if value:
            element.set(word, numeral(value))
    if friction != joint.friction:
        losses.add("levels of coulomb_friction are read back as dry friction, too", joint.name)
    if not driven and joint.effort_limit < np.inf:
        element.set("actuatorfrcrange", numerals((-joint.effort, joint.effort)))
        element.set("actuatorfrclimited", "true")
    spring = effects.get("spring", {})
    if stiffness := spring.get("stiffness", {}).get(joint.name):
        element.set("stiffness", numeral(stiffness))
        element.set("springref", numeral((spring.get("rest") or {}).get(joint.name, 0.0)))
        if joint.kind == "continuous":
            losses.add("springs of continuous joints: MuJoCo counts whole turns", joint.name)


def add_motors(root: ET.Element, d: Description) -> None:
    """Add a motor without gear for each driven joint: its control is the effort at the joint."""
    if not d.motors:
        return
    actuator = ET.SubElement(root, "actuator")
    limits = {joint.name: joint.effort_limit for joint in d.joints}
    for motor in d.motors:
        element = ET.SubElement(actuator, "motor", name=motor, joint=motor)
        if limits[motor] < np.inf:
            element.set("ctrlrange", numerals((-limits[motor], limits[motor])))
            element.set("ctrllimited", "true")
