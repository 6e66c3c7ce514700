"""Checked input of `assemble`: positions of joints, complete or partial poses of links, a guess."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import AssemblyError, TrajectoryError
from ..linkage.motion import Motion
from ..spatial import LARGEST, Array, quaternion_from_rotation, rotation_from_quaternion
from ..structure.given import by_name, motors_by_name
from ..structure.robot import HybridRobot, joint_position
from ..structure.samples import as_numbers
from ..tables.signals import WORLD
from .poses import PoseRequest, check_known, for_all, level_triple, pose_levels, pose_request
from .redundancy import LEAST, check_rule

#: Motions that may contradict one another, see `Requests.nearest`: measured ones, or those judged elsewhere.
MOTIONS = ("rates", "accelerations")


class Requests(NamedTuple):
    """All requests for a robot.

    Attributes:
        samples: Number of samples.
        single: Whether the input is a single sample without a batch axis.
        joints: Joint name to its position, rate and acceleration, shape (3, T).
        base: Motion of a moving or floating base in the world, or None.
        base_quaternion: Its quaternions as given, shape (T, 4), or None.
        strict: Whether the first sample must be reached by a straight motion from a guess that closes the
            loops.
        nearest: Which of "rates" and "accelerations" may contradict one another: they become those of the
            nearest motion. Others are an error then.
        stay: Whether joints that nothing determines stay at home; else they are an error.
        weights: Motor to the factor of its motion, where motors move least; 1 for others.
        redundancy: The rule for freedoms that are left, one of `RULES`.
    """

    samples: int
    single: bool
    joints: dict[str, Array]
    poses: tuple[PoseRequest, ...]
    base: Motion | None
    base_quaternion: Array | None
    strict: bool = False
    nearest: tuple[str, ...] = ()
    stay: bool = False
    weights: Mapping[str, float] = MappingProxyType({})
    redundancy: str = LEAST

    def part(self, start: int, stop: int) -> Requests:
        """Return the requests for some consecutive samples."""
        return Requests(
            stop - start,
            False,
            {name: x[:, start:stop] for name, x in self.joints.items()},
            tuple(pose.part(start, stop) for pose in self.poses),
            self.base and self.base.take(np.arange(start, stop)),
            None if self.base_quaternion is None else self.base_quaternion[start:stop],
            self.strict,
            self.nearest,
            self.stay,
            self.weights,
            self.redundancy,
        )


def gather_requests(
    robot: HybridRobot,
    motors: Mapping[str, object] | ArrayLike | None,
    platforms: Mapping[str, object] | None,
    nearest: bool = False,
    redundancy: str = LEAST,
) -> Requests:
    """Check the caller's input, see `assemble`, and build the requests.

    Raises:
        TrajectoryError: A name is unknown, a shape is wrong, a number is not finite, or a quaternion is not
            of unit length.
    """
    check_rule(redundancy)
    motors, platforms = motors_by_name(robot, motors), by_name(platforms)
    for name in motors:
        _single(robot, name)
    joints = {name: level_triple(value, f"joint '{name}'", name) for name, value in motors.items()}
    places = {key: _link_and_reference(robot, key) for key in platforms}
    given = {key: pose_levels(key, value) for key, value in platforms.items()}
    triples = [joints, *(one for one in given.values() if isinstance(one, dict))]
    sizes = {len(x) for one in triples for triple in one.values() for x in triple if x.ndim}
    sizes |= {len(x) for one in given.values() if isinstance(one, list) for x in one if x.ndim == 2}
    if len(sizes) > 1:
        raise TrajectoryError(f"motors and platforms have different numbers of samples: {sorted(sizes)}")
    (T,) = sizes or {1}
    base, quaternion, poses = None, None, []
    for key, one in given.items():
        link, other = places[key]
        pose = pose_request(link, other, one, T)
        if link != other:
            poses.append(pose)
        elif base is not None:
            raise TrajectoryError(f"the pose of '{link}' in the world is given twice", column=key)
        elif pose.motion is None or pose.further:
            raise TrajectoryError("the base needs its whole pose: x, y, z, qx, qy, qz, qw", column=key)
        else:
            base = pose.motion
            quaternion = quaternion_from_rotation(base.R)
            if isinstance(one, list):
                quaternion = np.broadcast_to(one[0][..., 3:], (T, 4))  # with the sign that it has
    accelerations = [levels[2] for one in triples for levels in one.values()]
    accelerations += [one[2] for one in given.values() if isinstance(one, list)]
    unchecked = MOTIONS if nearest else () if any(map(np.any, accelerations)) else MOTIONS[1:]  # none given
    return Requests(
        T, not sizes, for_all(joints, T), tuple(poses), base, quaternion, nearest=unchecked,
        redundancy=redundancy,
    )  # fmt: skip


def asked_requests(
    robot: HybridRobot,
    motors: Mapping[str, object] | ArrayLike | None,
    platforms: Mapping[str, object] | None,
    guess: Array | None,
    nearest: bool,
    hold: Iterable[str],
    weights: Mapping[str, float] | None,
    redundancy: str,
) -> Requests:
    """Check the caller's input, and build the requests; arguments and errors are those of `assemble`."""
    given = motors_by_name(robot, motors)
    given = {**given, **held(robot, hold, given, first_guess(robot, guess))}
    requests = gather_requests(robot, given, platforms, nearest, redundancy)
    weights = checked_weights(robot, weights or {})
    return requests._replace(strict=guess is not None, weights=weights)


def held(robot: HybridRobot, hold: Iterable[str], given: Collection[str], guess: Array) -> dict[str, float]:
    """Return the positions at a guess, shape (nq,), of joints that are held.

    Args:
        given: Joints whose positions are given.

    Raises:
        TrajectoryError: A name is unknown, or a joint is given, or has no single position.
    """
    out = {}
    for name in [hold] if isinstance(hold, str) else hold:
        _single(robot, name)
        if name in given:
            raise TrajectoryError(f"joint '{name}' is held, and its position is given", column=name)
        out[name] = float(joint_position(robot, guess, name))
    return out


def checked_weights(robot: HybridRobot, weights: Mapping[str, float]) -> Mapping[str, float]:
    """Return the factors of motors' motions.

    Raises:
        TrajectoryError: A name is that of no motor, or a factor is not positive and finite.
    """
    for name, weight in weights.items():
        check_known(name, robot.motors, "motor")
        if not 0.0 < weight < np.inf:
            raise TrajectoryError(f"the weight of '{name}' is {weight}; give a positive number", column=name)
    return weights


def in_root(robot: HybridRobot, requests: Requests, guess: Array) -> Requests:
    """Return the requests with poses in the world as poses relative to the root link of a base that moves.

    Whole poses become those in the root link; others are measured in a frame that moves in it.

    Args:
        guess: Initial posture, shape (nq,): a base whose motion is not given rests there.
    """
    if all(pose.other in robot.bodies.place for pose in requests.poses):
        return requests
    at_rest = Motion.at_rest(requests.samples, rotation_from_quaternion(guess[3:7]), guess[:3])
    base, root = requests.base or at_rest, robot.description.root
    poses = []
    for pose in requests.poses:
        if pose.other in robot.bodies.place:
            poses.append(pose)
        elif pose.motion is None or pose.further:
            poses.append(pose._replace(other=root, frame=base))
        else:
            poses.append(pose._replace(other=root, motion=pose.motion.seen_from(base)))
    return requests._replace(poses=tuple(poses))


def home_requests(robot: HybridRobot, joints: Mapping[str, float] | None = None) -> Requests:
    """Build the requests for a closed posture at home: motors are at home, and what nothing determines stays.

    Args:
        joints: Positions of joints that are elsewhere [m or rad]. In a module of which one has no motor, a
            motor that is not named stays at home only if the others leave it free.

    Raises:
        TrajectoryError: A name is unknown, or a joint has no single position.
    """
    named, moved = dict(joints or {}), set[str]()
    for module in robot.modules:
        if set(module.joints) & {*named} - {*robot.motors}:
            moved |= {*module.motors}
    motors = {
        name: float(joint_position(robot, robot.home, name)) for name in robot.motors if name not in moved
    }
    return gather_requests(robot, motors | named, None)._replace(stay=True)


def _single(robot: HybridRobot, name: str) -> None:
    """Raise unless a name is that of a joint with a single position."""
    check_known(name, robot.joint_index, "joint")
    kind = robot.kinds[robot.joint_index[name]]
    if not kind.single:
        raise TrajectoryError(
            f"joint '{name}' is {kind}: it has no single position; give a pose", column=name
        )


def _link_and_reference(robot: HybridRobot, key: str) -> tuple[str, str]:
    """Return the two links of a key of `platforms`, perhaps the `WORLD` of a base that moves."""
    place, root = robot.bodies.place, robot.description.root
    link, _, other = key.partition("@")
    check_known(link, place, "link")
    other = other or root
    check_known(other, {WORLD, *place}, "link")
    on_root = place[link][0] == 0
    if on_root and (link != root or robot.base == "fixed"):
        raise TrajectoryError(f"link '{link}' is part of the base; it cannot be placed", column=key)
    if other not in place:
        return link, root if on_root or robot.base == "fixed" else WORLD
    if place[link][0] == place[other][0] and not on_root:
        raise TrajectoryError(f"'{link}' and '{other}' are one rigid body", column=key)
    return link, other


def first_guess(robot: HybridRobot, guess: Array | None) -> Array:
    """Return the initial posture, shape (nq,); the home posture by default.

    Raises:
        AssemblyError: It has a wrong size, a number that is not finite or too large, or a joint's cosine and
            sine, or quaternion, of length zero.
    """
    if guess is None:
        return robot.home
    guess = as_numbers(guess, "guess").reshape(-1)
    if guess.shape != (robot.nq,):
        raise AssemblyError(f"guess has {guess.size} entries, the robot's q has {robot.nq}")
    check_guess(robot, guess)
    return guess


def check_guess(robot: HybridRobot, guess: Array) -> None:
    """Raise if initial postures, shape (..., nq), are none; the errors are those of `first_guess`."""
    if not (np.abs(guess) <= LARGEST).all():
        raise AssemblyError(f"guess has a number that is not finite, or above {LARGEST:.0e}")
    for columns in robot.unit_coordinates:
        if not guess[..., columns].any(axis=-1).all():
            raise AssemblyError("guess has a joint whose cosine and sine, or quaternion, are all zero")
