"""Write SDF: links, joints, loop joints; what it cannot say goes to the model file beside it.

SDF has no home posture: joints are at zero where the links stand. Loops have to be closed there. A robot with
closures therefore stands at home, and a tree at zero, but for its free bodies.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...description.names import noted, unique
from ...description.placement import angle_of, free_pose, motion_of, poses_at
from ...description.records import Coupling, Description, Joint, Link
from ...description.shape_files import SIZES, Shape
from ...description.side_cars.companions import model_file
from ..home import home_of
from ..numerals import Content, document
from ..request import Losses, Request, Written, allowed, followers_of
from .joints import TYPES, Model, add_closure, add_joint, joint_of, link_of, pose

#: Version that is written: the first whose `<mimic>` names an axis.
VERSION = "1.11"

#: Namespace of rotors, which are not SDF's own.
DRAKE = "http://drake.mit.edu"


def write_sdf(request: Request, losses: Losses) -> Written:
    """Write a robot as SDF."""
    d = counted_from_home(allowed(request.description, losses, "SDF", _name), losses)
    poses, above = poses_at(d, {}), {joint.child: joint for joint in d.joints}
    model: Model = {"link": [], "joint": []}
    for link in d.links:
        if link.name != "world":
            model["link"].append(_link(link, above.get(link.name), request.shapes))
        elif link.mass or link.inertia.any():
            losses.add("mass and inertia of the world's link, which do not move", link.name)
    if d.base == "fixed" and d.root != "world":
        names = {joint.name for joint in d.joints} | {link.name for link in d.links}
        model["joint"].append(joint_of(unique("anchor", names), "fixed", "world", d.root))
    springs = {spring.name: (spring.stiffness, spring.rest) for spring in d.springs}
    mimics, couplings = followers_of(d.couplings, losses)
    for joint in d.joints:
        spring, mimic = springs.get(joint.name, (0.0, 0.0)), mimics.get(joint.name)
        add_joint(model, joint, spring, mimic, poses, losses)
    for closure in d.closures:
        add_closure(model, closure, poses, losses)
    at = pose(free_pose(d.base_home)) if d.base == "floating" and d.base_home is not None else None
    content: Content = {"model": {"@name": d.name, "pose": at, **model}}
    if d.gravity is not None:
        content = {"world": {"@name": "world", "gravity": np.array(d.gravity), **content}}
    rotors = any(tag.startswith("drake:") and x for one in model["joint"] for tag, x in one.items())
    text = document("sdf", {"@version": VERSION, "@xmlns:drake": DRAKE if rotors else None, **content})
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


def _link(link: Link, above: Joint | None, shapes: tuple[Shape, ...]) -> Content:
    """Return a link, where it stands relative to its parent, with its shapes."""
    at = pose(above.placement, None if above.parent == "world" else above.parent) if above else None
    own = enumerate(shape for shape in shapes if shape.link == link.name)
    return link_of(link, at, visual=[_visual(shape, f"{link.name}_{number}") for number, shape in own])


def _visual(shape: Shape, name: str) -> Content:
    sizes = {"box": ("size",), "mesh": ("scale",)} | SIZES
    numbers = shape.size if shape.kind in SIZES else [shape.size]
    size = {"uri": shape.file or None, **dict(zip(sizes[shape.kind], numbers, strict=True))}
    material = shape.colour and {"diffuse": shape.colour}
    return {
        "@name": name,
        "pose": pose(shape.placement),
        "geometry": {shape.kind: size},
        "material": material,
    }


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
