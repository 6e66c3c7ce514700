"""What is given to the exported control step from poses of links, such as a tool, and positions of joints."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...assembly.assemble import assemble_requests
from ...assembly.poses import PoseRequest
from ...assembly.requests import Requests, gather_requests
from ...errors import AssemblyError, ModelError, SingularityError, TrajectoryError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .closing.checked_rows import bent, nearby_requests
from .closing.coupled import Coupled, split_poses
from .closing.members import members_of, wanted_of
from .closing.module_parts import Part, numbers

#: Name of the step.
GIVEN_STEP = "idm_from_given"
#: Numbers of a whole pose, and of its rates; of the direction of an axis; and of a distance from a point.
WHOLE, TWIST = ("x", "y", "z", "qx", "qy", "qz", "qw"), ("x", "y", "z", "wx", "wy", "wz")
POINTED, FAR = ("{}x", "{}y", "{}z"), ("distance", "cx", "cy", "cz")
#: Inputs of the step, then the motion that it gives.
STATES = ("last", "given", "rates", "accelerations", "q", "v_closed", "a_closed")


@dataclass(frozen=True)
class GivenMotion:
    """What is given to a control step.

    Attributes:
        robot: The robot.
        requests: What is given, of any values.
        parts: The modules whose loops are closed; only joints are given in them alone.
        chains: Those of them that poses couple.
    """

    robot: HybridRobot
    requests: Requests
    parts: list[Part]
    chains: list[Coupled]

    @property
    def about(self) -> list[str]:
        """Lines that list the numbers that are given, and their rates."""
        names, rates = list[str](), list[str]()
        for part in self.parts:
            joints = (part.module.mechanism.spec.tree_joint[i] for i in part.given.joints)
            own = [part.module.joints[i] for i in joints if i is not None]
            names += [f"{joint}/position" for joint in own]
            rates += [f"{joint}/velocity" for joint in own]
        for one in self.chains:
            for key, places, changes in _named([self.requests.poses[i] for i in one.poses]):
                names += [f"{key}/pose/{x}" for x in places]
                rates += [f"{key}/velocity/{x}" for x in changes]
        lines = ["   given", *(f"     {i}  {x}" for i, x in enumerate(names))]
        lines += ["   rates, and accelerations likewise", *(f"     {i}  {x}" for i, x in enumerate(rates))]
        return lines + [f"     {one.left}" for one in self.chains if one.left]

    def numbers(self, requests: Requests) -> list[Array]:
        """Return what requests give, its rates and accelerations, shapes (T, numbers) and (T, rates)."""
        wanted = wanted_of(self.robot, requests, split_poses(self.robot, requests, every=True))
        assert wanted is not None
        levels: list[tuple[Array, ...]] = [numbers(self.parts, wanted.own)]
        for one in self.chains:
            g, *rates = one.wanted(requests)
            levels.append((g[:, : g.shape[1] - len(one.given.turning)], *rates))
        return [np.concatenate(level, axis=1) for level in zip(*levels, strict=True)]

    def states(self, q: Array) -> dict[str, Array]:
        """Return inputs and outputs of the step near postures, shape (T, nq), by the general path.

        Postures near which nothing is reached are left out; others stand in for them.

        Raises:
            ModelError: There are no others.
        """
        rows: list[list[Array]] = []
        for t, last in ((t, bent(self.robot, x, t)) for t, x in enumerate(q)):
            requests = nearby_requests(self.robot, self.requests, self.chains, last, t)
            with contextlib.suppress(AssemblyError, SingularityError):
                found = assemble_requests(self.robot, requests, last)
                rows.append([last[None], *self.numbers(requests), *found])
        if not rows:
            raise ModelError(f"{GIVEN_STEP}: what is given is reached near none of {len(q)} postures")
        each = (np.concatenate(x) for x in zip(*rows, strict=True))
        return {name: np.resize(x, (len(q), x.shape[1])) for name, x in zip(STATES, each, strict=True)}


def given_motion(robot: HybridRobot, given: Sequence[str]) -> GivenMotion:
    """Return what columns give: LINK/pose for a whole pose, LINK/pose/x, JOINT/position, as in tables.

    Raises:
        ModelError: The step cannot be exported.
    """
    if robot.base != "fixed":
        raise ModelError(f"{GIVEN_STEP} needs a fixed base, not a {robot.base} one")
    motors, poses = _columns(given)
    if not poses:
        raise ModelError("no pose is given: idm_from_motors takes the positions of motors alone")
    try:
        requests = gather_requests(robot, motors, poses)
        wanted = wanted_of(robot, requests, split_poses(robot, requests, every=True))
        members = None if wanted is None else members_of(robot, wanted)
    except (AssemblyError, SingularityError, TrajectoryError) as error:
        raise ModelError(f"{GIVEN_STEP}: {error}") from error
    whole = sum(column.endswith("/pose") for column in given)
    if members is None or sum(pose.motion is not None for pose in requests.poses) > whole:
        raise ModelError(
            f"{', '.join(given)}: exported C does not close these loops. It takes whole poses (LINK/pose), "
            "orientations, some of x, y, z, roll, pitch and yaw, directions and distances, at most as many "
            "as the modules between the two links can move; what else is given may determine none of these "
            "that has loops"
        )
    return GivenMotion(robot, requests, *members)


def _columns(given: Sequence[str]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return joints and poses by name, with any numbers in place of the values.

    Raises:
        ModelError: A column is none, or is given twice.
    """
    motors, poses = dict[str, Any](), dict[str, Any]()
    for column in given:
        owner, what, name = column.rpartition("/pose/")
        key, alone, rest = column.rpartition("/pose")
        joint, position, end = column.rpartition("/position")
        if owner and what and name not in poses.setdefault(owner, ({},))[0]:
            poses[owner][0][name] = 0.5 if name in WHOLE[3:] else 1.0
        elif alone and not rest and key not in poses:
            poses[key] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]
        elif position and not end and joint not in motors:
            motors[joint] = 0.0
        else:
            raise ModelError(
                f"'{column}' is given twice, or is none of LINK/pose, LINK/pose/x ... and JOINT/position",
                element=column,
            )
    return motors, poses


def _named(poses: Sequence[PoseRequest]) -> list[tuple[str, Sequence[str], Sequence[str]]]:
    """Return the link of each target, and the names of its numbers and rates, see `Coupled.wanted`."""
    found: list[tuple[PoseRequest, Sequence[str], Sequence[str]]] = []
    found += [(pose, WHOLE, TWIST) for pose in poses if pose.motion is not None]
    found += [(pose, names, names) for pose in poses if (names := tuple(pose.coordinates))]
    for pose in poses:
        if pose.direction is not None:
            own = tuple(name.format("xyz"[pose.direction[0]]) for name in POINTED)
            found.append((pose, own, own))
    found += [(pose, FAR, FAR) for pose in poses if pose.distance is not None]
    found += [(pose, WHOLE[3:], TWIST[3:]) for pose in poses if pose.turn is not None]
    return [(f"{pose.link}@{pose.other}", names, rates) for pose, names, rates in found]
