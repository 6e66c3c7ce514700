"""Bodies and joints of a compiled MJCF model as links and one-axis joints.

The frame of a body's link is MuJoCo's frame of the body. Its joints follow one another from the parent's
link in the order of the file, with massless links between them; each joint moves the axes of the joints
after it. The position of a joint is MuJoCo's `qpos`; `ref` is part of the placement.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..names import unique
from ..placement import placement_from, rotation_from_quaternion
from ..records import Array, Joint, JointKind, Link
from ..robot_file import RobotFile
from .compiling import Compiled
from .roots import Root

#: MuJoCo's words for kinds of joints.
KINDS: dict[JointKind, str] = {
    "revolute": "mjJNT_HINGE",
    "prismatic": "mjJNT_SLIDE",
    "spherical": "mjJNT_BALL",
    "floating": "mjJNT_FREE",
}

#: Largest distance from a body's origin at which an axis still passes through it, relative to its offset.
ON_AXIS = 4 * np.finfo(float).eps


def pose(position: Array, quaternion: Array) -> Array:
    """Return the placement of a position and one of MuJoCo's quaternions (w, x, y, z), shape (4, 4)."""
    w, x, y, z = (float(number) for number in quaternion)
    return placement_from(rotation_from_quaternion(x, y, z, w), np.array(position, dtype=float))


def add_bodies(robot: RobotFile, compiled: Compiled, root: Root) -> None:
    """Add links and joints of every body to the robot.

    Args:
        robot: The robot; links, joints and their order are MuJoCo's.
        root: Where the tree starts, and which bodies are left out.
    """
    model = compiled.model
    links = set(compiled.bodies)
    joints = set(compiled.joints)
    if root.body == 0:
        robot.links.append(Link(compiled.bodies[0], 0.0, np.zeros(3), np.zeros((3, 3))))
    for body in range(1, model.nbody):
        if body in root.left_out:
            continue
        link = _link(compiled, body)
        if body == root.body:
            robot.links.append(link)
            continue
        chain = _chain(compiled, body, links, joints)
        robot.joints += chain
        for joint in chain[:-1]:
            robot.links.append(Link(joint.child, 0.0, np.zeros(3), np.zeros((3, 3)), joint.line, True))
        robot.links.append(link)


def _link(compiled: Compiled, body: int) -> Link:
    model = compiled.model
    turn = pose(np.zeros(3), model.body_iquat[body])[:3, :3]
    inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
    return Link(
        compiled.bodies[body],
        float(model.body_mass[body]),
        np.array(model.body_ipos[body]),
        (inertia + inertia.T) / 2,
        compiled.line("body", body),
    )


def _chain(compiled: Compiled, body: int, links: set[str], joints: set[str]) -> list[Joint]:
    """Return the joints from a body's parent to the body; add the names that are made to links and joints."""
    model = compiled.model
    name, parent = compiled.bodies[body], compiled.bodies[model.body_parentid[body]]
    first = int(model.body_jntadr[body])
    numbers = list(range(first, first + int(model.body_jntnum[body])))
    at = pose(model.body_pos[body], model.body_quat[body])
    line = compiled.line("body", body)
    if not numbers:
        return [_weld(unique(f"{name}_fixed", joints), parent, name, at, line, joints)]
    origins = _origins(compiled, numbers)
    out: list[Joint] = []
    before = np.zeros(3)
    for number, origin in zip(numbers, origins, strict=True):
        joint = _joint(compiled, number)
        if joint.kind == "floating":
            at = np.eye(4)  # its position is the pose in the world
        turned = _at_zero(compiled, number, joint)
        shift = placement_from(np.eye(3), origin - before)
        child = unique(f"{name}_{joint.name}", links)
        out.append(replace(joint, parent=parent, child=child, placement=at @ shift @ turned))
        links.add(child)
        parent, at, before = child, np.eye(4), origin
    if before.any():
        back = placement_from(np.eye(3), -before)
        out.append(_weld(unique(f"{name}_fixed", joints), parent, name, back, line, joints))
    else:
        out[-1] = replace(out[-1], child=name)
    return out


def _weld(name: str, parent: str, child: str, at: Array, line: int | None, joints: set[str]) -> Joint:
    joints.add(name)
    return Joint(name, "fixed", parent, child, at, np.array([1.0, 0.0, 0.0]), line=line)


def _joint(compiled: Compiled, number: int) -> Joint:
    """Return a joint with its limits; links and placement are those of the caller."""
    model = compiled.model
    kind = next(kind for kind, word in KINDS.items() if compiled.code(word) == model.jnt_type[number])
    single = kind in ("revolute", "prismatic")
    lower, upper = -np.inf, np.inf
    bounds = [float(bound) for bound in model.jnt_range[number]]
    if single and (
        model.jnt_limited[number] or bounds[0] > bounds[1]
    ):  # crossed ones limit nothing in MuJoCo
        lower, upper = bounds
    return Joint(
        name=compiled.joints[number],
        kind=kind,
        parent="",
        child="",
        placement=np.eye(4),
        axis=np.array(model.jnt_axis[number] if single else (1.0, 0.0, 0.0), dtype=float),
        lower=lower,
        upper=upper,
        line=compiled.line("joint", number),
    )


def _at_zero(compiled: Compiled, number: int, joint: Joint) -> Array:
    """Return the motion of a joint from its reference position to position zero, shape (4, 4)."""
    if joint.kind not in ("revolute", "prismatic"):
        return np.eye(4)
    reference = float(compiled.model.qpos0[compiled.model.jnt_qposadr[number]])
    if joint.kind == "prismatic":
        return placement_from(np.eye(3), -reference * joint.axis)
    half = -reference / 2
    x, y, z = np.sin(half) * joint.axis
    return placement_from(rotation_from_quaternion(x, y, z, np.cos(half)), np.zeros(3))


def _origins(compiled: Compiled, numbers: list[int]) -> list[Array]:
    """Return the origin of each joint's frame in the body's frame at the reference position, shape (3,).

    An axis through the body's origin has it there. A slide has no place of its own: it takes that of the next
    turning joint, else of the one before.
    """
    model = compiled.model
    out: list[Array | None] = []
    for number in numbers:
        kind, position = int(model.jnt_type[number]), np.array(model.jnt_pos[number], dtype=float)
        if kind == compiled.code("mjJNT_SLIDE"):
            out.append(None)
        elif kind == compiled.code("mjJNT_HINGE"):
            axis = np.array(model.jnt_axis[number])
            across = position - axis * (axis @ position)
            on_axis = np.abs(across).max() <= ON_AXIS * np.abs(position).max()
            out.append(np.zeros(3) if on_axis else position)
        else:
            out.append(position if kind == compiled.code("mjJNT_BALL") else np.zeros(3))
    following: Array | None = None
    for i in reversed(range(len(out))):
        following = out[i] if out[i] is not None else following
        out[i] = following
    before = np.zeros(3)
    filled: list[Array] = []
    for origin in out:
        before = before if origin is None else origin
        filled.append(before)
    return filled
