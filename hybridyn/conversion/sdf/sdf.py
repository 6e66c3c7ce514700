"""Write SDF: links, joints, loop joints; what it cannot say goes to the model file beside it."""

from __future__ import annotations

from dataclasses import replace
from xml.etree import ElementTree as ET

from ...description.names import listed
from ...description.placement import free_pose, poses_at
from ...description.records import Coupling, Description, Joint, Link
from ...description.side_cars.model_text import model_file
from ...description.urdf.shapes import Shape
from ..home import home_of
from ..numerals import numeral, numerals
from ..request import Losses, Request, Written, allowed
from .closures import add_closure
from .couplings import add_couplings
from .joints import TYPES, add_inertial, add_joint, add_pose, start_joint
from .posture import counted_from_home

#: Version that is written: the first whose `<mimic>` names an axis.
VERSION = "1.11"

#: Namespace of rotors, which are not SDF's own.
DRAKE = "http://drake.mit.edu"


def write_sdf(request: Request, losses: Losses) -> Written:
    """Write a robot as SDF."""
    d = counted_from_home(allowed(request.description, losses, "SDF", _name), losses)
    poses = poses_at(d, {})
    root = ET.Element("sdf", version=VERSION)
    holder = root
    if d.gravity is not None:
        holder = ET.SubElement(root, "world", name="world")
        ET.SubElement(holder, "gravity").text = numerals(d.gravity)
    model = ET.SubElement(holder, "model", name=d.name)
    if d.base == "floating" and d.base_home is not None:
        add_pose(model, free_pose(d.base_home))
    above = {joint.child: joint for joint in d.joints}
    for link in d.links:
        _add_link(model, link, above.get(link.name), request.shapes, losses)
    if d.base == "fixed" and d.root != "world":
        names = {joint.name for joint in d.joints} | {link.name for link in d.links}
        anchor = next(name for n in range(len(names) + 1) if (name := f"anchor{n or ''}") not in names)
        start_joint(model, anchor, "fixed", "world", d.root)
    springs = {spring.name: (spring.stiffness, spring.rest) for spring in d.springs}
    elements = {}
    for joint in d.joints:
        element = add_joint(model, joint, springs.get(joint.name, (0.0, 0.0)), losses)
        if element is not None:
            elements[joint.name] = element
    for closure in d.closures:
        add_closure(model, closure, poses, losses)
    couplings = add_couplings(d, elements, losses)
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
    model: ET.Element,
    link: Link,
    above: Joint | None,
    shapes: tuple[Shape, ...],
    losses: Losses,
) -> None:
    """Add a link, where it stands relative to its parent; the link of the world is SDF's own."""
    if link.name == "world":
        if link.mass or link.inertia.any():
            losses.add("mass and inertia of the world's link, which do not move", link.name)
        return
    element = ET.SubElement(model, "link", name=link.name)
    if above is not None:
        add_pose(
            element, above.placement, **({} if above.parent == "world" else {"relative_to": above.parent})
        )
    add_inertial(element, link.mass, link.com, link.inertia)
    for number, shape in enumerate(shape for shape in shapes if shape.link == link.name):
        _add_visual(element, f"{link.name}_{number}", shape)


def _add_visual(link: ET.Element, name: str, shape: Shape) -> None:
    visual = ET.SubElement(link, "visual", name=name)
    add_pose(visual, shape.placement)
    geometry = ET.SubElement(ET.SubElement(visual, "geometry"), shape.kind)
    if shape.kind == "box":
        ET.SubElement(geometry, "size").text = numerals(shape.size)
    elif shape.kind == "mesh":
        ET.SubElement(geometry, "uri").text = shape.file
        ET.SubElement(geometry, "scale").text = numerals(shape.size)
    else:
        for tag, value in zip(("radius", "length"), shape.size, strict=False):
            ET.SubElement(geometry, tag).text = numeral(value)
    if shape.colour is not None:
        ET.SubElement(ET.SubElement(visual, "material"), "diffuse").text = numerals(shape.colour)


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
    out = []
    if light := [link.name for link in d.links if not link.mass and link.name != "world"]:
        out.append(f"links without mass, which Gazebo refuses: {listed(light)}")
    if couplings:
        names = listed(coupling.name for coupling in couplings)
        out.append(f"couplings that only the model file beside it states: {names}")
    return out
