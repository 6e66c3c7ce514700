"""Checked input of `assemble`: positions of joints, complete or partial poses of links, a guess."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..description.names import did_you_mean
from ..errors import AssemblyError, TrajectoryError
from ..linkage.targets import COORDINATES
from ..linkage.tree import Motion
from ..spatial import LARGEST, Array, quaternion_from_rotation, rotation_from_quaternion
from ..structure.given import by_name, motors_by_name, pose_numbers, triple
from ..structure.robot import HybridRobot, joint_position
from ..structure.samples import as_numbers
from .orientation import LENGTHS, PLACES, check_unit, rate_names, turn_of

#: Motions that may contradict one another, see `Requests.nearest`: measured ones, or those judged elsewhere.
MOTIONS = ("rates", "accelerations")
#: Largest positions, rates and accelerations, and what messages say of it. A far position is out of reach.
MOST = (float(np.finfo(float).max), LARGEST, LARGEST)
AT_MOST = ("", *[f", at most {LARGEST:.0e}"] * 2)


class PoseRequest(NamedTuple):
    """A pose of a link relative to another: complete (`motion`), or some of its coordinates.

    Attributes:
        other: The reference link.
        motion: The complete pose with rates and accelerations, in the reference link, or None.
        coordinates: Coordinate name to its value, rate and acceleration, shape (3, T).
        turn: The complete orientation without the position, as a motion in the reference link, or None.
    """

    link: str
    other: str
    motion: Motion | None
    coordinates: dict[str, Array]
    turn: Motion | None = None

    def part(self, start: int, stop: int) -> PoseRequest:
        """Return the pose at some consecutive samples."""
        coordinates = {name: x[:, start:stop] for name, x in self.coordinates.items()}
        motion, turn = (x and x.take(np.arange(start, stop)) for x in (self.motion, self.turn))
        return PoseRequest(self.link, self.other, motion, coordinates, turn)


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
        )


def gather_requests(
    robot: HybridRobot,
    motors: Mapping[str, object] | ArrayLike | None,
    platforms: Mapping[str, object] | None,
    nearest: bool = False,
) -> Requests:
    """Check the caller's input, see `assemble`, and build the requests.

    Raises:
        TrajectoryError: A name is unknown, a shape is wrong, a number is not finite, or a quaternion is not
            of unit length.
    """
    motors, platforms = motors_by_name(robot, motors), by_name(platforms)
    kind = dict(zip(robot.joints, robot.kinds, strict=True))
    for name in motors:
        _known(name, kind, "joint")
        if kind[name] not in ("revolute", "continuous", "prismatic"):
            raise TrajectoryError(
                f"joint '{name}' is {kind[name]}: it has no single position; give a pose", column=name
            )
    joints = {name: _three(value, f"joint '{name}'", name) for name, value in motors.items()}
    places = {key: _link_and_reference(robot, key) for key in platforms}
    given = {key: _pose(key, value) for key, value in platforms.items()}
    triples = [joints, *(one for one in given.values() if isinstance(one, dict))]
    sizes = {len(x) for one in triples for triple in one.values() for x in triple if x.ndim}
    sizes |= {len(x) for one in given.values() if isinstance(one, list) for x in one if x.ndim == 2}
    if len(sizes) > 1:
        raise TrajectoryError(f"motors and platforms have different numbers of samples: {sorted(sizes)}")
    (T,) = sizes or {1}
    base, quaternion, poses = None, None, []
    for key, one in given.items():
        link, other = places[key]
        pose = _pose_request(link, other, one, T)
        if link != other:
            poses.append(pose)
        elif pose.motion is None:
            raise TrajectoryError("the base needs its whole pose: x, y, z, qx, qy, qz, qw", column=key)
        else:
            base = pose.motion
            quaternion = quaternion_from_rotation(base.R)
            if isinstance(one, list):
                quaternion = np.broadcast_to(one[0][..., 3:], (T, 4))  # with the sign that it has
    accelerations = [levels[2] for one in triples for levels in one.values()]
    accelerations += [one[2] for one in given.values() if isinstance(one, list)]
    unchecked = MOTIONS if nearest else () if any(map(np.any, accelerations)) else MOTIONS[1:]  # none given
    return Requests(T, not sizes, _for_all(joints, T), tuple(poses), base, quaternion, nearest=unchecked)


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


def _known(name: str, known: Collection[str], what: str) -> None:
    """Check that a name is known."""
    if name not in known:
        raise TrajectoryError(f"unknown {what} '{name}'{did_you_mean(name, known)}", column=name)


def _link_and_reference(robot: HybridRobot, key: str) -> tuple[str, str]:
    """Return the two links of a key of `platforms`."""
    place, root = robot.bodies.place, robot.description.root
    link, _, other = key.partition("@")
    _known(link, place, "link")
    other = other or root
    _known(other, place, "link")
    on_root = place[link][0] == 0
    if on_root and (link != root or robot.base == "fixed"):
        raise TrajectoryError(f"link '{link}' is part of the base; it cannot be placed", column=key)
    if place[link][0] == place[other][0] and not on_root:
        raise TrajectoryError(f"'{link}' and '{other}' are one rigid body", column=key)
    return link, other


def _three(value: object, what: str, column: str) -> list[Array]:
    """Return position, rate and acceleration of a coordinate, shape () or (T,) each, zero where omitted."""
    parts = [as_numbers(0.0 if x is None else x, what) for x in triple(value)]
    for level, x in enumerate(parts):
        if x.ndim > 1 or not (np.abs(x) <= MOST[level]).all():
            wanted = f"finite numbers of shape () or (T,){AT_MOST[level]}"
            raise TrajectoryError(f"{what} needs {wanted}", column=column)
    return parts


def _for_all(triples: Mapping[str, list[Array]], T: int) -> dict[str, Array]:
    """Return positions, rates and accelerations at all samples, shape (3, T), by name."""
    return {name: np.stack([np.broadcast_to(x, (T,)) for x in parts]) for name, parts in triples.items()}


def _pose(key: str, value: object) -> list[Array] | dict[str, list[Array]]:
    """Return pose, twist and acceleration, shape (width,) or (T, width), or the triples of a partial pose."""
    one = isinstance(value, list | tuple) and all(isinstance(x, int | float) for x in value)
    parts = triple((value,) if one else value)
    if not isinstance(parts[0], Mapping):
        parts = (pose_numbers(key, parts[0]), *parts[1:])
        return [_array(key, part, width) for part, width in zip(parts, (7, 6, 6), strict=True)]
    out = {}
    for name in parts[0]:
        _known(name, PLACES, "coordinate")
    names = rate_names(parts[0], key)
    wanted = (set(parts[0]), set(names), set(names))
    for part, own in zip(parts, wanted, strict=True):
        if part is not None and not (isinstance(part, Mapping) and set(part) == own):
            raise TrajectoryError(
                f"the rates of '{key}' must name the coordinates of its pose ({', '.join(names)})", column=key
            )
    for name in dict.fromkeys((*parts[0], *names)):
        levels = tuple(part.get(name) if isinstance(part, Mapping) else None for part in parts)
        out[name] = _three(levels, f"coordinate '{name}' of '{key}'", key)
    return out


def _pose_request(link: str, other: str, one: list[Array] | dict[str, list[Array]], T: int) -> PoseRequest:
    """Build the request of a pose at T samples: whole, or some coordinates and a complete orientation."""
    key = link if link == other else f"{link}@{other}"
    if isinstance(one, list):
        return PoseRequest(link, other, _motion(key, one, T), {})
    coordinates = _for_all(one, T)
    turn = turn_of(coordinates, key)
    if turn is not None and set(LENGTHS) <= set(coordinates):
        return PoseRequest(link, other, turn, {})
    names = LENGTHS if turn is not None else COORDINATES
    return PoseRequest(link, other, None, {n: x for n, x in coordinates.items() if n in names}, turn)


def _array(key: str, value: object, width: int) -> Array:
    """Return one part of a pose, shape (width,) or (T, width), zero where omitted."""
    out = as_numbers(np.zeros(width) if value is None else value, f"the pose of '{key}'")
    level = int(width == 6)
    if out.shape[-1:] != (width,) or out.ndim > 2 or not (np.abs(out) <= MOST[level]).all():
        raise TrajectoryError(
            f"needs finite numbers of shape ({width},) or (T, {width}){AT_MOST[level]}"
            + (f" or a matrix or pin.SE3, such as {{{key!r}: [0, 0, 0.5, 0, 0, 0, 1]}}" if width == 7 else "")
            + f", not {out.shape}",
            column=key,
        )
    return out


def _motion(key: str, parts: list[Array], T: int) -> Motion:
    """Return the motion of a complete pose at all samples."""
    pose, twist, acceleration = (np.broadcast_to(x, (T, x.shape[-1])) for x in parts)
    check_unit(pose[:, 3:], key)
    return Motion(
        rotation_from_quaternion(pose[:, 3:]),
        pose[:, :3],
        twist[:, 3:],
        twist[:, :3],
        acceleration[:, 3:],
        acceleration[:, :3],
    )


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
