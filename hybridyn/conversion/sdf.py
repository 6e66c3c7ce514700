"""Write SDF: links, joints, loop joints; what it cannot say goes to the model file beside it.

SDF has no home posture: joints are at zero where the links stand. Loops have to be closed there. A robot with
closures therefore stands at home, and a tree at zero, but for its free bodies. Other programs take the
frames of a loop joint from this posture. A closure that is no type of SDF is written as slides along its free
axes, with massless links, and a loop joint behind them (see `parts`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ..description.closure_forms import FORMS, PERPENDICULAR
from ..description.joint_words import WORDS
from ..description.names import noted, unique
from ..description.placement import free_pose, inverse, poses_at, turned
from ..description.records import Array, Closure, Coupling, Description, Joint, Link
from ..description.rows import to_state
from ..description.sdf.elements import NUMBERS
from ..description.sdf.stated import SDF
from ..description.shape_files import SIZES, Shape
from ..description.side_cars.model_toml import model_file
from ..joints.kinds import JointKind, RotationKind
from ..linkage.closure_rows import residual_of
from .as_text import Content, angles_of, document
from .from_home import counted_from_home
from .parts import in_parts
from .renamed import allowed, without_joints
from .request import FORCES, FREED, ConversionRequest, Losses, Written, add_of_several, followers_of

#: Joints by the translations and the part of the rotation that they lock; of a hinge the one with limits.
TYPES = {FORMS[joint.closure][:2]: joint for joint in reversed(SDF.values()) if joint.closure}
#: Joints that SDF does not have; free ones are its free bodies.
LACKING = [kind for kind, words in WORDS.items() if not words.sdf and kind is not JointKind.FLOATING]

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


def _joint(joint: Joint, spring: tuple[float, float], mimic: tuple[str, float, float] | None) -> Content:
    """Return a joint of the tree that is no floating one.

    Args:
        joint: The joint.
        spring: Stiffness and rest position of its spring; stiffness 0 for none.
        mimic: Leader, factor and offset, where it follows another joint.
    """
    kind = WORDS[joint.kind].sdf
    if not joint.kind.single:
        return joint_of(joint.name, kind, joint.parent, joint.child)
    leader, *numbers = mimic or ("", 1.0, 0.0)
    follows = {"@joint": leader, **dict(zip(NUMBERS["mimic"], (*numbers, 0.0), strict=True))}
    bounds = {word: getattr(joint, word) for word in ("lower", "upper", "effort", "velocity")}
    limits = to_state(NUMBERS["limit"], bounds)
    forces = joint.damping, joint.friction, spring[1], spring[0]
    dynamics = dict(zip(NUMBERS["dynamics"], forces, strict=True))
    content = {
        "screw_thread_pitch": 2 * math.pi * joint.pitch or None,
        "drake:rotor_inertia": joint.rotor_inertia or None,
        "drake:gear_ratio": joint.gear_ratio if joint.gear_ratio != 1 else None,
        "axis": {
            "xyz": joint.axis, "limit": limits or None, "dynamics": dynamics if any(forces) else None,
            "mimic": follows if mimic else None,
        },
    }  # fmt: skip
    return joint_of(joint.name, kind, joint.parent, joint.child, **content)


def behind(closure: Closure) -> RotationKind | None:
    """Return the rotation that a closure locks behind slides, None for a type of SDF."""
    return None if (closure.translations, closure.rotation) in TYPES else closure.rotation


def _loop_joint(closure: Closure, poses: Mapping[str, Array], losses: Losses) -> Content:
    """Return a closure.

    Args:
        closure: The closure, which is a type of SDF.
        poses: Poses of the links in the posture of the file, shapes (4, 4).
        losses: Receives what SDF cannot say.
    """
    parent, child = closure.link_a, closure.link_b
    kind = TYPES[closure.translations, closure.rotation]
    has_axis = any(one.single for one in kind.chain)
    at_a, at_b = poses[parent] @ closure.frame_a, poses[child] @ closure.frame_b
    ends = ((M[:3, :3], M[:3, 3]) for M in (at_a, at_b))
    if np.abs(residual_of(closure.translations, closure.rotation, *ends)).max() > OPEN_AT_HOME:
        losses.add("closures that are open at home are closed there", closure.name)
    if child == "world":
        losses.add("closures with their ends exchanged, since SDF has no child 'world'", closure.name)
        parent, child = child, parent
    at = turned(at_a, closure.turn.T)
    return joint_of(
        closure.name, kind.sdf, parent, child, pose=pose(inverse(poses[child]) @ at),
        axis={"xyz": closure.turn[:, 2]} if has_axis else None,
        axis2={"xyz": at[:3, :3].T @ at_b[:3, 2]} if closure.rotation == PERPENDICULAR else None,
        physics={"simbody": {"must_be_loop_joint": "true"}},
    )  # fmt: skip


#: Version that is written: the first whose `<mimic>` names an axis.
VERSION = "1.11"

#: Namespace of rotors, which are not SDF's own.
DRAKE = "http://drake.mit.edu"


def write_sdf(request: ConversionRequest, losses: Losses) -> Written:
    """Write a robot as SDF."""
    d = counted_from_home(allowed(request.description, losses, "SDF", _name), losses)
    d = without_joints(d, [joint.name for joint in d.joints if joint.kind == "floating"], losses)
    parts = in_parts(d, losses, LACKING, behind)
    for joint in d.joints:
        if joint.kind == "floating":
            losses.add(FREED, joint.name)
        add_of_several(joint, losses, forces=FORCES[1:] if joint.kind in LACKING else FORCES)
    d = _with_free_bodies(counted_from_home(parts, Losses()))
    poses, above = poses_at(d, {}), {joint.child: joint for joint in d.joints}
    links = {link.name: link for link in d.links}
    world = links.pop("world", None)
    if world is not None and (world.mass or world.inertia.any()):
        losses.add("mass and inertia of the world's link, which do not move", world.name)
    joints = []
    if d.base == "fixed" and world is None:
        joints.append(
            joint_of(
                unique("anchor", {*links, *(joint.name for joint in d.joints)}), "fixed", "world", d.root
            )
        )
    springs = {spring.name: (spring.stiffness, spring.rest) for spring in d.springs}
    mimics, couplings = followers_of(d.couplings, losses)
    joints += [
        _joint(joint, springs.get(joint.name, (0.0, 0.0)), mimics.get(joint.name))
        for joint in d.joints if joint.kind != "floating"
    ]  # fmt: skip
    joints += [_loop_joint(closure, poses, losses) for closure in d.closures]
    bodies = [_link(link, above.get(name), request.shapes) for name, link in links.items()]
    at = pose(free_pose(d.base_home)) if d.base == "floating" and d.base_home is not None else None
    content: Content = {"model": {"@name": d.name, "pose": at, "link": bodies, "joint": joints}}
    if d.gravity is not None:
        content = {"world": {"@name": "world", "gravity": np.array(d.gravity), **content}}
    text = document("sdf", {"@version": VERSION, "@xmlns:drake": DRAKE, **content})
    beside = model_file(
        d, motors=True, home=True, couplings=couplings,
        effects=[name for name, _ in d.effects if name != "spring"],
    )  # fmt: skip
    return Written(text, tuple(_notes(d, couplings)), {".model.toml": beside})


def _with_free_bodies(d: Description) -> Description:
    """Return a robot whose floating joints start at the root, from where their bodies are at home."""
    poses = poses_at(d, d.home)
    start = inverse(poses[d.root])
    return replace(
        d,
        joints=tuple(
            replace(joint, parent=d.root, placement=start @ poses[joint.child])
            if joint.kind == "floating"
            else joint
            for joint in d.joints
        ),
    )


def _name(name: str) -> str:
    """Return a name without `::` and repeated blanks that is none of SDF's own."""
    new = " ".join(name.replace("::", "__").split())
    own = new == "world" or (new.startswith("__") and new.endswith("__"))
    return f"{new.strip('_')}_link" if own else new


def _link(link: Link, above: Joint | None, shapes: tuple[Shape, ...]) -> Content:
    """Return a link where it stands relative to its parent.

    It has its inertia, which SDF otherwise takes as 1 kg and 1 kg m^2, and its shapes.
    """
    at = pose(above.placement, None if above.parent == "world" else above.parent) if above else None
    moments = zip(NUMBERS["inertia"], link.inertia[np.triu_indices(3)], strict=True)
    inertial = {
        "pose": np.append(link.com, np.zeros(3)) if link.com.any() else None, "mass": link.mass,
        "inertia": dict(moments),
    }  # fmt: skip
    own = enumerate(shape for shape in shapes if shape.link == link.name)
    visuals = [_visual(shape, f"{link.name}_{number}") for number, shape in own]
    return {"@name": link.name, "pose": at, "inertial": inertial, "visual": visuals}


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


def _notes(d: Description, couplings: list[Coupling]) -> list[str]:
    return noted({
        "links without mass, which Gazebo refuses: {}":
            [link.name for link in d.links if not link.mass and link.name != "world"],
        "couplings that only the model file beside it states: {}": [coupling.name for coupling in couplings],
    })  # fmt: skip
