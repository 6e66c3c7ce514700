"""Write a URDF: links, joints, closures, couplings, transmissions; what it cannot say goes to files beside.

Plain URDF readers take the spanning tree and skip `<loop>` and `<coupling>`.
"""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import Array, Coupling, Description, Joint, Link
from ...description.robot_file import FREEDOMS
from ...description.side_cars.model_text import model_file
from ...description.urdf.urdf import UNLIMITED
from ..numerals import angles_of, numeral, numerals
from ..request import LIMITS, USUAL_GRAVITY, Losses, Request, Written, add_limits
from .closures import add_closure
from .couplings import add_couplings
from .visuals import add_visual


def write_urdf(request: Request, losses: Losses) -> Written:
    """Write a robot as URDF."""
    d = request.description
    root = ET.Element("robot", name=d.name)
    for link in d.links:
        element = _add_link(root, link)
        for shape in request.shapes:
            if shape.link == link.name:
                add_visual(element, shape)
    elements = {j.name: _add_joint(root, j, endless=j.name in d.endless_gears) for j in d.joints}
    for closure in d.closures:
        add_closure(root, closure, losses)
    couplings = add_couplings(root, d, elements, losses)
    for motor in d.motors:
        _add_transmission(root, motor)
    _add_losses(d, losses)
    ET.indent(root)
    beside = {".model.toml": _model_file(d, couplings), ".yaml": _side_car(d)}
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    return Written(text, tuple(_notes(d)), {key: out for key, out in beside.items() if out})


def add_origin(element: ET.Element, placement: Array) -> None:
    """Add `<origin>` to an element, unless the placement is the identity."""
    if not np.array_equal(placement, np.eye(4)):
        angles = angles_of(placement[:3, :3])
        ET.SubElement(element, "origin", xyz=numerals(placement[:3, 3]), rpy=numerals(angles))


def _add_link(root: ET.Element, link: Link) -> ET.Element:
    element = ET.SubElement(root, "link", name=link.name)
    if not link.mass and not link.inertia.any():
        return element
    inertial = ET.SubElement(element, "inertial")
    if link.com.any():
        ET.SubElement(inertial, "origin", xyz=numerals(link.com))
    ET.SubElement(inertial, "mass", value=numeral(link.mass))
    words = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    moments = link.inertia[np.triu_indices(3)]
    ET.SubElement(
        inertial, "inertia", {word: numeral(moment) for word, moment in zip(words, moments, strict=True)}
    )
    return element


def _add_joint(root: ET.Element, joint: Joint, *, endless: bool) -> ET.Element:
    """Add a joint; a ball is written as a hinge, which the side-car retypes.

    Args:
        endless: Whether it is a gear that turns without limits, which URDF calls continuous.
    """
    kind = "continuous" if endless else "revolute" if joint.kind == "spherical" else joint.kind
    element = ET.SubElement(root, "joint", name=joint.name, type=kind)
    add_origin(element, joint.placement)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    if FREEDOMS[joint.kind] == 1 or joint.kind == "planar":
        ET.SubElement(element, "axis", xyz=numerals(joint.axis))
    _add_limit(element, joint, kind in ("revolute", "prismatic"))
    if joint.damping or joint.friction:
        ET.SubElement(element, "dynamics", damping=numeral(joint.damping), friction=numeral(joint.friction))
    if joint.rotor_inertia:
        ET.SubElement(element, "rotor_inertia", value=numeral(joint.rotor_inertia))
    if joint.gear_ratio != 1:
        ET.SubElement(element, "gear_ratio", value=numeral(joint.gear_ratio))
    return element


def _add_limit(element: ET.Element, joint: Joint, required: bool) -> None:
    """Add `<limit>`, which other readers require of hinges and slides, all numbers finite."""
    bounds = (joint.lower, joint.upper, joint.effort, joint.velocity)
    if not required and not np.isfinite(bounds).any():
        return
    lower, upper, effort, velocity = (float(np.clip(bound, -UNLIMITED, UNLIMITED)) for bound in bounds)
    limit = ET.SubElement(element, "limit")
    if required:
        limit.attrib.update(lower=numeral(lower), upper=numeral(upper))
    limit.attrib.update(effort=numeral(effort), velocity=numeral(velocity))


def _add_transmission(root: ET.Element, motor: str) -> None:
    element = ET.SubElement(root, "transmission", name=f"{motor}_transmission")
    ET.SubElement(element, "type").text = "transmission_interface/SimpleTransmission"
    ET.SubElement(element, "joint", name=motor)
    ET.SubElement(element, "actuator", name=f"{motor}_motor")


def _model_file(d: Description, couplings: list[Coupling]) -> str:
    """Return the model file: home, effects, couplings, and that nothing is driven, which URDF cannot say."""
    effects = [name for name, _ in d.effects]
    return model_file(d, motors=not d.motors, home=True, couplings=couplings, effects=effects)


def _side_car(d: Description) -> str:
    """Return the side-car that makes balls of hinges, "" if the robot has no balls."""
    names = [joint.name for joint in d.joints if joint.kind == "spherical"]
    if not names:
        return ""
    types = ["SPHERICAL"] * len(names)
    return f"joint_name: {json.dumps(names)}\njoint_type: {json.dumps(types)}\n"


def _add_losses(d: Description, losses: Losses) -> None:
    for joint in d.joints:
        add_limits(joint, losses, LIMITS if joint.kind == "spherical" else LIMITS[:2])
    if d.base == "floating":
        losses.add("the base floats, which URDF cannot say: load the file with base='floating'")
        if d.base_home is not None:
            losses.add("pose of the floating base in the home posture")
    if d.gravity is not None and not np.allclose(d.gravity, USUAL_GRAVITY, rtol=0, atol=1e-12):
        losses.add(f"gravity of {numerals(d.gravity)} m/s^2, which URDF cannot say")


def _notes(d: Description) -> list[str]:
    out = []
    if d.closures or d.couplings:
        out.append("<loop> and <coupling> are read by hybridyn; most other URDF readers skip them")
    if any(joint.kind == "spherical" for joint in d.joints):
        out.append("ball joints are hinges in the URDF, which the .yaml beside it makes balls again")
    return out
