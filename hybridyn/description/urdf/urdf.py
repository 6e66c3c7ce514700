"""Read URDF: links, joints, and everything else in a `<robot>` that affects the dynamics.

Elements that do not affect the dynamics (visuals, collisions, materials, meshes, sensors) are skipped.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ...joints.kinds import JointKind
from ..joint_words import WORDS
from ..loop_signs import refuse_unread_loops
from ..names import DROPS, did_you_mean, listed
from ..records import (
    Array,
    Joint,
    Link,
    MotorStatement,
    RobotFile,
    StatedSpring,
    massless,
    spring_effect,
)
from ..rows import Row, names_in, numbers_in
from .control import state_interfaces
from .drake import PITCH, TENDON, is_drakes, read_drake_joint, read_tendon
from .drake_forces import BUSHING, SPRING, frames_of, read_bushings, spring_effects
from .engines import dropped
from .gazebo import read_gazebo
from .loops import DYNAMICS, add_closures, forces_of, pose_of, read_coupling, read_mimic
from .transmissions import ROTOR_TAGS, behind, read_rotor, read_transmissions
from .xml_node import OfAttributes, XmlNode, axis_of

#: Types of joints of URDF, and PyBullet's `spherical`, a ball.
URDF_KINDS = tuple(kind for kind in JointKind if WORDS[kind].urdf)

#: Limits of this size are none. URDF has no word for infinity that every program reads.
UNLIMITED = 1e30
#: Children of `<joint>` that are read.
JOINT_PARTS = (
    "origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "drake:mimic", "rotor_inertia",
    "gear_ratio", "drake:rotor_inertia", "drake:gear_ratio",
)  # fmt: skip
#: What `<limit>` states.
LIMIT = {
    "lower": Row(-math.inf, endless=UNLIMITED), "upper": Row(math.inf, endless=UNLIMITED),
    "velocity": Row(math.inf, endless=UNLIMITED), "effort": Row(math.inf, endless=UNLIMITED),
}  # fmt: skip
#: The words of `<dynamics>` for an inertia at the joint.
ARMATURE = {word: DYNAMICS[word] for word in ("armature", "rotor_inertia")}
INERTIA_ATTRIBUTES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(root: XmlNode, _: object = None) -> RobotFile:
    """Read the root element of a URDF.

    Raises:
        ModelError: An element is invalid, or states a loop in a form that is not read.
    """
    name = root.attrib.get("name", "").strip()
    robot = RobotFile(name or "robot", root.file)
    refuse_unread_loops(root, robot.notes)
    robot.links += [_read_link(node, robot.notes) for node in root.children("link")]
    nodes = root.children("joint")
    for node in root.children("joint", "drake:joint"):
        _add_joint(node, robot)
    independent = {node.text("name") for node in nodes if node.flag("independent", True)}
    on_world = [joint.name for joint in robot.joints if joint.parent == "world"]
    if on_world and all(link.name != "world" for link in robot.links):
        robot.links.insert(0, massless("world"))
        told = "on a link 'world' that the file does not state: it is added, as in Drake"
        robot.notes.append(f"joints {listed(on_world)} stand {told}")
    add_closures(root, robot)
    parents: dict[str, Joint | None] = {link.name: None for link in robot.links}
    parents |= {joint.child: joint for joint in robot.joints}
    robot.couplings += [read_coupling(node, parents) for node in root.children("coupling")]
    read_gazebo(root, robot)
    robot.couplings += [read_tendon(node) for node in root.children(TENDON)]
    robot.effects += spring_effects(root.children(SPRING))
    read_bushings(root.children(BUSHING), frames_of(root, robot), robot)
    _state_motors(robot, root, independent, len(nodes))
    state_interfaces(root, robot)
    _add_armatures(robot, nodes)
    if robot.springs:
        robot.effects += (spring_effect(robot.springs),)
    robot.notes += dropped(root)
    return robot


def _add_armatures(robot: RobotFile, nodes: list[XmlNode]) -> None:
    """Add the inertias at the joint that `<dynamics>` states, unless a rotor is stated, too."""
    stated = {
        node.text("name"): max(numbers_in(ARMATURE, OfAttributes(dynamics)).values())
        for node in nodes if (dynamics := node.child("dynamics"))
    }  # fmt: skip
    for number, joint in enumerate(robot.joints):
        armature = stated.get(joint.name, 0.0)
        if armature and (joint.rotor_inertia or not joint.kind.single):
            why = "a rotor is stated elsewhere, too" if joint.rotor_inertia else f"it is {joint.kind}"
            robot.notes.append(f"{DROPS} the armature {armature:g} of joint '{joint.name}': {why}")
        elif armature:
            robot.joints[number] = replace(joint, rotor_inertia=armature / joint.gear_ratio**2)


def _state_motors(robot: RobotFile, root: XmlNode, independent: set[str], joints: int) -> None:
    """Add the motors that the file states by transmissions (with their rotors) and `independent=`.

    Args:
        independent: Names of the joints that do not say that they are dependent.
        joints: The number of `<joint>`.
    """
    if rotors := read_transmissions(root, robot):
        robot.joints = [
            behind(rotors[joint.name], joint, root, robot.notes) if joint.name in rotors else joint
            for joint in robot.joints
        ]
    if len(independent) < joints:
        driven = [j.name for j in robot.joints if j.name in independent and j.kind.single]
        where = 'URDF+ joints with independent="true"'
        robot.motors.append(MotorStatement("independent", where, tuple(driven), root.file))


def _read_link(node: XmlNode, notes: list[str]) -> Link:
    node.refuse_misspelt(["name"], ["inertial"])
    name, inertial = node.text("name"), node.child("inertial")
    if inertial is None:
        return massless(name, node.line)
    inertial.refuse_misspelt([], ["origin", "mass", "inertia"])
    origin = pose_of(inertial.child("origin"))
    mass, tensor = inertial.required_child("mass").number("value"), inertial.child("inertia")
    if mass < 0:
        raise inertial.error(f"link '{name}' has a negative mass ({mass:g} kg)")
    if tensor is None:
        notes.append(f"{node.at}: link '{name}' states a mass but no inertia: taken as a point mass")
        return Link(name, mass, origin[:3, 3], np.zeros((3, 3)), node.line)
    tensor.refuse_misspelt(INERTIA_ATTRIBUTES, [])
    ixx, ixy, ixz, iyy, iyz, izz = (
        tensor.number(word, None if word in ("ixx", "iyy", "izz") else 0.0) for word in INERTIA_ATTRIBUTES
    )
    inertia = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    return Link(name, mass, origin[:3, 3], origin[:3, :3] @ inertia @ origin[:3, :3].T, node.line)


def _add_joint(node: XmlNode, robot: RobotFile) -> None:
    """Add a `<joint>` or a `<drake:joint>` to the robot, and the coupling of its `<mimic>`."""
    name = node.text("name")
    if not is_drakes(node):
        robot.joints.append(_read_joint(node, robot))
    else:
        node.refuse_misspelt(["name", "type"], (*JOINT_PARTS, *ROTOR_TAGS, PITCH))
        read_drake_joint(node, robot, partial(_numbers, robot=robot))
    if mimic := node.child("mimic", "drake:mimic"):
        coupling = read_mimic(mimic, name)
        if node.text("type") == "fixed":
            robot.notes.append(
                f"{mimic.at}: joint '{name}' is fixed; its <mimic> has no effect, as in Pinocchio"
            )
        else:
            robot.couplings.append(coupling)


def _numbers(node: XmlNode, name: str, kind: JointKind, robot: RobotFile) -> dict[str, Any]:
    """Return rotor, limits and friction of a joint, and add its spring to the robot."""
    limits = _limits(node.child("limit"), name, kind, robot.notes)
    return {**read_rotor(node, robot.notes), **limits, **_forces(node.child("dynamics"), name, kind, robot)}


def _read_joint(node: XmlNode, robot: RobotFile) -> Joint:
    node.refuse_misspelt(["name", "type", "independent"], JOINT_PARTS)
    name, kind, axis = node.text("name"), _joint_kind(node), node.child("axis")
    if axis is not None:
        axis.refuse_misspelt(["xyz"], [])
        if unknown := [attribute for attribute in axis.attributes() if attribute != "xyz"]:
            what = f"{listed(unknown)} of the <axis> of joint '{name}' is ignored"
            robot.notes.append(f"{axis.at}: {what}, as other readers do")
    return Joint(
        name=name,
        kind=kind,
        parent=node.required_child("parent").text("link"),
        child=node.required_child("child").text("link"),
        placement=pose_of(node.child("origin")),
        axis=_axis(axis, kind, node),
        line=node.line,
        **_numbers(node, name, kind, robot),
    )


def _axis(axis: XmlNode | None, kind: JointKind, node: XmlNode) -> Array:
    """Return the unit axis of a joint; a planar joint moves in the x-y plane of its frame, as in Pinocchio.

    Raises:
        ModelError: A planar joint states a normal other than z.
    """
    if kind is JointKind.PLANAR:
        normal = np.array([0.0, 0.0, 1.0])
        if axis is not None and np.abs(np.cross(axis_of(axis), normal)).max() > 1e-12:
            raise node.error(
                "a planar joint moves in the x-y plane of its frame, as in Pinocchio, whatever its axis; "
                'turn its <origin> so that the normal is z, and write <axis xyz="0 0 1"/>'
            )
        return normal
    return axis_of(axis) if kind.single else np.array([1.0, 0.0, 0.0])


def _joint_kind(node: XmlNode) -> JointKind:
    kind = node.text("type")
    if kind in URDF_KINDS:
        return JointKind(kind)
    raise node.error(
        f"joint type '{kind}' does not exist in URDF{did_you_mean(kind, URDF_KINDS)}; known: "
        f"{listed(URDF_KINDS)}. Write others as one-freedom joints with massless links between them, or "
        "retype a revolute joint as SPHERICAL or UJOINT_XY in a side-car robot.yaml"
    )


def _limits(node: XmlNode | None, name: str, kind: JointKind, notes: list[str]) -> dict[str, float]:
    """Return the limits that `<limit>` states; note and ignore negative limits of speed or effort."""
    if node is None:
        return {}
    node.refuse_misspelt([*LIMIT], [])
    out = numbers_in(LIMIT, OfAttributes(node))
    for word in ("velocity", "effort"):
        if out[word] < 0:
            notes.append(f"{node.at}: joint '{name}': negative {word} limit {out[word]:g} ignored")
            out[word] = math.inf
    if kind.additive and kind is not JointKind.SCREW:
        return out
    if kind.nv and any(math.isfinite(out[word]) and out[word] for word in ("lower", "upper")):
        limits = f"limits of position of the {kind} joint '{name}' are ignored"
        notes.append(f"{node.at}: {limits}, as Pinocchio and Drake do")
    return out | {"lower": -math.inf, "upper": math.inf}


def _forces(node: XmlNode | None, name: str, kind: JointKind, robot: RobotFile) -> dict[str, float]:
    """Return the damping and dry friction that `<dynamics>` states, and add its spring to the robot."""
    if node is None:
        return {}
    node.refuse_misspelt(names_in(DYNAMICS), [])
    stated = forces_of(node, robot.notes, f" of joint '{name}'")
    out = {word: stated.get(word, 0.0) for word in ("damping", "friction")}
    stiffness = stated.get("spring_stiffness", 0.0)
    if kind is JointKind.SPHERICAL and out["friction"]:
        robot.notes.append(
            f"{node.at}: {DROPS} the dry friction of joint '{name}', which has several freedoms"
        )
        out["friction"] = 0.0
    if stiffness and kind.single:
        robot.springs.append(StatedSpring(name, stiffness, stated.get("spring_reference", 0.0)))
    elif stiffness and kind.nv:
        robot.notes.append(f"{node.at}: {DROPS} the spring of joint '{name}', which has several freedoms")
    return out
