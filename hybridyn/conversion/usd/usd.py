"""Write USD as text: one Xform with a rigid body for each link, joints, closures, and the scene's gravity.

Lengths are metres, z points up. What USD cannot say goes to the model file beside.
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from ...description.placement import free_pose, poses_at
from ...description.records import FREEDOMS, Coupling, Description, Joint
from ...description.side_cars.companions import model_file
from ..mjcf.bodies import POINT_INERTIA, sizes_of
from ..request import USUAL_GRAVITY, Losses, Request, Written, add_limits, allowed, followers_of
from .joints import End, add_closure, add_joint, axis_of, start_joint, unit_of
from .prims import Prim, add_body, add_shape


def write_usd(request: Request, losses: Losses) -> Written:
    """Write a robot as USD."""
    d = _with_inertias(allowed(request.description, losses, "USD", valid_name), losses)
    top = Prim("", "", "")
    robot = top.child("Xform", valid_name(d.name))
    if robot.name != d.name:
        losses.add("the name of the robot, which USD does not allow", d.name)
    base_home = d.base_home if d.base == "floating" else None
    poses = poses_at(d, d.home, None if base_home is None else free_pose(base_home))
    bodies = {link.name: add_body(robot, link, poses[link.name]) for link in d.links}
    names = dict(zip((link.name for link in request.description.links), bodies, strict=True))
    for shape in request.shapes:
        add_shape(bodies[names[shape.link]], shape, losses)
    held = robot.child("Scope", "joints")
    if d.base == "floating":
        bodies[d.root].apply("PhysicsArticulationRootAPI")
    else:
        ends = End(None, np.eye(4)), End(bodies[d.root], np.eye(4))
        start_joint(held, "root_joint", (), ends).apply("PhysicsArticulationRootAPI")
    motors = {*d.motors}
    joints = [
        add_joint(
            held, joint, (bodies[joint.parent], bodies[joint.child]), joint.name in motors,
            d.home.get(joint.name), losses,
        )
        for joint in d.joints
    ]  # fmt: skip
    closing = robot.child("Scope", "closures") if d.closures else robot
    for closure in d.closures:
        a, b = closure.link_a, closure.link_b
        add_closure(closing, closure, (bodies[a], bodies[b]), (poses[a], poses[b]), losses)
    by_name = {joint.name: (joint, prim) for joint, prim in zip(d.joints, joints, strict=True) if prim}
    followers, left = followers_of(d.couplings, losses)
    for name, (leader, factor, offset) in followers.items():
        _add_mimic(*by_name[name], *by_name[leader], factor, offset)
    _add_scene(top, d)
    for joint in d.joints:
        add_limits(joint, losses)
    model = _model_file(d, left)
    beside = {".model.toml": model} if model else {}
    return Written(_text(robot, top), tuple(_notes(d)), beside)


def valid_name(name: str) -> str:
    """Return a name as USD has them: letters, digits and underscores, no digit first."""
    valid = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"_{valid}" if valid[:1].isdigit() else valid


def _with_inertias(d: Description, losses: Losses) -> Description:
    """Return a robot without point masses: USD takes an inertia of zero for none stated."""
    size = sizes_of(d).size
    links = []
    for link in d.links:
        if link.mass and not link.inertia.any():
            losses.add("links without inertia, which USD cannot say: written with a small one", link.name)
            link = replace(link, inertia=POINT_INERTIA * link.mass * size**2 * np.eye(3))
        links.append(link)
    return replace(d, links=tuple(links))


def _text(robot: Prim, top: Prim) -> str:
    """Return the text of a file, whose default prim is the robot."""
    head = (
        f'#usda 1.0\n(\n    defaultPrim = "{robot.name}"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1\n'
        '    upAxis = "Z"\n)\n'
    )
    return head + "".join("\n" + "\n".join(prim.lines()) + "\n" for prim in top.children)


def _add_mimic(own: Joint, prim: Prim, leader: Joint, its_prim: Prim, factor: float, offset: float) -> None:
    """Add to a joint with one freedom that it follows another one, as a mimic joint of PhysX."""
    axis, unit = f"rot{axis_of(own.axis)[0]}", unit_of(own)
    prim.apply(f"PhysxMimicJointAPI:{axis}")
    prim.line(f"rel physxMimicJoint:{axis}:referenceJoint = <{its_prim.path}>")
    prim.line(f'uniform token physxMimicJoint:{axis}:referenceJointAxis = "rot{axis_of(leader.axis)[0]}"')
    prim.numbers("float", f"physxMimicJoint:{axis}:gearing", -factor * unit_of(leader) / unit)
    if offset:
        prim.numbers("float", f"physxMimicJoint:{axis}:offset", -offset / unit)


def _add_scene(top: Prim, d: Description) -> None:
    scene = top.child("PhysicsScene", "physics_scene")
    gravity = np.array(d.gravity or USUAL_GRAVITY)
    size = float(np.linalg.norm(gravity))
    scene.numbers("vector3f", "physics:gravityDirection", gravity / size if size else (0.0, 0.0, -1.0))
    scene.numbers("float", "physics:gravityMagnitude", size)


def _model_file(d: Description, couplings: list[Coupling]) -> str:
    """Return the model file: effects, other couplings, gears, and motors that drives do not state."""
    motors = {*d.motors}
    driven = [joint.name for joint in d.joints if joint.name in motors and joint.effort != 0]
    stated = [joint for joint in d.joints if FREEDOMS[joint.kind] == 1 or joint.kind == "spherical"]
    numbers = {joint.name: _numbers(joint) for joint in stated}
    return model_file(
        d,
        motors=not d.motors or tuple(driven) != d.motors,
        joints={name: table for name, table in numbers.items() if table},
        couplings=couplings,
        effects=[name for name, _ in d.effects],
    )


def _numbers(joint: Joint) -> dict[str, float]:
    """Return the numbers of a joint that its prim does not hold."""
    several = FREEDOMS[joint.kind] > 1
    out = {}
    if joint.gear_ratio != 1 or (several and joint.rotor_inertia):
        out = {"rotor_inertia": joint.rotor_inertia, "gear_ratio": joint.gear_ratio}
    if several:
        out |= {word: getattr(joint, word) for word in ("damping", "friction") if getattr(joint, word)}
    return out


def _notes(d: Description) -> list[str]:
    out = ["USD states frames, masses and limits in single precision, with 7 digits"]
    if any(not link.mass for link in d.links):
        out.append("links without mass have none in hybridyn; PhysX takes 1 kg for each, Newton refuses some")
    return out
