"""Read closures and couplings of a URDF.

`<loop>` and `<coupling>` are those of URDF+ (arXiv 2411.19753), with the additional types cylindrical,
universal, spherical, point and rows. `<constraint>` is the proposal of urdfdom. `<loop_joint>` is the form of
Isaac Sim, Dojo, old Drake and an exporter of Fusion; one with damping or a spring stays a joint. An unknown
attribute or child of these elements is an error.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

import numpy as np

from ...joints.kinds import JointKind
from ..closure_forms import FORMS, Side, closure_of, form_of_rows
from ..joint_words import NICKNAMES, UNIVERSAL
from ..names import DROPS, did_you_mean, listed
from ..placement import poses_at_zero, relative, rotation_to_axis
from ..records import Array, Closure, Coupling, Joint, RobotFile
from ..rows import Row, stated_in
from .drake import BALL, WELD, read_ball_constraint, read_weld_constraint
from .kept_joints import keep_joint
from .xml_node import OfAttributes, XmlNode, axis_of, origin_of

POSE = ("xyz", "rpy", "quat_xyzw")


def read_loop(node: XmlNode, _: object = None) -> Closure:
    """Read `<loop>`; `<axis>` is in the frame of the predecessor's origin, `<axis2>` in the successor's."""
    kind = kind_of(node, [*FORMS, "rows"])
    axes = {"rows": [], UNIVERSAL: ["axis", "axis2"]}.get(kind, ["axis"])
    node.only(["name", "type", *(["rows"] if kind == "rows" else [])], ["predecessor", "successor", *axes])
    sides = [_attached(node.required_child(tag)) for tag in ("predecessor", "successor")]
    if kind == "rows":
        try:
            form = form_of_rows(node.text("rows"))
        except ValueError as error:
            raise node.error(str(error)) from None
        turns = (form.rotation_of_frames,) * 2
        return closure_of(node.text("name"), kind, sides, turns, form, node.line)
    turn = _turn(node.child("axis"), kind)
    other = _turn(node.required_child("axis2"), kind) if kind == UNIVERSAL else turn
    return closure_of(node.text("name"), kind, sides, (turn, other), line=node.line)


def add_closures(root: XmlNode, robot: RobotFile) -> None:
    """Add every closure that an element states to the robot; one with forces stays a joint."""
    nodes = root.children(*CLOSURE_READERS)
    poses = poses_at_zero(robot.joints) if any(node.children("dynamics", "parent") for node in nodes) else {}
    for node in nodes:
        closure, dynamics = CLOSURE_READERS[node.tag](node, poses), node.child("dynamics")
        of = f" of closure '{closure.name}'"
        forces = {} if dynamics is None else forces_of(dynamics, robot.notes, of)
        keep_joint(robot, closure, forces, poses, node)
        if node.child("limit"):
            robot.notes.append(f"{node.at}: the limits of closure '{closure.name}' are not read")


#: What `<dynamics>` states, by SDFormat's words. RaiSim and Isaac Sim write a spring as `stiffness` and
#: `spring_mount`, its position without force; RaiSim writes an armature as `rotor_inertia`.
DYNAMICS = {
    "damping": Row(least=0.0), "friction": Row(least=0.0),
    "spring_stiffness": Row(least=0.0, names={"stiffness": "", "spring_stiffness": ""}),
    "spring_reference": Row(names={"spring_mount": "", "spring_reference": ""}),
    "armature": Row(least=0.0), "rotor_inertia": Row(least=0.0),
}  # fmt: skip


def forces_of(dynamics: XmlNode, notes: list[str], of: str) -> dict[str, float]:
    """Return the numbers of `DYNAMICS` that an element states.

    Args:
        dynamics: The element.
        notes: Takes numbers that are dropped because the element states the same otherwise.
        of: The joint, as " of joint 'elbow'".

    Raises:
        ModelError: A number is none, or is negative.
    """
    return stated_in(
        DYNAMICS, OfAttributes(dynamics),
        drop=lambda text: notes.append(f"{dynamics.at}: {DROPS} {text}"), of=of,
    )  # fmt: skip


def read_constraint(node: XmlNode, _: object = None) -> Closure:
    """Read `<constraint>`; each side states an axis, and the axes coincide (universal: are perpendicular).

    Raises:
        ModelError: The constraint is prismatic and its sides state different axes: nothing says how they are
            turned about the axis.
    """
    ends = ("parent", "child")
    node.only(["name", "type"], [side + part for side in ends for part in ("", "_origin", "_axis")])
    kind = kind_of(node, FORMS)
    sides, turns = list[Side](), list[Array]()
    for side in ends:
        link, axis = node.required_child(side), node.child(f"{side}_axis")
        link.only(["link"], [])
        if axis is None and kind == UNIVERSAL:
            raise node.error(f"<{side}_axis> is missing; a universal constraint has two")
        sides.append((link.text("link"), pose_of(node.child(f"{side}_origin"))))
        turns.append(_turn(axis, kind))
    if kind == JointKind.PRISMATIC and not np.array_equal(turns[0], turns[1]):
        raise node.error(
            "a prismatic constraint whose sides state different axes does not say how they are turned about "
            "the axis; turn <child_origin> so that both axes are the same"
        )
    return closure_of(node.text("name"), kind, sides, turns, line=node.line)


def read_loop_joint(node: XmlNode, poses: Mapping[str, Array]) -> Closure:
    """Read `<loop_joint>`, with its links as children (`<link1 link xyz rpy>`) or as attributes.

    The axis is in the first frame. Isaac Sim's exporter writes `link1` twice; the second one is then the
    successor.

    Args:
        node: The element.
        poses: Pose of each link where all joints are at zero, shapes (4, 4), where it states a `<parent>`.
    """
    known = [*(name for name in FORMS if name != UNIVERSAL), *NICKNAMES]
    kind = kind_of(node, known, names=NICKNAMES)
    if node.children("parent", "child"):
        return _of_fusion(node, kind, poses)
    node.only(["name", "type", "link1", "link2"], ["link1", "link2", "axis", "dynamics", "limit"])
    ends = node.children("link1", "link2")
    if not ends and {"link1", "link2"} <= set(node.attributes()):
        sides = [(node.text(name), np.eye(4)) for name in ("link1", "link2")]
    elif len(ends) != 2 or [end.tag for end in ends] == ["link2", "link2"]:
        raise node.error('exactly one <link1 link=".."/> and one <link2 link=".."/> are needed')
    else:
        for end in ends:
            end.only(["link", *POSE], [])
        sides = [(end.text("link"), origin_of(end)) for end in sorted(ends, key=lambda end: end.tag)]
    turn = _turn(node.child("axis"), kind)
    return closure_of(node.text("name"), kind, sides, (turn, turn), line=node.line)


def _of_fusion(node: XmlNode, kind: str, poses: Mapping[str, Array]) -> Closure:
    """Return a `<loop_joint>` of Fusion's exporter: one point of the joint in both links.

    `<axis frame="parent">` is in the frame of the parent link. The child's frame is turned as the parent's
    stands where all joints are at zero, unless `<child_origin>` states its own `rpy`.
    """
    parts = ["parent", "child", "parent_origin", "child_origin", "axis", "dynamics", "limit"]
    node.only(["name", "type"], parts)
    links, origins = list[str](), list[Array]()
    for side in ("parent", "child"):
        link = node.required_child(side)
        link.only(["link"], [])
        links.append(link.text("link"))
        origins.append(pose_of(node.required_child(f"{side}_origin")))
    axis, child = node.child("axis"), node.required_child("child_origin")
    stated = "parent" if axis is None else axis.attrib.get("frame", "parent")
    if stated not in ("parent", "child"):
        raise node.error(f"the axis is in the frame '{stated}'; known: 'parent', 'child'")
    between = np.eye(4)
    if {*links} <= poses.keys():  # `validate` refuses others
        between = relative(poses[links[1]], poses[links[0]])
    if not {"rpy", "quat_xyzw"} & {*child.attributes()}:
        origins[1][:3, :3] = between[:3, :3] @ origins[0][:3, :3]
    turn = np.eye(3)
    if FORMS[kind].has_axis:
        if axis is not None:
            axis.only(["xyz", "frame"], [])
        at = origins[0] if stated == "parent" else origins[1]
        turn = rotation_to_axis(at[:3, :3].T @ axis_of(axis))
    sides = zip(links, origins, strict=True)
    return closure_of(node.text("name"), kind, sides, (turn, turn), line=node.line)


#: Readers of closures by the name of their element.
CLOSURE_READERS: dict[str, Callable[[XmlNode, Mapping[str, Array]], Closure]] = {
    "loop": read_loop, "constraint": read_constraint, "loop_joint": read_loop_joint,
    BALL: lambda node, _: read_ball_constraint(node), WELD: lambda node, _: read_weld_constraint(node),
}  # fmt: skip


def read_coupling(node: XmlNode, parents: Mapping[str, Joint | None]) -> Coupling:
    """Read `<coupling>`, a gear between the paths from the nearest common ancestor to its two links.

        ratio x (sum of joint positions on the predecessor's path) = sum of those on the successor's path

    The rotor (successor) of a gear with ratio 6 turns six times as fast as its link, in the same direction.

    Args:
        parents: The joint above each link, by the link's name; None for the root.

    Source: URDF+; the sign is that of its reference reader in the GRBDA library.
    """
    node.only(["name", "type"], ["predecessor", "successor", "ratio"])
    if (kind := node.attrib.get("type", "rolling")) != "rolling":
        raise node.error(f"unknown type '{kind}'; known: 'rolling'")
    ratio_node = node.required_child("ratio")
    ratio_node.only(["value"], [])
    ratio = ratio_node.number("value")
    if ratio == 0:
        raise ratio_node.error("a ratio of 0 couples nothing")
    ends: list[str] = []
    for tag in ("predecessor", "successor"):
        end = node.required_child(tag)
        end.only(["link"], [])
        ends.append(end.text("link"))
        if ends[-1] not in parents:
            raise end.error(f"unknown link '{ends[-1]}'{did_you_mean(ends[-1], parents)}")
    path_a, path_b = (_path_to_root(link, parents) for link in ends)
    terms = [
        (joint.name, coefficient)
        for own, other, coefficient in ((path_a, path_b, ratio), (path_b, path_a, -1.0))
        for joint in reversed(own.values())
        if joint.name not in other and joint.kind != "fixed"
    ]
    if not terms:
        raise node.error(f"there is no movable joint between '{ends[0]}' and '{ends[1]}'")
    return Coupling(node.text("name"), tuple(terms), 0.0, node.line)


def read_mimic(node: XmlNode, follower: str) -> Coupling:
    """Read `<mimic>`: position = multiplier x position of the other joint + offset."""
    node.only(["joint", "multiplier", "offset"], [])
    leader, multiplier = node.text("joint"), node.number("multiplier", 1.0)
    if leader == follower:
        raise node.error("a joint cannot mimic itself")
    return Coupling(follower, ((follower, 1.0), (leader, -multiplier)), node.number("offset", 0.0), node.line)


def pose_of(node: XmlNode | None) -> Array:
    """Return the placement that an `<origin>` states, shape (4, 4); it holds nothing else."""
    if node is not None:
        node.only(POSE, [])
    return origin_of(node)


def kind_of(
    node: XmlNode,
    known: Collection[str],
    wrong: str = "unknown type '{}'",
    names: Mapping[str, str] | None = None,
) -> str:
    """Return the type of a closure. `names`: types by their alternative names in lower case."""
    stated = node.text("type")
    kind = (names or {}).get(stated.lower(), stated)
    if kind not in known:
        raise node.error(f"{wrong.format(stated)}{did_you_mean(stated, known)}; known: {listed(known)}")
    return kind


def _attached(node: XmlNode) -> Side:
    node.only(["link"], ["origin"])
    origin = pose_of(node.child("origin"))
    return node.text("link"), origin


def _turn(axis: XmlNode | None, kind: str) -> Array:
    """Return a rotation that maps z to the stated axis, for kinds of closures with an axis."""
    if axis is not None:
        axis.only(["xyz"], [])
    direction = axis_of(axis)
    return rotation_to_axis(direction) if FORMS[kind].has_axis else np.eye(3)


def _path_to_root(link: str, parents: Mapping[str, Joint | None]) -> dict[str, Joint]:
    """Return the joints from a link to the root by name; stop at a cycle, which `validate` reports later."""
    path: dict[str, Joint] = {}
    while (joint := parents.get(link)) is not None and joint.name not in path:
        path[joint.name] = joint
        link = joint.parent
    return path
