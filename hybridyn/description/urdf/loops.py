"""Read closures and couplings of a URDF.

`<loop>` and `<coupling>` are those of URDF+ (arXiv 2411.19753), with the additional types cylindrical,
universal, spherical, point and rows. `<loop_joint>` is the form of Isaac Sim, Dojo and old Drake. Joints in
`<gazebo>` are SDF: `<parent>` and `<child>` name links, `<pose>` places the joint in the child's frame, and
the loop is closed where all joints are at zero, because SDF places its links in this posture. An unknown
attribute or child of these elements is an error.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from ..closure_forms import FORMS, Side, closure_of, form_of_rows
from ..names import did_you_mean, listed
from ..placement import placement_from, poses_at_zero, relative, rotation_from_rpy, rotation_to_axis
from ..records import Array, Closure, Coupling, Joint, RobotFile
from ..sdf.elements import flag
from .xml_node import Node, axis_of, origin_of, unit

POSE = ("xyz", "rpy", "quat_xyzw")
#: Alternative names of the types of `<loop_joint>`, in lower case.
LOOP_JOINT_TYPES = {"3d": "spherical", "ball": "spherical", "6d": "fixed"}
#: Types of SDF joints by the kind of closure.
GAZEBO_TYPES = {
    "fixed": "fixed", "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic",
    "ball": "spherical",
}  # fmt: skip
MODEL = "__model__"
GAZEBO_PARTS = ("parent", "child", "pose", "axis", "physics", "sensor", "gearbox_ratio", "thread_pitch")


def read_loop(node: Node) -> Closure:
    """Read `<loop>`; `<axis>` is in the frame of the predecessor's origin, `<axis2>` in the successor's."""
    kind = kind_of(node, [*FORMS, "rows"])
    axes = {"rows": [], "universal": ["axis", "axis2"]}.get(kind, ["axis"])
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
    other = _turn(node.required_child("axis2"), kind) if kind == "universal" else turn
    return closure_of(node.text("name"), kind, sides, (turn, other), line=node.line)


def read_loop_joint(node: Node) -> Closure:
    """Read `<loop_joint>`, with its links as children (`<link1 link xyz rpy>`) or as attributes.

    The axis is in the first frame. Isaac Sim's exporter writes `link1` twice; the second one is then the
    successor.
    """
    node.only(["name", "type", "link1", "link2"], ["link1", "link2", "axis", "dynamics"])
    known = [*(name for name in FORMS if name != "universal"), *LOOP_JOINT_TYPES]
    kind = kind_of(node, known, names=LOOP_JOINT_TYPES)
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


#: Readers of closures by the name of their element.
CLOSURE_READERS = {"loop": read_loop, "loop_joint": read_loop_joint}


def read_coupling(node: Node, parents: Mapping[str, Joint | None]) -> Coupling:
    """Read `<coupling>`, a gear between the paths from the nearest common ancestor to its two links.

        ratio x (sum of joint positions on the predecessor's path) = sum of those on the successor's path

    The rotor (successor) of a gear with ratio 6 turns six times as fast as its link, in the same direction.

    Args:
        parents: The joint above each link, by the link's name; None for the root.

    Source: URDF+; the sign is that of its reference reader in the GRBDA library.
    """
    node.only(["name", "type"], ["predecessor", "successor", "ratio"])
    if (kind := node.xml.get("type", "rolling")) != "rolling":
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


def read_mimic(node: Node, follower: str) -> Coupling:
    """Read `<mimic>`: position = multiplier x position of the other joint + offset."""
    node.only(["joint", "multiplier", "offset"], [])
    leader, multiplier = node.text("joint"), node.number("multiplier", 1.0)
    if leader == follower:
        raise node.error("a joint cannot mimic itself")
    return Coupling(follower, ((follower, 1.0), (leader, -multiplier)), node.number("offset", 0.0), node.line)


def pose_of(node: Node | None) -> Array:
    """Return the placement that an `<origin>` states, shape (4, 4); it holds nothing else."""
    if node is not None:
        node.only(POSE, [])
    return origin_of(node)


def kind_of(
    node: Node,
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


def _attached(node: Node) -> Side:
    node.only(["link"], ["origin"])
    origin = pose_of(node.child("origin"))
    return node.text("link"), origin


def _turn(axis: Node | None, kind: str) -> Array:
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


def read_gazebo_joints(root: Node, robot: RobotFile) -> None:
    """Add a closure for each SDF joint directly below a `<gazebo>` that concerns the whole robot.

    Raises:
        ModelError: A joint has a type that closes no loop here, or names what does not exist.
    """
    blocks = [block for block in root.children("gazebo") if "reference" not in block.attributes()]
    nodes = [joint for block in blocks for joint in block.children("joint")]
    poses = poses_at_zero(robot.joints) | {MODEL: np.eye(4)} if nodes else {}
    for node in nodes:
        _read_gazebo_joint(node, poses, robot)


def _read_gazebo_joint(node: Node, poses: Mapping[str, Array], robot: RobotFile) -> None:
    kind = GAZEBO_TYPES[
        kind_of(node, GAZEBO_TYPES, "an SDF joint of type '{}' closes no loop here; write it as <loop>")
    ]
    node.only(["name", "type"], GAZEBO_PARTS)
    links = [_link(node.required_child(end), poses) for end in ("parent", "child")]
    at_child, at = node.child("pose"), poses[links[1]]
    if at_child is not None:
        at_child.only(["relative_to", "frame"], [])
        frame = at_child.xml.get("relative_to") or at_child.xml.get("frame") or links[1]
        numbers = at_child.numbers("", 6) if at_child.content() else np.zeros(6)
        at = _frame(at_child, frame, poses) @ placement_from(rotation_from_rpy(*numbers[3:]), numbers[:3])
    turn = np.eye(3)
    if FORMS[kind].has_axis:
        axis = node.required_child("axis")
        turn = rotation_to_axis(_direction(axis, at, poses))
        if unread := [tag for tag in ("dynamics", "limit") if axis.child(tag)]:
            robot.notes.append(
                f"closure '{node.text('name')}': {listed(unread)} of the SDF joint is not read"
            )
    sides = [(link, relative(poses[link], at)) for link in links]
    robot.closures.append(closure_of(node.text("name"), kind, sides, (turn, turn), line=node.line))


def _link(node: Node, poses: Mapping[str, Array]) -> str:
    """Return the link that an end of the joint names."""
    node.only([], [])
    name = node.content()
    if name == "world" and name not in poses:
        raise node.error(
            "a joint to the world closes no loop of the robot; name a link (the root link stands still on a "
            "fixed base)"
        )
    if name not in poses or name == MODEL:
        raise node.error(f"unknown link '{name}'{did_you_mean(name, poses)}")
    return name


def _direction(node: Node, at: Array, poses: Mapping[str, Array]) -> Array:
    """Return the unit axis in the joint's frame, shape (3,)."""
    xyz, value, frame = node.child("xyz"), np.array([0.0, 0.0, 1.0]), ""
    if xyz is not None:
        value, frame = unit(xyz, xyz.numbers("", 3), "<xyz>0 0 1</xyz>"), xyz.xml.get("expressed_in", "")
    if flag(node, "use_parent_model_frame"):
        frame = MODEL
    return at[:3, :3].T @ _frame(node, frame, poses)[:3, :3] @ value if frame else value


def _frame(node: Node, name: str, poses: Mapping[str, Array]) -> Array:
    if name not in poses:
        raise node.error(f"unknown frame '{name}'{did_you_mean(name, poses)}; name a link, or {MODEL}")
    return poses[name]
