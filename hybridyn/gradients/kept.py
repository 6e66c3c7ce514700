"""What stays while parameters change: positions of joints, and coordinates of links."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..assembly.requests import Requests
from ..description.names import did_you_mean
from ..dynamics.actuation import load_share
from ..errors import ModelError
from ..linkage.targets import COORDINATES
from ..spatial import Index, indices
from ..structure.robot import HybridRobot

#: A coordinate of a link, in columns of tables.
POSE = "/pose/"


class Kept(NamedTuple):
    """What stays while parameters change, with its rates and accelerations.

    Attributes:
        freedoms: Freedoms of joints, numbers of entries of v.
        links: Links, each with the link in which it is seen and the names of its coordinates.
    """

    freedoms: Index
    links: tuple[tuple[str, str, tuple[str, ...]], ...]


def kept_by_name(robot: HybridRobot, names: Sequence[str]) -> Kept:
    """Return what names say: "JOINT", or "LINK/pose/x" (also y, z, roll, pitch, yaw) seen from the root link.

    Raises:
        ModelError: There is no such joint, link or coordinate.
    """
    joints, links = list[str](), dict[str, list[str]]()
    for name in names:
        link, found, coordinate = name.partition(POSE)
        if found:
            _check(link, list(robot.bodies.place), "link")
            _check(coordinate, COORDINATES, f"coordinate of '{link}'")
            links.setdefault(link, []).append(coordinate)
        else:
            _check(name, robot.joints, "joint")
            joints.append(name)
    root = robot.description.root
    return Kept(_freedoms(robot, joints), tuple((link, root, (*own,)) for link, own in links.items()))


def kept_by_requests(robot: HybridRobot, requests: Requests) -> Kept:
    """Return what requests prescribe.

    Raises:
        ModelError: They prescribe a distance from a point, or a pose in a frame that moves.
    """
    links = []
    for pose in requests.poses:
        if pose.distance is not None or pose.other not in robot.bodies.place:
            what = "distance" if pose.distance is not None else "pose in the world of a base that moves"
            raise ModelError(
                f"'{pose.link}' has a prescribed {what}, for which there are no gradients: prescribe "
                "coordinates in a link",
                element=pose.link,
            )
        names = [*pose.coordinates]
        names += [*COORDINATES[:3], "turn"] if pose.motion is not None else []
        names += ["turn"] if pose.turn is not None else []
        names += [f"along {'xyz'[pose.direction[0]]}"] if pose.direction is not None else []
        links.append((pose.link, pose.other, tuple(names)))
    return Kept(_freedoms(robot, [*requests.joints]), tuple(links))


def _freedoms(robot: HybridRobot, joints: Sequence[str]) -> Index:
    """Return the freedoms of joints."""
    return np.array(indices(robot.v_slices[robot.joint_index[joint]] for joint in joints), dtype=int)


def _check(name: str, known: Sequence[str], what: str) -> None:
    """Raise if there is nothing of a name."""
    if name not in known:
        raise ModelError(f"keep: there is no {what} '{name}'{did_you_mean(name, known)}", element=name)


def has_undriven(robot: HybridRobot) -> bool:
    """Return whether some motion has no motor: its acceleration follows the parameters, too."""
    return robot.base == "floating" or any(len(m.motors) < m.mobility for m in robot.modules)


def check_held(robot: HybridRobot, kept: Kept) -> None:
    """Check that efforts have gradients at what stays.

    Args:
        robot: The robot.
        kept: What stays.

    Raises:
        ActuationError: Motors share a load, and have different units and no effort limits.
        ModelError: A motor does not stay beside motions without a motor.
    """
    for module in robot.modules:
        if len(module.motors) > module.mobility:
            load_share(robot, module, None)
    if has_undriven(robot) and not {*robot.motor_v} <= {*kept.freedoms}:
        raise ModelError(
            "where motions have no motor, efforts have gradients at accelerations of the motors: name all "
            "motors in 'keep', too, or take 'ddm'", element="keep",
        )  # fmt: skip


def check_motors_kept(robot: HybridRobot, kept: Kept) -> None:
    """Check that the motors, one for each motion, are what stays, as the mass matrix needs.

    Raises:
        ModelError: They are not, or something else stays.
    """
    if has_undriven(robot) or any(len(m.motors) > m.mobility for m in robot.modules):
        raise ModelError(
            "the mass matrix has gradients where every motion has one motor: a motion of this robot has "
            "none, or several; take 'ddm'", element="motors",
        )  # fmt: skip
    if [*kept.freedoms] != [*robot.motor_v] or kept.links:
        raise ModelError("the mass matrix is one over motors: leave 'keep' to them", element="keep")
