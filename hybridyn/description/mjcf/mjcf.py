"""Read an MJCF file: MuJoCo compiles it, and the compiled model becomes records.

Forces and constraints that hybridyn does not have are errors. Contacts and servos are noted. The frame of a
body's link is MuJoCo's frame of the body. Its joints follow one another from the parent's link in the order
of the file, with massless links between them; each joint moves the axes of the joints after it. The position
of a joint is MuJoCo's `qpos`; `ref` is part of the placement.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...joints.kinds import JointKind
from ..joint_chains import NO_AXIS, add_chain
from ..joint_graph import ON_AXIS
from ..joint_words import called
from ..names import listed, unique
from ..placement import motion_of, placement_from
from ..records import Array, Joint, Link, RobotFile
from ..urdf.xml_node import XmlNode
from .compiling import Compiled, compile_text, pose
from .document import Document, screen
from .forces import JointPart, add_forces, bodies_of, pulling, split
from .relations import add_actuators, add_equalities
from .unread import note_on, unread_elements, unread_options

#: Kinds of joints by MuJoCo's words.
KINDS = {f"mjJNT_{word.upper()}": joint.chain[0] for word, joint in called("mjcf").items()}

#: Endings and kinds of the joints that stand for a free joint with armature, friction or springs. MuJoCo adds
#: armature to the diagonal of the mass matrix in its own rates: those of the body's origin along the axes of
#: the world, and angular ones about the axes of the body. Slides along the world's axes and a ball have the
#: same rates.
FREE_PARTS = JointKind.FLOATING.parts


def find_root(robot: RobotFile, compiled: Compiled) -> int:
    """Return the number of the body at which the tree starts; 0 is the world.

    It is a free body whose tree is all that moves, and that no equality ties to the world. Otherwise the
    world is the root, and free bodies hang on it by joints.
    """
    model = compiled.model
    free = np.flatnonzero(model.jnt_type == compiled.code("mjJNT_FREE"))
    if len(free) != 1:
        return 0
    body, dof = int(model.jnt_bodyid[free[0]]), int(model.jnt_dofadr[free[0]])
    tied = [*compiled.tied_bodies.values(), *(bodies_of(compiled, n) for n in pulling(compiled))]
    others = model.body_rootid != body
    moving = (model.body_jntnum > 0) | (model.body_mocapid >= 0)
    if (others & moving).any() or any(others[[*bodies]].any() for bodies in tied if bodies):
        return 0
    if model.dof_damping[dof] or split(compiled, int(free[0])):
        robot.notes += note_on(
            compiled, "the base does not float, because its free joint {} has damping, armature, friction or "
            "a spring: it is a joint on the world; <freejoint/> takes no defaults, and has none of them",
            "joint", free.tolist(),
        )  # fmt: skip
        return 0
    return body


def add_bodies(robot: RobotFile, compiled: Compiled, root: int, q: Array) -> None:
    """Add links and joints of the root's tree to the robot, with forces and home posture.

    Args:
        root: Number of the root body.
        q: Home positions of all joints, MuJoCo's `qpos`.
    """
    model, links, joints = compiled.model, {*compiled.bodies}, {*compiled.joints}
    parts: list[JointPart] = []
    for body in range(model.nbody):
        if root and model.body_rootid[body] != root:
            continue
        if body != root:
            steps = _steps(robot, compiled, body, joints, q, parts)
            chain, name = _chain(compiled, body, steps, joints), compiled.bodies[body]
            between = [unique(f"{name}_{joint.name}", links) for joint in chain[:-1]]
            add_chain(robot, chain, [compiled.bodies[model.body_parentid[body]], *between, name])
        robot.links.append(_link(compiled, body))
    if root:
        at = int(model.jnt_qposadr[model.body_jntadr[root]])
        robot.base, robot.base_home = "floating", _coordinates(JointKind.FLOATING, q[at:])
    add_forces(robot, compiled, parts)


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


def _steps(
    robot: RobotFile, compiled: Compiled, body: int, taken: set[str], q: Array, parts: list[JointPart]
) -> list[tuple[Joint, Array]]:
    """Return the joints of a body in their order, and add their positions at home to the robot.

    Args:
        taken: Names of joints; those that are made are added.
        q: As in `add_bodies`.
        parts: The joints are added to it.

    Returns:
        Each joint without its links, whose placement is its motion from the reference to position zero, and
        the origin of its frame in the body's frame at the reference, shape (3,) [m].
    """
    model, out = compiled.model, []
    first = int(model.body_jntadr[body])
    numbers = range(first, first + int(model.body_jntnum[body]))
    own = [_origin(compiled, number) for number in numbers]
    for i, number in enumerate(numbers):
        # A slide has no place of its own: it takes that of the next turning joint, else of the one before.
        origin = next((x for x in (*own[i:], *own[:i][::-1]) if x is not None), np.zeros(3))
        kind = next(kind for word, kind in KINDS.items() if compiled.code(word) == model.jnt_type[number])
        at, dof = int(model.jnt_qposadr[number]), int(model.jnt_dofadr[number])
        several = kind is JointKind.FLOATING and split(compiled, number)
        for k, (ending, part) in enumerate((FREE_PARTS if several else {"": kind}).items()):
            name = compiled.joints[number]
            if ending:
                name = unique(name + ending, taken)
                robot.undriven.add(name)
            axis, reference = (np.eye(3)[k % 3], 0.0) if ending else (model.jnt_axis[number], model.qpos0[at])
            joint = _joint(compiled, number, dof + k, name, part, axis, reference)
            robot.home[name] = _coordinates(part, q[at + k :])
            parts.append(JointPart(number, name, part, at + k, dof + k))
            out.append((joint, origin))
    return out


def _joint(
    compiled: Compiled, number: int, dof: int, name: str, kind: JointKind, axis: Array, reference: float
) -> Joint:
    """Return a joint with its limits and numbers, whose placement leads to position zero; it has no links."""
    model, lower, upper = compiled.model, -np.inf, np.inf
    bounds = [float(bound) for bound in model.jnt_range[number]]
    single = kind.single
    if single and (model.jnt_limited[number] or bounds[0] > bounds[1]):
        lower, upper = bounds  # crossed ones limit nothing in MuJoCo; they are dropped with a note
    limited = model.jnt_actfrclimited[number]
    joint = Joint(
        name, kind, "", "", np.eye(4), np.array(axis, dtype=float) if single else NO_AXIS, lower, upper,
        effort=float(np.abs(model.jnt_actfrcrange[number]).max()) if limited else np.inf,
        damping=float(model.dof_damping[dof]),
        friction=float(model.dof_frictionloss[dof]),
        rotor_inertia=float(model.dof_armature[dof]),
        line=compiled.line("joint", number),
    )  # fmt: skip
    return replace(joint, placement=motion_of(joint, {name: (-float(reference),)} if single else {}))


def _origin(compiled: Compiled, number: int) -> Array | None:
    """Return where a joint's frame is in the body's at the reference position, shape (3,); None for a slide.

    An axis through the body's origin has it there.
    """
    model = compiled.model
    kind, position = int(model.jnt_type[number]), np.array(model.jnt_pos[number], dtype=float)
    if kind == compiled.code("mjJNT_SLIDE"):
        return None
    if kind == compiled.code("mjJNT_HINGE"):
        axis = np.array(model.jnt_axis[number])
        across = position - axis * (axis @ position)
        if np.abs(across).max() <= ON_AXIS * np.abs(position).max():
            return np.zeros(3)
    return position


def _chain(compiled: Compiled, body: int, steps: list[tuple[Joint, Array]], taken: set[str]) -> list[Joint]:
    """Return the joints from a body's parent to the body, without links; `taken`: names of joints."""
    model = compiled.model
    at, before, out = pose(model.body_pos[body], model.body_quat[body]), np.zeros(3), list[Joint]()
    if steps and model.jnt_type[model.body_jntadr[body]] == compiled.code("mjJNT_FREE"):
        at = np.eye(4)  # its position is the pose in the world
    for joint, origin in steps:
        shift = placement_from(np.eye(3), origin - before)
        out.append(replace(joint, placement=at @ shift @ joint.placement))
        at, before = np.eye(4), origin
    if not steps or before.any():
        fixed = unique(f"{compiled.bodies[body]}_fixed", taken)
        back = at @ placement_from(np.eye(3), -before)
        out.append(Joint(fixed, JointKind.FIXED, "", "", back, NO_AXIS, line=compiled.line("body", body)))
    return out


def _coordinates(kind: JointKind, q: Array) -> tuple[float, ...]:
    """Return a joint's position as Pinocchio has it; `q` starts with MuJoCo's (quaternions w, x, y, z)."""
    if kind.single:
        return (float(q[0]),)
    start = kind.shift
    turn = q[start : start + 4] / np.linalg.norm(q[start : start + 4])
    return tuple(float(x) for x in (*q[:start], *np.roll(turn, -1)))


#: Elements that notes speak of, which MuJoCo does not place, or which `screen` takes out.
PLACES = {"pair": "", "flag": "", "option": "[@density or @viscosity]", "key": ""}
#: Name of the keyframe that is home where there are several.
HOME = "home"


def read_mjcf(root: XmlNode, package_dirs: Sequence[str | os.PathLike[str]] = ()) -> RobotFile:
    """Read the root element of an MJCF file.

    Args:
        root: Root element `<mujoco>`; it is changed.
        package_dirs: Folders, beside the robot's own, from which includes and meshes may be read.

    Raises:
        ModelError: MuJoCo is not installed, MuJoCo refuses the file, or the file states something that
            hybridyn does not have.
    """
    document = Document(root, [os.fspath(folder) for folder in package_dirs])
    places = {tag: node.at for tag, of in PLACES.items() for node in reversed(document.nodes(f"//{tag}{of}"))}
    meshes: dict[str, bytes] = {}
    for one in document.every():
        screen(one, meshes)
    compiled = compile_text(document, meshes)
    robot = RobotFile(root.attrib.get("model", "").strip() or "robot", root.file, format="MJCF")
    start = find_root(robot, compiled)
    add_bodies(robot, compiled, start, _home(robot, compiled, places))
    add_equalities(robot, compiled)
    add_actuators(robot, compiled)
    robot.notes += [note for one in document.every() for note in one.notes]
    robot.notes += unread_elements(compiled, start) + unread_options(compiled, places)
    x, y, z = (float(number) for number in compiled.model.opt.gravity)
    off = compiled.model.opt.disableflags & compiled.code("mjDSBL_GRAVITY")
    robot.gravity = (0.0, 0.0, 0.0) if off else (x, y, z)
    return robot


def _home(robot: RobotFile, compiled: Compiled, places: Mapping[str, str]) -> Array:
    """Return the home posture, MuJoCo's `qpos`: the keyframe "home", else the first, else `qpos0`."""
    model = compiled.model
    if not model.nkey:
        return np.array(model.qpos0)
    names = [compiled.name("key", number) for number in range(model.nkey)]
    if model.nkey > 1 and HOME not in names:
        at = places.get("key", robot.file)
        robot.notes.append(
            f"{at}: home is the first of {model.nkey} keyframes ('{names[0]}'); to use "
            f"another one, rename it to 'home': {listed(names[1:])}"
        )
    return np.array(model.key_qpos[names.index(HOME) if HOME in names else 0])
