"""Write USD as text: one Xform with a rigid body for each link, joints, closures, and the scene's gravity.

Lengths are metres, z points up. What USD cannot say goes to the model file beside. Closures are excluded
from the articulation. A universal closure is no joint of USD. A massless body stands for it: it turns on the
first link, and holds the axis of the second one, about which the closing joint turns (see `parts`).
"""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from ..description.joint_words import WORDS
from ..description.placement import free_pose, poses_at
from ..description.records import Array, Coupling, Description, Joint, Link
from ..description.side_cars.model_toml import model_file
from ..joints.kinds import JointKind
from .as_text import principal, quaternion_of
from .parts import in_parts, without_screws
from .renamed import allowed, without_joints
from .request import FORCES, PLAIN, USUAL_GRAVITY, ConversionRequest, Losses, Written, followers_of
from .small_bodies import POINT_INERTIA, sizes_of
from .usd_joints import End, add_closure, add_joint, behind, start_joint, unit_of
from .usd_prim import UsdPrim


def add_body(parent: UsdPrim, link: Link, placement: Array) -> UsdPrim:
    """Add a rigid body at a placement in the world, shape (4, 4); a mass has an inertia there."""
    body = parent.child("Xform", link.name)
    body.apply("PhysicsRigidBodyAPI")
    body.apply("PhysicsMassAPI")
    body.place(placement)
    if not link.mass and not link.inertia.any():
        return body
    body.numbers("float", "physics:mass", link.mass)
    body.numbers("point3f", "physics:centerOfMass", link.com)
    moments, axes = principal(link.inertia)
    body.numbers("float3", "physics:diagonalInertia", moments)
    if not np.array_equal(axes, np.eye(3)):
        body.numbers("quatf", "physics:principalAxes", quaternion_of(axes))
    return body


def write_usd(request: ConversionRequest, losses: Losses) -> Written:
    """Write a robot as USD."""
    d = without_screws(allowed(request.description, losses, "USD", valid_name), losses)
    d = _with_inertias(d, losses)
    gone = [joint.name for joint in d.joints if joint.kind.nv > 1 and not WORDS[joint.kind].usd]
    d = in_parts(without_joints(d, gone, losses), losses, (), behind)
    top = UsdPrim("", "", "")
    robot = top.child("Xform", valid_name(d.name))
    if robot.name != d.name:
        losses.add("the name of the robot, which USD does not allow", d.name)
    base_home = d.base_home if d.base == "floating" else None
    poses = poses_at(d, d.home, None if base_home is None else free_pose(base_home))
    bodies = {link.name: add_body(robot, link, poses[link.name]) for link in d.links}
    if request.shapes:
        losses.add("visual shapes, which convert does not write to USD")
    if d.base == "floating":
        bodies[d.root].apply("PhysicsArticulationRootAPI")
    else:
        ends = End(None, np.eye(4)), End(bodies[d.root], np.eye(4))
        start_joint(robot, "root_joint", (), ends).apply("PhysicsArticulationRootAPI")
    motors = {*d.motors}
    joints = [
        add_joint(
            robot, joint, (bodies[joint.parent], bodies[joint.child]), joint.name in motors,
            d.home.get(joint.name), losses,
        )
        for joint in d.joints
    ]  # fmt: skip
    for closure in d.closures:
        add_closure(robot, closure, (bodies[closure.link_a], bodies[closure.link_b]), losses)
    by_name = {joint.name: (joint, prim) for joint, prim in zip(d.joints, joints, strict=True) if prim}
    followers, left = followers_of(d.couplings, losses)
    for name, (leader, factor, offset) in followers.items():
        _add_mimic(*by_name[name], *by_name[leader], factor, offset)
    _add_scene(top, d)
    return Written(_text(robot, top), tuple(_notes(d)), {".model.toml": _model_file(d, left)})


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


def _text(robot: UsdPrim, top: UsdPrim) -> str:
    """Return the text of a file, whose default prim is the robot."""
    head = (
        f'#usda 1.0\n(\n    defaultPrim = "{robot.name}"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1\n'
        '    upAxis = "Z"\n)\n'
    )
    return head + "".join("\n" + "\n".join(prim.lines()) + "\n" for prim in top.children)


def _add_mimic(
    own: Joint, prim: UsdPrim, leader: Joint, its_prim: UsdPrim, factor: float, offset: float
) -> None:
    """Add to a joint with one freedom that it follows another one, as a mimic joint of PhysX."""
    prim.apply("PhysxMimicJointAPI:rotZ")
    prim.line(f"rel physxMimicJoint:rotZ:referenceJoint = <{its_prim.path}>")
    prim.line('uniform token physxMimicJoint:rotZ:referenceJointAxis = "rotZ"')
    prim.numbers("float", "physxMimicJoint:rotZ:gearing", -factor * unit_of(leader) / unit_of(own))
    if offset:
        prim.numbers("float", "physxMimicJoint:rotZ:offset", -offset / unit_of(own))


def _add_scene(top: UsdPrim, d: Description) -> None:
    scene = top.child("PhysicsScene", "physics_scene")
    gravity = np.array(d.gravity or USUAL_GRAVITY)
    size = float(np.linalg.norm(gravity))
    scene.numbers("vector3f", "physics:gravityDirection", gravity / size if size else (0.0, 0.0, -1.0))
    scene.numbers("float", "physics:gravityMagnitude", size)


def _model_file(d: Description, couplings: list[Coupling]) -> str:
    """Return the model file: motors, effects, other couplings, and numbers that no prim holds."""
    numbers: dict[str, dict[str, float]] = {}
    for joint in d.joints:
        geared = joint.kind.single and joint.gear_ratio != 1
        words = FORCES if joint.kind is JointKind.SPHERICAL else FORCES[2:] if geared else ()
        stated = {word: getattr(joint, word) for word in words}
        numbers[joint.name] = {word: x for word, x in stated.items() if x != getattr(PLAIN, word)}
    joints = {name: table for name, table in numbers.items() if table}
    effects = [name for name, _ in d.effects]
    return model_file(d, motors=True, joints=joints, couplings=couplings, effects=effects)


def _notes(d: Description) -> list[str]:
    out = ["USD states frames, masses and limits in single precision, with 7 digits"]
    if any(not link.mass for link in d.links):
        out.append("links without mass have none in hybridyn; PhysX takes 1 kg for each, Newton refuses some")
    return out
