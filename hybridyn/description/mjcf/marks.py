"""Closures of MJCF files that `hybridyn convert` wrote, as they were before.

MuJoCo holds a hinge by two connects, and other closures by a body that follows one link and is welded to the
other. A text in `<custom>` names such a closure and its rows:

    <custom><text name="hybridyn:slider" data="tx ty rx ry rz"/></custom>

The equality "slider" then holds the frames. Other equalities, bodies and joints whose names start with
"slider:" belong to it; the mass of such a body is the other half of the link that it is welded to. The text
"hybridyn link:slider" names a massless link whose joints stand in that body. The text "hybridyn base" says
that a free body hangs on the world by a joint and is not the base. For joints see `joint_marks`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...errors import ModelError
from ..closure_forms import FORMS, SIDEWAYS, RowsForm, form_of_rows
from ..names import did_you_mean
from ..placement import inverse, placement_from, turned
from ..records import Array, Closure, Joint, JointKind, Link
from ..robot_file import RobotFile
from .document import Document
from .joint_marks import JOINT, apply_joint_mark, read_joint_mark
from .naming import unique

#: Difference of two frames that is rounding.
SAME_FRAME = 1e-14
#: What the name of a text starts with, before the closure's name.
MARK = "hybridyn:"
#: Name of the text that says that the base is fixed.
BASE = "hybridyn base"
#: End of the name of a follower, after the closure's name.
FOLLOWER = "follower"
#: What the name of a text starts with that holds the name of the massless link at the end of a closure.
LINK = "hybridyn link:"


class Marks(NamedTuple):
    """What texts say.

    Attributes:
        rows: Rows of closures, by the closure's name.
        links: Names of massless links at the end of closures, by the closure's name.
        fixed: Whether the base is fixed though one body floats.
        joints: Kind and frame of the joints that stand as other joints, by name.
    """

    rows: dict[str, RowsForm]
    links: dict[str, str]
    fixed: bool
    joints: dict[str, tuple[JointKind, Array]]


def read_marks(document: Document) -> Marks:
    """Return what the texts of a file say of closures, joints, and of the base.

    Raises:
        ModelError: A text holds no rows, or no frame of a joint.
    """
    joints: dict[str, tuple[JointKind, Array]] = {}
    marks: dict[str, RowsForm] = {}
    links: dict[str, str] = {}
    fixed = False
    for node in document.nodes():
        name = str(node.xml.get("name", ""))
        if node.tag != "text":
            continue
        fixed = fixed or (name == BASE and node.xml.get("data") == "fixed")
        if name.startswith(LINK):
            links[name.removeprefix(LINK)] = str(node.xml.get("data", ""))
        if name.startswith(JOINT):
            joints[name.removeprefix(JOINT)] = read_joint_mark(node)
        if name.startswith(MARK):
            try:
                marks[name.removeprefix(MARK)] = form_of_rows(str(node.xml.get("data", "")))
            except ValueError as error:
                raise node.error(
                    f"text '{name}': {error}; remove it to read the equalities by themselves"
                ) from None
    return Marks(marks, links, fixed, joints)


def apply_marks(robot: RobotFile, marks: Marks) -> None:
    """Turn the equalities, bodies and joints of what is marked into these closures and joints.

    Raises:
        ModelError: There is no equality or joint of this name.
    """
    for name, (joint_kind, frame) in marks.joints.items():
        apply_joint_mark(robot, name, joint_kind, frame)
    names = [closure.name for closure in robot.closures]
    for name, rows in marks.rows.items():
        if name not in names:
            raise ModelError(
                f"<custom> marks the closure '{name}', but no connect or weld has this name"
                f"{did_you_mean(name, names)}; rename the text '{MARK}{name}', or remove it",
                file=robot.file, element=name,
            )  # fmt: skip
        closure = robot.closures[names.index(name)]
        turn = rows.rotation_of_frames
        at_a, at_b = turned(closure.frame_a, turn), turned(closure.frame_b, turn)
        closure = replace(closure, frame_a=at_a, frame_b=at_b, turn=turn)
        prefix = f"{name}:"
        own = {joint.child: joint for joint in robot.joints if joint.name.startswith(prefix)}
        closure, follower = _unfollowed(closure, own, rows)
        if follower is not None:
            _join(robot, *follower)
            if name in marks.links:
                on, place = _hung(follower[0], np.eye(4), own)
                closure = _name_end(robot, closure, on, place, marks.links[name])
        kinds = [
            kind
            for kind, form in FORMS.items()
            if (form.translations, form.rotation) == (rows.translations, rows.rotation)
        ]
        kind = kinds[0] if kinds else "rows"
        robot.closures[names.index(name)] = replace(
            closure, kind=kind, translations=rows.translations, rotation=rows.rotation
        )
        _remove(robot, prefix)
        names = [closure.name for closure in robot.closures]


def _unfollowed(
    closure: Closure, own: dict[str, Joint], rows: RowsForm
) -> tuple[Closure, tuple[str, str, Array] | None]:
    """Return the closure between its two links, and its follower: name, welded link, place in that link."""
    sideways = placement_from(SIDEWAYS, np.zeros(3)) if rows.rotation == "perpendicular" else np.eye(4)
    name = f"{closure.name}:{FOLLOWER}"
    if closure.link_a == name:
        link, frame = _hung(name, closure.frame_a, own)
        at = closure.frame_b @ inverse(closure.frame_a)
        return replace(closure, link_a=link, frame_a=frame @ sideways.T), (name, closure.link_b, at)
    if closure.link_b == name:
        link, frame = _hung(name, closure.frame_b, own)
        at = closure.frame_a @ inverse(closure.frame_b)
        return replace(closure, link_b=link, frame_b=frame @ sideways), (name, closure.link_a, at)
    return closure, None


def _hung(link: str, frame: Array, own: dict[str, Joint]) -> tuple[str, Array]:
    """Return the link that a follower hangs on, and a frame of the follower in it at joint positions zero."""
    while link in own:
        frame, link = own[link].placement @ frame, own[link].parent
    return link, frame


def _join(robot: RobotFile, name: str, welded: str, at: Array) -> None:
    """Add the inertia of a follower to the link that it is welded to, in which its frame is `at`."""
    by_name = {link.name: link for link in robot.links}
    share, link = by_name[name], by_name[welded]
    turn = at[:3, :3]
    moved = turn @ share.com + at[:3, 3]
    mass = share.mass + link.mass
    com = (share.mass * moved + link.mass * link.com) / mass if mass else link.com
    inertia = link.inertia + turn @ share.inertia @ turn.T
    for part, place in ((share, moved), (link, link.com)):
        d = place - com
        inertia = inertia + part.mass * ((d @ d) * np.eye(3) - np.outer(d, d))
    index = robot.links.index(link)
    robot.links[index] = replace(link, mass=mass, com=com, inertia=(inertia + inertia.T) / 2)
    index = robot.links.index(share)
    robot.links[index] = replace(share, mass=0.0, com=np.zeros(3), inertia=np.zeros((3, 3)))


def _remove(robot: RobotFile, prefix: str) -> None:
    """Remove what belongs to a closure: its follower, and its further equalities."""
    gone = {joint.name: joint.child for joint in robot.joints if joint.name.startswith(prefix)}
    robot.joints = [joint for joint in robot.joints if joint.name not in gone]
    robot.links = [link for link in robot.links if link.name not in gone.values()]
    robot.closures = [closure for closure in robot.closures if not closure.name.startswith(prefix)]
    robot.home = {name: at for name, at in robot.home.items() if name not in gone}


def _name_end(robot: RobotFile, closure: Closure, on: str, place: Array, name: str) -> Closure:
    """Name the massless link at the end of a closure, and return the closure.

    Args:
        robot: The robot.
        closure: The closure.
        on: The link that the closure's follower hung on.
        place: The frame of the massless link in it, shape (4, 4). If it is another frame, a fixed joint
            leads to the massless link.
        name: Name of the massless link.
    """
    if np.abs(place - np.eye(4)).max() > SAME_FRAME:
        joint = unique(f"{name}_fixed", {joint.name for joint in robot.joints})
        robot.joints.append(Joint(joint, "fixed", on, name, place, np.array([1.0, 0.0, 0.0])))
        robot.links.append(Link(name, 0.0, np.zeros(3), np.zeros((3, 3))))
    else:
        _rename(robot, on, name)
    if closure.link_a == on:
        return replace(closure, link_a=name, frame_a=inverse(place) @ closure.frame_a)
    return replace(closure, link_b=name, frame_b=inverse(place) @ closure.frame_b)


def _rename(robot: RobotFile, name: str, new: str) -> None:

    def renamed(link: str) -> str:
        """Return the new name of a link."""
        return new if link == name else link

    robot.links = [replace(link, name=renamed(link.name)) for link in robot.links]
    robot.joints = [
        replace(joint, parent=renamed(joint.parent), child=renamed(joint.child)) for joint in robot.joints
    ]
    robot.closures = [
        replace(closure, link_a=renamed(closure.link_a), link_b=renamed(closure.link_b))
        for closure in robot.closures
    ]
