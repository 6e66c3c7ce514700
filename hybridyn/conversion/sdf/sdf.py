"""Write SDF: links, joints, loop joints; what it cannot say goes to the model file beside it.

SDF has no home posture: joints are at zero where the links stand. Loops have to be closed there. A robot with
closures therefore stands at home, and a tree at zero, but for its free bodies. Other programs take the
frames of a loop joint from this posture. A closure that is no type of SDF is written as slides along its free
axes, with massless links, and a loop joint behind them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ...description.names import noted, unique
from ...description.placement import angle_of, free_pose, inverse, motion_of, placement_from, poses_at, turned
from ...description.records import (
    FREEDOMS,
    Array,
    Closure,
    Coupling,
    Description,
    Joint,
    Link,
    RotationKind,
    massless,
)
from ...description.sdf.elements import NUMBERS
from ...description.shape_files import SIZES, Shape
from ...description.side_cars.model_toml import model_file
from ...linkage.closures import residual_of
from ..home import home_of
from ..numerals import Content, angles_of, document
from ..request import Losses, Request, Written, add_limits, allowed, followers_of

#: World poses of links by name, shapes (4, 4), in the posture of the file.
Poses = dict[str, Array]

#: Links and joints of the model, to which writers add.
Model = dict[str, list[Content]]

#: Joints and links of slides by name: the axis of each, shape (3,), and its position [m].
Slides = Mapping[tuple[str, str], tuple[Array, float]]

#: Types of joints in SDF; a planar joint is two slides and an endless hinge.
TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic",
    "spherical": "ball", "planar": "continuous",
}  # fmt: skip

#: What becomes of joints that are no type of SDF.
REPLACED = {
    "floating": "floating joints have the name of their link and _free, and start at the world",
    "planar": "planar joints are two slides and a hinge",
}

#: Types of joints that lock every translation, by the locked part of the rotation.
POINTS: dict[RotationKind, str] = {
    "fixed": "fixed", "parallel": "revolute", "perpendicular": "universal", "free": "ball",
}  # fmt: skip

#: Opening of a closure in the posture of the file [m, or between unit axes] that is rounding.
OPEN_AT_HOME = 1e-9


def pose(placement: Array, frame: str | None = None) -> Content | None:
    """Return a placement (4, 4) as position, roll, pitch, yaw; None for the identity in the usual frame."""
    numbers = (*placement[:3, 3], *angles_of(placement[:3, :3]))
    stated = frame or not np.array_equal(placement, np.eye(4))
    return {"@relative_to": frame, "": numbers} if stated else None


def joint_of(name: str, kind: str, parent: str, child: str, **content: Any) -> Content:
    """Return a joint of a type of SDF between two links, of which the parent may be "world"."""
    return {"@name": name, "@type": kind, "parent": parent, "child": child, **content}


def link_of(link: Link, at: Content | None, **content: Any) -> Content:
    """Return a link with its inertia, which SDF otherwise takes as 1 kg and 1 kg m^2."""
    moments = zip(NUMBERS["inertia"], link.inertia[np.triu_indices(3)], strict=True)
    inertial = {
        "pose": np.append(link.com, np.zeros(3)) if link.com.any() else None,
        "mass": link.mass,
        "inertia": dict(moments),
    }
    return {"@name": link.name, "pose": at, "inertial": inertial, **content}


def add_joint(
    model: Model,
    joint: Joint,
    spring: tuple[float, float],
    mimic: tuple[str, float, float] | None,
    poses: Poses,
    losses: Losses,
) -> None:
    """Add a joint of the tree, but for a floating joint, which SDF states by having none.

    Args:
        model: Links and joints of the model.
        joint: The joint.
        spring: Stiffness and rest position of its spring; stiffness 0 for none.
        mimic: Leader, factor and offset, where it follows another joint.
        poses: Poses of the links in the posture of the file.
        losses: Receives what SDF cannot say.
    """
    if joint.kind in REPLACED:
        losses.add(REPLACED[joint.kind], joint.name)
    forces = joint.damping, joint.friction, joint.rotor_inertia, joint.gear_ratio - 1
    if FREEDOMS[joint.kind] > 1 and any(forces):
        losses.add("damping, friction and rotors of joints with several freedoms", joint.name)
    add_limits(joint, losses)
    parent, content = joint.parent, dict[str, Any]()
    if joint.kind == "planar":
        slides = {
            (f"{joint.name}_{x}", f"{joint.child}_{x}"): (np.eye(3)[i], 0.0) for i, x in enumerate("xy")
        }
        parent, content = _slid(model, parent, joint.placement, slides, poses), {"axis": {"xyz": joint.axis}}
    if FREEDOMS[joint.kind] == 1:
        leader, *numbers = mimic or ("", 1.0, 0.0)
        follows = {"@joint": leader, **dict(zip(NUMBERS["mimic"], (*numbers, 0.0), strict=True))}
        content = {
            "drake:rotor_inertia": joint.rotor_inertia or None,
            "drake:gear_ratio": joint.gear_ratio if joint.gear_ratio != 1 else None,
            "axis": {
                "xyz": joint.axis, **_numbers(joint, spring), "mimic": follows if mimic else None
            },
        }  # fmt: skip
    if joint.kind != "floating":
        model["joint"].append(joint_of(joint.name, TYPES[joint.kind], parent, joint.child, **content))


def _numbers(joint: Joint, spring: tuple[float, float]) -> dict[str, Content | None]:
    """Return the finite limits, the friction and the spring of a joint with one freedom."""
    words = ("effort", "velocity") if joint.kind == "continuous" else ("lower", "upper", "effort", "velocity")
    limits = {word: getattr(joint, word) for word in words if np.isfinite(getattr(joint, word))}
    forces = joint.damping, joint.friction, spring[1], spring[0]
    dynamics = dict(zip(NUMBERS["dynamics"], forces, strict=True))
    has_forces = joint.damping or joint.friction or spring[0]
    return {"limit": limits or None, "dynamics": dynamics if has_forces else None}


def _slid(model: Model, link: str, frame: Array, slides: Slides, poses: Poses) -> str:
    """Add slides from a frame (4, 4) of a link, each with a massless link, and return the last one.

    Args:
        model: Links and joints of the model.
        link: The link.
        frame: The frame.
        slides: The slides.
        poses: Poses of the links in the posture of the file; those of the massless links are added.
    """
    for (name, slider), (axis, position) in slides.items():
        at = frame @ placement_from(np.eye(3), position * axis)
        model["link"].append(link_of(massless(slider), pose(at, "__model__" if link == "world" else link)))
        model["joint"].append(joint_of(name, "prismatic", link, slider, axis={"xyz": axis}))
        poses[slider] = poses[link] @ at
        link, frame = slider, np.eye(4)
    return link


def add_closure(model: Model, closure: Closure, poses: Poses, losses: Losses) -> None:
    """Add a closure to a model.

    Args:
        model: Links and joints of the model.
        closure: The closure.
        poses: Poses of the links in the posture of the file; those of sliders are added.
        losses: Receives what SDF cannot say.
    """
    parent, child, frame, kind = closure.link_a, closure.link_b, closure.frame_a, POINTS[closure.rotation]
    locked, at_b = closure.translations, poses[child] @ closure.frame_b
    if locked == (0, 1) and closure.rotation == "fixed":
        kind = "prismatic"
    elif locked != (0, 1, 2):
        losses.add("closures are slides and a loop joint behind them, with massless links", closure.name)
        at_a = poses[parent] @ frame
        apart = at_a[:3, :3].T @ (at_b[:3, 3] - at_a[:3, 3])
        names = {i: f"{closure.name}_{'xyz'[i]}" for i in range(3) if i not in closure.translations}
        slides = {(name, f"{name}_slider"): (np.eye(3)[i], apart[i]) for i, name in names.items()}
        parent, frame, locked = _slid(model, parent, frame, slides, poses), np.eye(4), (0, 1, 2)
    at_a = poses[parent] @ frame
    off = residual_of(locked, closure.rotation, *((M[:3, :3], M[:3, 3]) for M in (at_a, at_b)))
    if np.abs(off).max() > OPEN_AT_HOME:
        losses.add("closures that are open at home are closed there", closure.name)
    if child == "world":
        losses.add("closures with their ends exchanged, since SDF has no child 'world'", closure.name)
        parent, child = child, parent
    at = turned(at_a, closure.turn.T)
    model["joint"].append(joint_of(
        closure.name, kind, parent, child, pose=pose(inverse(poses[child]) @ at),
        axis=None if kind in ("fixed", "ball") else {"xyz": closure.turn[:, 2]},
        axis2={"xyz": at[:3, :3].T @ at_b[:3, 2]} if kind == "universal" else None,
        physics={"simbody": {"must_be_loop_joint": "true"}},
    ))  # fmt: skip


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
