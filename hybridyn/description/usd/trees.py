"""Links, joints and closures of a USD robot, as records.

The frame of a body's link is that of its prim, without scale. A joint whose axis does not pass through this
origin ends in a link without mass, to which the body is welded.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..closure_forms import ROWS, SINGLE_ROTATION, form_of_rows
from ..mjcf.naming import unique
from ..placement import inverse, turned
from ..records import Array, Closure, Joint, JointKind, Link
from ..robot_file import RobotFile
from .driving import Driving, is_driven, with_properties
from .joints import AXES, UsdJoint, direction
from .screening import weighs

#: Largest distance from a body's origin at which an axis still passes through it, relative to its offset.
ON_AXIS = 4 * np.finfo(float).eps

#: Largest deviation of a rotation matrix that hybridyn wrote in double precision.
ORTHONORMAL = 1e-12

#: Axes of the second frame of a universal joint as hybridyn writes it: its own axis z is y there, so that the
#: frames coincide and the twist about x is locked.
SECOND_AXIS = np.eye(3)[:, [1, 2, 0]]

#: Kinds of the joints of a chain that have several freedoms.
SEVERAL: dict[str, JointKind] = {"ball": "spherical", "all": "floating", "plane": "planar"}


def add_joint(
    robot: RobotFile,
    joint: UsdJoint,
    forward: bool,
    name: str,
    ends: tuple[str, str],
    driving: Driving,
    taken: tuple[set[str], set[str]],
) -> dict[str, str]:
    """Add a joint of the tree to the robot, as a chain of joints where it has several axes.

    Args:
        forward: Whether its second body is the child.
        ends: Names of the links of its first and second body.
        driving: The motors, to which its own are added.
        taken: Names of links and joints, to which those that are made are added.

    Returns:
        Name of the joint of each axis ("ball" and "all" for several).
    """
    (near, far), (parent, child) = (joint.frames, ends) if forward else (joint.frames[::-1], ends[::-1])
    chain = joint.chain() or [""]
    axes = chain if forward else chain[::-1]
    at, names = near, {}
    links, joints = taken
    for number, axis in enumerate(axes):
        last = number == len(axes) - 1
        own = name if len(axes) == 1 else unique(f"{name}_{axis}", joints)
        joints.add(own)
        names[axis] = own
        record = _record(joint, axis, own, parent, forward, at, far if last else np.eye(4))
        between = not last or _needs_weld(axis, record, far)
        if between:
            record = _record(joint, axis, own, parent, forward, at, np.eye(4))
        below = unique(f"{child}_{own}", links) if between else child
        record = replace(record, child=below)
        robot.joints.append(with_properties(joint, axis, record, driving))
        if between:
            links.add(below)
            robot.links.append(Link(below, 0.0, np.zeros(3), np.zeros((3, 3)), None, True))
            parent, at = below, np.eye(4)
            if last:
                weld = unique(f"{own}_fixed", joints)
                joints.add(weld)
                robot.joints.append(
                    Joint(weld, "fixed", parent, child, inverse(far), np.array([1.0, 0.0, 0.0]))
                )
    return names


def _record(
    joint: UsdJoint, axis: str, name: str, parent: str, forward: bool, at: Array, far: Array
) -> Joint:
    """Return the record of one axis; `far` is the joint's frame in the child."""
    kind: JointKind = "fixed"
    along = np.array([1.0, 0.0, 0.0])
    if axis in SEVERAL:
        kind = SEVERAL[axis]
        along = np.array([0.0, 0.0, 1.0]) if axis == "plane" else along
    elif axis:
        kind = "revolute" if axis.startswith("rot") else "prismatic"
        if kind == "revolute" and joint.prim.word("hybridyn:kind", "") == "continuous":
            kind = "continuous"
        along = far[:3, :3] @ direction(axis) * (1.0 if forward else -1.0)
    return Joint(name, kind, parent, "", at @ inverse(far), along)


def _needs_weld(axis: str, record: Joint, far: Array) -> bool:
    """Return whether the motion of the last axis is no motion about the origin of the child."""
    offset = far[:3, 3]
    if not offset.any() or axis == "" or axis.startswith("trans"):
        return False
    if axis.startswith("rot"):
        across = offset - record.axis * (record.axis @ offset)
        return bool(np.abs(across).max() > ON_AXIS * np.abs(offset).max())
    return True


def closure_of(joint: UsdJoint, name: str, ends: tuple[str, str]) -> Closure:
    """Return a joint that closes a loop as a closure.

    Raises:
        ModelError: It has a motor, friction or armature, which only joints of the tree have.
    """
    prim = joint.prim
    if is_driven(joint):
        raise prim.error(
            "a drive acts on a joint that closes a loop; close the loop by a joint without one "
            "(physics:excludeFromArticulation = true on that)"
        )
    if weighs(prim, limits=False):
        raise prim.error(
            "armature and friction of a joint that closes a loop are not read; set them to 0, or close the "
            "loop by another joint (physics:excludeFromArticulation = true on that)"
        )
    if prim.word("hybridyn:rotation", "") == "perpendicular":
        locked = tuple(i for i in range(3) if AXES[i] not in joint.free)
        return Closure(
            name, _kind(joint), ends[0], joint.frames[0], ends[1], turned(joint.frames[1], SECOND_AXIS.T),
            locked, "perpendicular", None, _turn(joint, np.eye(3)),
        )  # fmt: skip
    rows = [row for row, axis in zip(ROWS, AXES, strict=True) if axis not in joint.free]
    try:
        form = form_of_rows(" ".join(rows))
    except ValueError:
        raise prim.error(SINGLE_ROTATION) from None
    turn = form.rotation_of_frames
    frame_a, frame_b = (turned(frame, turn) for frame in joint.frames)
    return Closure(
        name, _kind(joint), ends[0], frame_a, ends[1], frame_b, form.translations, form.rotation, None,
        _turn(joint, turn),
    )  # fmt: skip


def _kind(joint: UsdJoint) -> str:
    """Return the word of the file for a closure."""
    word = joint.prim.kind.removeprefix("Physics").removesuffix("Joint").lower()
    return joint.prim.word("hybridyn:kind", word or "rows")


def _turn(joint: UsdJoint, turn: Array) -> Array:
    """Return the author's axes; those that hybridyn wrote rank above."""
    stated = joint.prim.values.get("hybridyn:turn")
    try:
        out = turn if stated is None else np.array(stated, dtype=float)
    except (TypeError, ValueError):
        out = np.zeros(0)
    if out.shape != (3, 3) or not np.abs(out @ out.T - np.eye(3)).max() < ORTHONORMAL:
        raise joint.prim.error("'hybridyn:turn' is no rotation matrix")
    return out
