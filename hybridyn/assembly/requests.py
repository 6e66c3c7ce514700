"""Checked input of `assemble`: positions of joints, and complete or partial poses of links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..linkage.rigid_motion import RigidMotion
from ..linkage.targets import COORDINATES
from ..spatial import Array, rotation_from_quaternion
from ..structure.robot import HybridRobot
from ..structure.samples import UNIT, as_numbers


@dataclass(frozen=True, eq=False)
class PoseRequest:
    """A pose of a link relative to another: complete (`motion`) or partial (`coordinates`).

    Attributes:
        other: The reference link.
        motion: The complete pose with rates and accelerations, in the reference link, or None.
        coordinates: Coordinate name to its value, rate and acceleration, shape (3, T).
    """

    link: str
    other: str
    motion: RigidMotion | None
    coordinates: dict[str, Array]

    def part(self, start: int, stop: int) -> PoseRequest:
        """Return the pose at some consecutive samples."""
        coordinates = {name: x[:, start:stop] for name, x in self.coordinates.items()}
        return PoseRequest(self.link, self.other, _part(self.motion, start, stop), coordinates)


@dataclass(frozen=True, eq=False)
class Requests:
    """All requests for a robot.

    Attributes:
        samples: Number of samples.
        single: Whether the input is a single sample without a batch axis.
        joints: Joint name to its position, rate and acceleration, shape (3, T).
        base: Motion of a moving or floating base in the world, or None.
        base_quaternion: Its quaternions as given, shape (T, 4), or None.
        strict: Whether the first sample must be reached by a straight motion from a guess that closes the
            loops.
    """

    samples: int
    single: bool
    joints: dict[str, Array]
    poses: tuple[PoseRequest, ...]
    base: RigidMotion | None
    base_quaternion: Array | None
    strict: bool = False

    def part(self, start: int, stop: int) -> Requests:
        """Return the requests for some consecutive samples."""
        return Requests(
            stop - start,
            False,
            {name: x[:, start:stop] for name, x in self.joints.items()},
            tuple(pose.part(start, stop) for pose in self.poses),
            _part(self.base, start, stop),
            None if self.base_quaternion is None else self.base_quaternion[start:stop],
            self.strict,
        )


def _part(motion: RigidMotion | None, start: int, stop: int) -> RigidMotion | None:
    return None if motion is None else RigidMotion(*(x[start:stop] for x in motion.arrays))


def gather_requests(
    robot: HybridRobot, motors: Mapping[str, object], platforms: Mapping[str, object]
) -> Requests:
    """Check the caller's input and build the requests.

    Raises:
        TrajectoryError: A name is unknown, a shape is wrong, a number is not finite, or a quaternion is not
            of unit length.
    """
    kind = dict(zip(robot.joints, robot.kinds, strict=True))
    for name in motors:
        _known(name, kind, "joint")
        if kind[name] not in ("revolute", "continuous", "prismatic"):
            raise TrajectoryError(
                f"joint '{name}' is {kind[name]}: it has no single position; give a pose", column=name
            )
    joints = {name: _three(value, name) for name, value in motors.items()}
    raw = {key: _triple(value) for key, value in platforms.items()}
    sizes = {np.shape(x)[-1] for j in joints.values() for x in j if np.ndim(x)}
    lengths = {n for key, parts in raw.items() for part in parts for n in _lengths(key, part)}
    sizes |= lengths
    if len(sizes) > 1:
        raise TrajectoryError(f"motors and platforms have different numbers of samples: {sorted(sizes)}")
    T = sizes.pop() if sizes else 1
    single = not lengths and not any(np.ndim(x) for j in joints.values() for x in j)
    arrays = {name: np.stack([np.broadcast_to(x, (T,)) for x in parts]) for name, parts in joints.items()}
    base, quaternion = None, None
    poses = []
    for key, parts in raw.items():
        pose = _pose(robot, key, parts, T)
        if pose.link == pose.other and robot.bodies.place[pose.link][0] == 0:
            base = pose.motion
            quaternion = np.broadcast_to(np.asarray(parts[0], dtype=float)[..., 3:], (T, 4))
        else:
            poses.append(pose)
    return Requests(T, single, arrays, tuple(poses), base, quaternion)


def _known(name: str, known: Mapping[str, object], what: str) -> None:
    """Check that a name is known."""
    if name not in known:
        raise TrajectoryError(f"unknown {what} '{name}'{did_you_mean(name, known)}", column=name)


def _triple(value: object) -> tuple[object, object, object]:
    """Return (position, rate, acceleration), None where omitted."""
    parts = list(value) if isinstance(value, (tuple, list)) else [value]
    if not 1 <= len(parts) <= 3:
        raise TrajectoryError("give (position, rate, acceleration), of which the last two may be left out")
    parts += [None] * (3 - len(parts))
    return parts[0], parts[1], parts[2]


def _three(value: object, name: str) -> list[Array]:
    """Return position, rate and acceleration of a joint, each of shape () or (T,), zero where omitted."""
    parts = [as_numbers(0.0 if x is None else x, f"joint '{name}'") for x in _triple(value)]
    for x in parts:
        if x.ndim > 1 or not np.isfinite(x).all():
            raise TrajectoryError(f"joint '{name}' needs finite numbers of shape () or (T,)", column=name)
    return parts


def _lengths(key: str, part: object) -> list[int]:
    """Return the batch sizes in one part of a pose."""
    if part is None:
        return []
    if isinstance(part, Mapping):
        values = (as_numbers(x, f"coordinate '{name}' of '{key}'") for name, x in part.items())
        return [len(x) for x in values if x.ndim]
    array = as_numbers(part, f"the pose of '{key}'")
    return [len(array)] if array.ndim > 1 else []


def _pose(robot: HybridRobot, key: str, parts: Sequence[object], T: int) -> PoseRequest:
    """Read one entry of `platforms`."""
    root = robot.description.root
    link, _, other = key.partition("@")
    _known(link, robot.bodies.place, "link")
    other = other or root
    _known(other, robot.bodies.place, "link")
    on_root = robot.bodies.place[link][0] == 0
    if on_root and (link != root or robot.base == "fixed"):
        raise TrajectoryError(f"link '{link}' is part of the base; it cannot be placed", column=key)
    if robot.bodies.place[link][0] == robot.bodies.place[other][0] and not on_root:
        raise TrajectoryError(f"'{link}' and '{other}' are one rigid body", column=key)
    if isinstance(parts[0], Mapping):
        if on_root:
            raise TrajectoryError("the base needs its whole pose: x, y, z, qx, qy, qz, qw", column=key)
        return PoseRequest(link, other, None, _coordinates(key, parts, T))
    pose, twist, acceleration = (_array(key, x, width, T) for x, width in zip(parts, (7, 6, 6), strict=True))
    norm = np.linalg.norm(pose[:, 3:], axis=1)
    bad = np.flatnonzero(np.abs(norm - 1) > UNIT)
    if len(bad):
        raise TrajectoryError(
            f"quaternion of length {norm[bad[0]]:.9g} (must be 1 to {UNIT:g})",
            row=int(bad[0]) + 1,
            column=key,
        )
    motion = RigidMotion(
        rotation_from_quaternion(pose[:, 3:]),
        pose[:, :3],
        twist[:, 3:],
        twist[:, :3],
        acceleration[:, 3:],
        acceleration[:, :3],
    )
    return PoseRequest(link, other, motion, {})


def _array(key: str, value: object, width: int, T: int) -> Array:
    """Return one part of a pose, shape (T, width), zero where omitted."""
    if value is None:
        return np.zeros((T, width))
    out = np.asarray(value, dtype=float)
    if out.shape not in ((width,), (T, width)) or not np.isfinite(out).all():
        raise TrajectoryError(
            f"needs finite numbers of shape ({width},) or ({T}, {width}), not {out.shape}", column=key
        )
    return np.broadcast_to(out, (T, width))


def _coordinates(key: str, parts: Sequence[object], T: int) -> dict[str, Array]:
    """Read a partial pose: for each coordinate its value, rate and acceleration."""
    values = parts[0]
    assert isinstance(values, Mapping)
    out = {}
    for name in values:
        _known(name, dict.fromkeys(COORDINATES), "coordinate")
        triple = []
        for part in parts:
            given = part.get(name) if isinstance(part, Mapping) else None
            if part is not None and given is None:
                raise TrajectoryError(
                    f"the rates of '{key}' must name the same coordinates as its pose", column=key
                )
            x = np.asarray(0.0 if given is None else given, dtype=float)
            if x.ndim > 1:
                raise TrajectoryError(f"coordinate '{name}' needs numbers of shape () or (T,)", column=key)
            triple.append(np.broadcast_to(x, (T,)))
        out[name] = np.stack(triple)
        if not np.isfinite(out[name]).all():
            raise TrajectoryError(f"coordinate '{name}' is not finite", column=key)
    return out
