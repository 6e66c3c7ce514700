"""Write a URDF: links, joints, closures, couplings, transmissions; what it cannot say goes to files beside.

Plain URDF readers take the spanning tree and skip `<loop>` and `<coupling>`.
"""

from __future__ import annotations

import json
from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import Coupling, Description, Joint, Link
from ...description.robot_file import FREEDOMS
from ...description.side_cars.model_text import model_file
from ...description.urdf.shapes import Shape
from ...description.urdf.urdf import INERTIA_ATTRIBUTES, UNLIMITED
from ..numerals import add, numerals, put
from ..request import LIMITS, USUAL_GRAVITY, Losses, Request, Written, add_limits
from .closures import add_closure, add_couplings, add_origin


def write_urdf(request: Request, losses: Losses) -> Written:
    """Write a robot as URDF."""
    d = request.description
    root = ET.Element("robot", name=d.name)
    for link in d.links:
        element = _add_link(root, link)
        for shape in request.shapes:
            if shape.link == link.name:
                _add_visual(element, shape)
    elements = {j.name: _add_joint(root, j, endless=j.name in d.endless_gears) for j in d.joints}
    for closure in d.closures:
        add_closure(root, closure, losses)
    couplings = add_couplings(root, d, elements, losses)
    for motor in d.motors:
        element = add(root, "transmission", name=f"{motor}_transmission")
        add(element, "type").text = "transmission_interface/SimpleTransmission"
        add(element, "joint", name=motor)
        add(element, "actuator", name=f"{motor}_motor")
    _add_losses(d, losses)
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    return Written(text, *_beside(d, couplings))


def _add_link(root: ET.Element, link: Link) -> ET.Element:
    element = add(root, "link", name=link.name)
    if link.mass or link.inertia.any():
        inertial = add(element, "inertial")
        if link.com.any():
            add(inertial, "origin", xyz=link.com)
        add(inertial, "mass", value=link.mass)
        moments = link.inertia[np.triu_indices(3)].tolist()
        add(inertial, "inertia", **dict(zip(INERTIA_ATTRIBUTES, moments, strict=True)))
    return element


def _add_visual(link: ET.Element, shape: Shape) -> None:
    visual = add(link, "visual")
    add_origin(visual, shape.placement)
    element = add(add(visual, "geometry"), shape.kind)
    if shape.kind == "box":
        put(element, size=shape.size)
    elif shape.kind == "mesh":
        scale = shape.size if any(factor != 1 for factor in shape.size) else None
        put(element, filename=shape.file, scale=scale)
    else:
        put(element, **dict(zip(("radius", "length"), shape.size, strict=False)))
    if shape.colour is not None:
        material = add(visual, "material", name=f"rgba {numerals(shape.colour)}")
        add(material, "color", rgba=shape.colour)


def _add_joint(root: ET.Element, joint: Joint, *, endless: bool) -> ET.Element:
    """Add a joint; a ball is written as a hinge, which the side-car retypes.

    Args:
        endless: Whether it is a gear that turns without limits, which URDF calls continuous.
    """
    kind = "continuous" if endless else "revolute" if joint.kind == "spherical" else joint.kind
    element = add(root, "joint", name=joint.name, type=kind)
    add_origin(element, joint.placement)
    add(element, "parent", link=joint.parent)
    add(element, "child", link=joint.child)
    if FREEDOMS[joint.kind] == 1 or joint.kind == "planar":
        add(element, "axis", xyz=joint.axis)
    _add_limit(element, joint, kind in ("revolute", "prismatic"))
    if joint.damping or joint.friction:
        add(element, "dynamics", damping=joint.damping, friction=joint.friction)
    if joint.rotor_inertia:
        add(element, "rotor_inertia", value=joint.rotor_inertia)
    if joint.gear_ratio != 1:
        add(element, "gear_ratio", value=joint.gear_ratio)
    return element


def _add_limit(element: ET.Element, joint: Joint, required: bool) -> None:
    """Add `<limit>`, which other readers require of hinges and slides, all numbers finite."""
    bounds = {word: getattr(joint, word) for word in ("lower", "upper", "effort", "velocity")}
    if required or np.isfinite([*bounds.values()]).any():
        limit = add(element, "limit")
        for word, bound in bounds.items():
            if required or word in ("effort", "velocity"):
                put(limit, **{word: float(np.clip(bound, -UNLIMITED, UNLIMITED))})


def _add_losses(d: Description, losses: Losses) -> None:
    for joint in d.joints:
        add_limits(joint, losses, LIMITS if joint.kind == "spherical" else LIMITS[:2])
    if d.base == "floating":
        losses.add("the base floats, which URDF cannot say: load the file with base='floating'")
        if d.base_home is not None:
            losses.add("pose of the floating base in the home posture")
    if d.gravity is not None and not np.allclose(d.gravity, USUAL_GRAVITY, rtol=0, atol=1e-12):
        losses.add(f"gravity of {numerals(d.gravity)} m/s^2, which URDF cannot say")


def _beside(d: Description, couplings: list[Coupling]) -> tuple[tuple[str, ...], dict[str, str]]:
    """Return the notes, and the files beside.

    These are a model file with home, effects, couplings, and that nothing is driven, which URDF cannot say;
    and a side-car that makes balls of hinges.
    """
    notes, effects = [], [name for name, _ in d.effects]
    model = model_file(d, motors=not d.motors, home=True, couplings=couplings, effects=effects)
    files = {".model.toml": model} if model else {}
    if d.closures or d.couplings:
        notes.append("<loop> and <coupling> are read by hybridyn; most other URDF readers skip them")
    if balls := [joint.name for joint in d.joints if joint.kind == "spherical"]:
        notes.append("ball joints are hinges in the URDF, which the .yaml beside it makes balls again")
        types = json.dumps(["SPHERICAL"] * len(balls))
        files[".yaml"] = f"joint_name: {json.dumps(balls)}\njoint_type: {types}\n"
    return tuple(notes), files
