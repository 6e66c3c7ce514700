"""Read closures and couplings of a URDF: `<loop>`, `<constraint>`, `<loop_joint>`, `<coupling>`, `<mimic>`.

`<loop>` and `<coupling>` are those of URDF+ (arXiv 2411.19753), with the additional types cylindrical,
universal, spherical, point and rows. `<constraint>` is the proposal of urdfdom. `<loop_joint>` is the form of
Isaac Sim, Dojo and old Drake. An unknown attribute or child of these elements is an error.
"""

from __future__ import annotations

import numpy as np

from ..closure_forms import FORMS, Form, form_of_rows
from ..names import did_you_mean, listed
from ..placement import rotation_to_axis, turned
from ..records import Array, Closure, Coupling, Joint
from ..robot_file import FREEDOMS
from .placement import axis_of, origin_of
from .xml_node import Node

#: One side of a closure: link, frame placed on it by the author, rotation that maps z to the closure's axis.
Side = tuple[str, Array, Array]

POSE = ("xyz", "rpy", "quat_xyzw")

#: Alternative names of the types of `<loop_joint>`, in lower case.
LOOP_JOINT_TYPES = {"3d": "spherical", "ball": "spherical", "6d": "fixed"}


def read_loop(node: Node) -> Closure:
    """Read `<loop>`; `<axis>` is in the frame of the predecessor's origin, `<axis2>` in the successor's."""
    kind = node.text("type")
    if kind != "rows" and kind not in FORMS:
        known = [*FORMS, "rows"]
        raise node.error(f"unknown type '{kind}'{did_you_mean(kind, known)}; known: {listed(known)}")
    attributes = ["name", "type", "rows"] if kind == "rows" else ["name", "type"]
    axes = {"rows": [], "universal": ["axis", "axis2"]}.get(kind, ["axis"])
    node.only(attributes, ["predecessor", "successor", *axes])
    link_a, frame_a = _attached(node.required_child("predecessor"))
    link_b, frame_b = _attached(node.required_child("successor"))
    if kind == "rows":
        return _rows_closure(node, link_a, frame_a, link_b, frame_b)
    axis = _axis(node.child("axis"))
    turn = other = rotation_to_axis(axis) if FORMS[kind].has_axis else np.eye(3)
    if kind == "universal":
        other = rotation_to_axis(_axis(node.required_child("axis2")))
    return _closure(node, kind, FORMS[kind], (link_a, frame_a, turn), (link_b, frame_b, other))


def read_constraint(node: Node) -> Closure:
    """Read `<constraint>`; each side states an axis, and the axes coincide (universal: are perpendicular)."""
    parts = ("parent", "parent_origin", "parent_axis", "child", "child_origin", "child_axis")
    node.only(["name", "type"], parts)
    kind = node.text("type")
    form = FORMS.get(kind)
    if form is None or kind == "prismatic":
        known = [name for name in FORMS if name != "prismatic"]
        raise node.error(
            f"type '{kind}' is not read in <constraint>{did_you_mean(kind, known)}; known: {listed(known)} "
            "(write other closures as <loop>)"
        )
    sides: list[Side] = []
    for side in ("parent", "child"):
        link, origin, axis = (node.child(side + part) for part in ("", "_origin", "_axis"))
        if link is None:
            raise node.error(f"<{side}> is missing")
        link.only(["link"], [])
        if origin is not None:
            origin.only(POSE, [])
        turn = rotation_to_axis(_axis(axis)) if form.has_axis else np.eye(3)
        sides.append((link.text("link"), origin_of(origin), turn))
    return _closure(node, kind, form, sides[0], sides[1])


def read_loop_joint(node: Node) -> Closure:
    """Read `<loop_joint>`, with its links as children (`<link1 link xyz rpy>`) or as attributes.

    The axis is in the first frame. Isaac Sim's exporter writes `link1` twice; the second one is then the
    successor.
    """
    node.only(["name", "type", "link1", "link2"], ["link1", "link2", "axis", "dynamics"])
    stated = node.text("type")
    kind = LOOP_JOINT_TYPES.get(stated.lower(), stated)
    if kind not in FORMS or kind == "universal":
        known = [*(name for name in FORMS if name != "universal"), *LOOP_JOINT_TYPES]
        raise node.error(f"unknown type '{stated}'{did_you_mean(stated, known)}; known: {listed(known)}")
    sides = node.children("link1", "link2")
    if not sides and {"link1", "link2"} <= set(node.attributes()):
        link_a, link_b, frame_a, frame_b = node.text("link1"), node.text("link2"), np.eye(4), np.eye(4)
    else:
        if len(sides) != 2 or [side.tag for side in sides] == ["link2", "link2"]:
            raise node.error('exactly one <link1 link=".."/> and one <link2 link=".."/> are needed')
        first, second = sorted(sides, key=lambda side: side.tag)
        for side in sides:
            side.only(["link", *POSE], [])
        link_a, link_b = first.text("link"), second.text("link")
        frame_a, frame_b = origin_of(first), origin_of(second)
    turn = rotation_to_axis(_axis(node.child("axis"))) if FORMS[kind].has_axis else np.eye(3)
    return _closure(node, kind, FORMS[kind], (link_a, frame_a, turn), (link_b, frame_b, turn))


def read_coupling(node: Node, parents: dict[str, Joint | None]) -> Coupling:
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
    paths = [path_to_root(end, parents) for end in ends]
    shared = {joint.name for joint in paths[0]} & {joint.name for joint in paths[1]}
    terms: list[tuple[str, float]] = []
    for path, factor in zip(paths, (ratio, -1.0), strict=True):
        own = [joint for joint in path if joint.name not in shared and joint.kind != "fixed"]
        if many := next((joint for joint in own if FREEDOMS[joint.kind] != 1), None):
            raise node.error(
                f"joint '{many.name}' on its path is {many.kind}; only joints with one freedom can be coupled"
            )
        terms += [(joint.name, factor) for joint in reversed(own)]
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


def _attached(node: Node) -> tuple[str, Array]:
    node.only(["link"], ["origin"])
    origin = node.child("origin")
    if origin is not None:
        origin.only(POSE, [])
    return node.text("link"), origin_of(origin)


def _axis(node: Node | None) -> Array:
    if node is not None:
        node.only(["xyz"], [])
    return axis_of(node)


def _rows_closure(node: Node, link_a: str, frame_a: Array, link_b: str, frame_b: Array) -> Closure:
    try:
        form = form_of_rows(node.text("rows"))
    except ValueError as error:
        raise node.error(str(error)) from None
    turn = form.rotation_of_frames
    return _closure(node, "rows", form, (link_a, frame_a, turn), (link_b, frame_b, turn))


def _closure(node: Node, kind: str, form: Form, a: Side, b: Side) -> Closure:
    name = node.text("name")
    frame_a, frame_b = (turned(frame, turn) if form.has_axis else frame for _, frame, turn in (a, b))
    return Closure(
        name, kind, a[0], frame_a, b[0], frame_b, form.translations, form.rotation, node.line, a[2]
    )


def path_to_root(link: str, parents: dict[str, Joint | None]) -> list[Joint]:
    """Return the joints from a link to the root; stop at a cycle, which `validate` reports later."""
    path: list[Joint] = []
    seen = {link}
    while (joint := parents.get(link)) is not None:
        path.append(joint)
        link = joint.parent
        if link in seen:
            break
        seen.add(link)
    return path
