"""Write SDF: links, joints, loop joints; what it cannot say goes to the model file beside it.

SDF has no home posture: joints are at zero where the links stand. Loops have to be closed there. A robot with
closures therefore stands at home, and a tree at zero, but for its free bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from ...description.names import noted, unique
from ...description.placement import angle_of, free_pose, motion_of, poses_at
from ...description.records import Coupling, Description, Joint, Link
from ...description.side_cars.model_text import model_file
from ...description.urdf.shapes import Shape
from ..home import home_of
from ..request import Losses, Request, Written, allowed
from .joints import TYPES, add, add_closure, add_couplings, add_inertial, add_joint, add_pose, start_joint

#: Version that is written: the first whose `<mimic>` names an axis.
VERSION = "1.11"

#: Namespace of rotors, which are not SDF's own.
DRAKE = "http://drake.mit.edu"


def write_sdf(request: Request, losses: Losses) -> Written:
    """Write a robot as SDF."""
    d = counted_from_home(allowed(request.description, losses, "SDF", _name), losses)
    poses = poses_at(d, {})
    holder = root = ET.Element("sdf", version=VERSION)
    if d.gravity is not None:
        holder = add(root, "world", {"gravity": np.array(d.gravity)}, name="world")
    model = add(holder, "model", name=d.name)
    if d.base == "floating" and d.base_home is not None:
        add_pose(model, free_pose(d.base_home))
    above = {joint.child: joint for joint in d.joints}
    for link in d.links:
        _add_link(model, link, above.get(link.name), request.shapes, losses)
    if d.base == "fixed" and d.root != "world":
        names = {joint.name for joint in d.joints} | {link.name for link in d.links}
        start_joint(model, unique("anchor", names), "fixed", "world", d.root)
    springs = {spring.name: (spring.stiffness, spring.rest) for spring in d.springs}
    elements = {}
    for joint in d.joints:
        element = add_joint(model, joint, springs.get(joint.name, (0.0, 0.0)), poses, losses)
        if element is not None:
            elements[joint.name] = element
    for closure in d.closures:
        add_closure(model, closure, poses, losses)
    couplings = add_couplings(d.couplings, elements, losses)
    if any(element.tag.startswith("drake:") for element in root.iter()):
        root.set("xmlns:drake", DRAKE)
    ET.indent(root)
    text = '<?xml version="1.0"?>\n' + ET.tostring(root, encoding="unicode") + "\n"
    beside = model_file(
        replace(d, home=_home(d)), motors=True, home=True, couplings=couplings,
        effects=[name for name, _ in d.effects if name != "spring"],
    )  # fmt: skip
    return Written(text, tuple(_notes(d, couplings)), {".model.toml": beside})


def _name(name: str) -> str:
    """Return a name without `::` that is none of SDF's own."""
    new = name.replace("::", "__")
    own = new == "world" or (new.startswith("__") and new.endswith("__"))
    return f"{new.strip('_')}_link" if own else new


def _add_link(
    model: ET.Element, link: Link, above: Joint | None, shapes: tuple[Shape, ...], losses: Losses
) -> None:
    """Add a link, where it stands relative to its parent; the link of the world is SDF's own."""
    if link.name == "world":
        if link.mass or link.inertia.any():
            losses.add("mass and inertia of the world's link, which do not move", link.name)
        return
    element = add(model, "link", name=link.name)
    if above is not None:
        relative = {} if above.parent == "world" else {"relative_to": above.parent}
        add_pose(element, above.placement, **relative)
    add_inertial(element, link.mass, link.com, link.inertia)
    for number, shape in enumerate(shape for shape in shapes if shape.link == link.name):
        visual = add(element, "visual", name=f"{link.name}_{number}")
        add_pose(visual, shape.placement)
        content: dict[str, Any] = {"size": shape.size}
        if shape.kind == "mesh":
            content = {"uri": shape.file, "scale": shape.size}
        elif shape.kind != "box":
            content = dict(zip(("radius", "length"), shape.size, strict=False))
        add(add(visual, "geometry"), shape.kind, content)
        if shape.colour is not None:
            add(visual, "material", {"diffuse": shape.colour})


def counted_from_home(d: Description, losses: Losses) -> Description:
    """Return the same robot, whose joints are at zero where its links stand in the file.

    Args:
        d: The robot.
        losses: Receives the joints whose zero moves.
    """
    moved = [joint for joint in d.joints if d.closures or joint.kind == "floating"]
    home = {joint.name: d.home[joint.name] for joint in moved if joint.name in d.home}
    shift = {name: angle_of(x) for name, x in home.items() if len(x) in (1, 2)}  # of those with one freedom
    joints = []
    for joint in d.joints:
        motion, by = motion_of(joint, home), shift.get(joint.name, 0.0)
        if not np.array_equal(motion, np.eye(4)):
            if joint.kind != "floating":
                losses.add("positions of joints count from home, where the loops are closed", joint.name)
            joint = replace(joint, placement=joint.placement @ motion)
        joints.append(replace(joint, lower=joint.lower - by, upper=joint.upper - by))
    couplings = []
    for coupling in d.couplings:
        by = sum(factor * shift.get(name, 0.0) for name, factor in coupling.terms)
        couplings.append(replace(coupling, offset=coupling.offset - by))
    effects = tuple((name, _shifted(numbers, shift)) for name, numbers in d.effects)
    left = {name: x for name, x in d.home.items() if name not in home}
    out = replace(d, joints=tuple(joints), couplings=tuple(couplings), effects=effects, home=left)
    springs = [replace(spring, rest=spring.rest - shift.get(spring.name, 0.0)) for spring in d.springs]
    return out.with_springs(springs) if springs else out


def _shifted(numbers: dict[str, Any], shift: Mapping[str, float]) -> dict[str, Any]:
    """Return the numbers of an effect, whose limits by joint count from home."""
    limits = {
        key: {name: x - shift.get(name, 0.0) for name, x in numbers[key].items()}
        for key in ("lower", "upper") if key in numbers
    }  # fmt: skip
    return numbers | limits


def _home(d: Description) -> dict[str, tuple[float, ...]]:
    """Return the home position of each joint that the file has; a planar joint is three."""
    out: dict[str, tuple[float, ...]] = {}
    for joint in d.joints:
        if joint.name in d.home and joint.kind == "planar":
            names = (f"{joint.name}_x", f"{joint.name}_y", joint.name)
            out |= zip(names, zip(home_of(d, joint)), strict=True)
        elif joint.name in d.home and joint.kind in TYPES:
            out[joint.name] = d.home[joint.name]
    return out


def _notes(d: Description, couplings: list[Coupling]) -> list[str]:
    return noted({
        "links without mass, which Gazebo refuses: {}":
            [link.name for link in d.links if not link.mass and link.name != "world"],
        "couplings that only the model file beside it states: {}": [coupling.name for coupling in couplings],
    })  # fmt: skip
