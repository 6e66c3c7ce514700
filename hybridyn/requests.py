"""What a caller of `assemble` wants, sorted by module: given joints, and targets for bodies."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from .errors import AssemblyError, TrajectoryError
from .module import Mechanism
from .rigid_motion import RigidMotion
from .robot import HybridRobot
from .spatial import Array, cross, quaternion_from_rotation, rotate_back, rotation_from_quaternion
from .targets import COORDINATES, CoordinateTarget, PoseTarget, Target

#: A quaternion in a pose may be this far from unit length.
UNIT = 1e-6
#: Turns beyond this are no position of a joint that has ends [rad]; beyond `BLUR` an angle has lost its
#: digits.
WOUND_UP, BLUR = 1e4, 1e8
#: Lengths beyond this many of a module's own are out of reach of its loops.
FAR = 1e3


@dataclass
class ModuleRequest:
    """What is wanted of one module, on its tree after the cuts.

    Attributes:
        given: Joints whose positions are given.
        known: Their positions in an array of shape (T, nq).
        known_v: Their rates, shape (T, nv).
        known_a: Their accelerations, shape (T, nv).
        targets: Poses of other bodies.
        names: Links of the targets.
    """

    given: list[int]
    known: Array
    known_v: Array
    known_a: Array
    targets: list[Target] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class PoseRequest:
    """A pose of a link relative to another: whole (`motion`) or partial (`coordinates`).

    Attributes:
        link: The link.
        other: The link it is relative to.
        motion: The whole pose with its rates, in the other link, or None.
        coordinates: For each coordinate its value, rate and acceleration, shape (3, T).
    """

    link: str
    other: str
    motion: RigidMotion | None
    coordinates: dict[str, Array]


@dataclass(frozen=True)
class Requests:
    """Everything that is wanted.

    Attributes:
        samples: Number of samples.
        single: Whether a single sample came in without a batch axis.
        joints: For each joint its position, rate and acceleration, shape (3, T).
        poses: The poses.
        base: Pose of a moving or floating base in the world, or None.
        base_quaternion: Its quaternions as they were given, shape (T, 4), or None.
    """

    samples: int
    single: bool
    joints: dict[str, Array]
    poses: tuple[PoseRequest, ...]
    base: RigidMotion | None
    base_quaternion: Array | None

    def for_module(
        self, robot: HybridRobot, number: int, base_body: int, bodies: Mapping[int, RigidMotion]
    ) -> ModuleRequest:
        """Give what is wanted of one module.

        Args:
            robot: The robot.
            number: Number of the module.
            base_body: Body it stands on.
            bodies: Motions of the bodies assembled so far, in the root body.
        """
        module = robot.modules[number]
        m = module.mechanism
        T = self.samples
        request = ModuleRequest(
            [], np.tile(m.home, (T, 1)), np.zeros((T, m.tree.nv)), np.zeros((T, m.tree.nv))
        )
        tree_joint = {source: i for i, source in enumerate(m.spec.tree_joint) if source is not None}
        for i, joint in enumerate(module.joints):
            if joint in self.joints:
                if i not in tree_joint:
                    raise AssemblyError(
                        f"joint '{joint}' belongs to a wrist that follows the platform of module "
                        f"'{module.name}'; give the platform's pose instead",
                        module=module.name,
                    )
                self._give_joint(request, m.tree.joints[tree_joint[i]].kind, m, tree_joint[i], joint)
        for pose in self.poses:
            body, R, p = robot.bodies.place[pose.link]
            owner, local = robot.body_owner[body]
            if owner == number:
                self._give_pose(robot, request, number, base_body, bodies, pose, local, R, p)
        return request

    def _give_joint(self, request: ModuleRequest, kind: str, m: Mechanism, joint: int, name: str) -> None:
        position, rate, acceleration = self.joints[name]
        limit = {"revolute": WOUND_UP, "continuous": BLUR}.get(
            kind, FAR * m.length if m.closures.rows else np.inf
        )
        _refuse_absurd(name, position, limit, "m" if kind == "prismatic" else "rad")
        at, to = m.tree.q_slices[joint], m.tree.v_slices[joint]
        if kind == "continuous":
            request.known[:, at.start], request.known[:, at.start + 1] = np.cos(position), np.sin(position)
        else:
            request.known[:, at.start] = position
        request.known_v[:, to.start], request.known_a[:, to.start] = rate, acceleration
        request.given.append(joint)

    def _give_pose(
        self,
        robot: HybridRobot,
        request: ModuleRequest,
        number: int,
        base_body: int,
        bodies: Mapping[int, RigidMotion],
        pose: PoseRequest,
        local: int,
        R: Array,
        p: Array,
    ) -> None:
        m = robot.modules[number].mechanism
        other_body, other_R, other_p = robot.bodies.place[pose.other]
        tree_body = m.tree_body(local)
        units = np.array([m.length] * 3 + [1.0] * 3)
        if pose.motion is None:
            if other_body != base_body:
                raise AssemblyError(
                    f"partial pose of '{pose.link}' relative to '{pose.other}': give it relative to the base "
                    f"of its module, '{pose.link}@{robot.modules[number].base}/pose/...'",
                    module=robot.modules[number].name,
                )
            names = tuple(pose.coordinates)
            value, rate, acceleration = (
                np.stack([pose.coordinates[n][i] for n in names], 1) for i in range(3)
            )
            rows = [COORDINATES.index(n) for n in names]
            request.targets.append(
                CoordinateTarget(
                    tree_body, names, other_R, other_p, (R, p), value, rate, acceleration, units[rows]
                )
            )
            request.names.append(pose.link)
            return
        if other_body not in bodies:
            raise AssemblyError(
                f"pose of '{pose.link}' relative to '{pose.other}', which stands further out; give it "
                f"relative to '{robot.modules[number].base}' or a link nearer to the root",
                module=robot.modules[number].name,
            )
        T = self.samples
        other = bodies[other_body].then(RigidMotion.at_rest(T, other_R, other_p))
        link = other.then(pose.motion).seen_from(bodies[base_body])
        body = link.then(RigidMotion.at_rest(T, R.T, -R.T @ p))
        joint = tree_body - 1
        if (
            joint in m.spec.platforms
            or m.tree.joints[joint].kind == "floating"
            and m.tree.joints[joint].parent == 0
        ):
            self._give_platform(request, m, joint, body)
            return
        velocity = np.concatenate([body.pd, body.w], axis=1)
        acceleration = np.concatenate([body.pdd, body.wd], axis=1)
        request.targets.append(PoseTarget(tree_body, body.R, body.p, velocity, acceleration, units))
        request.names.append(pose.link)

    def _give_platform(self, request: ModuleRequest, m: Mechanism, joint: int, body: RigidMotion) -> None:
        """Enter a platform's pose as its `floating` joint's coordinates."""
        at, to = m.tree.q_slices[joint], m.tree.v_slices[joint]
        record = m.tree.joints[joint]
        inner = body.seen_from(RigidMotion.at_rest(self.samples, record.R, record.p))
        request.known[:, at.start : at.start + 3] = inner.p
        request.known[:, at.start + 3 : at.stop] = quaternion_from_rotation(inner.R)
        R = inner.R
        spatial = inner.pdd - cross(inner.w, inner.pd)
        request.known_v[:, to] = np.concatenate([rotate_back(R, inner.pd), rotate_back(R, inner.w)], axis=1)
        request.known_a[:, to] = np.concatenate([rotate_back(R, spatial), rotate_back(R, inner.wd)], axis=1)
        request.given.append(joint)


def _refuse_absurd(name: str, position: Array, limit: float, unit: str) -> None:
    """Refuse positions, shape (T,), that only a slip of the pen gives.

    Raises:
        AssemblyError: Naming the joint and the sample.
    """
    bad = np.flatnonzero(np.abs(position) > limit)
    if len(bad):
        raise AssemblyError(
            f"joint '{name}' is out of reach at sample {bad[0]}: {position[bad[0]]:.4g} {unit} (limit "
            f"{limit:.4g} {unit}); positions are in m and rad",
            sample=int(bad[0]),
        )


def gather_requests(
    robot: HybridRobot, motors: Mapping[str, object], platforms: Mapping[str, object]
) -> Requests:
    """Check and sort what a caller wants.

    Raises:
        TrajectoryError: Unknown names, wrong shapes, numbers that are not finite, quaternions not of unit
            length.
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
    sizes |= {n for parts in raw.values() for part in parts for n in _lengths(part)}
    if len(sizes) > 1:
        raise TrajectoryError(f"motors and platforms have different numbers of samples: {sorted(sizes)}")
    T = sizes.pop() if sizes else 1
    single = not any(np.ndim(x) for j in joints.values() for x in j) and not any(
        _lengths(part) for parts in raw.values() for part in parts
    )
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
    if name not in known:
        near = difflib.get_close_matches(name, list(known), 1)
        hint = f"; did you mean '{near[0]}'?" if near else ""
        raise TrajectoryError(f"unknown {what} '{name}'{hint}", column=name)


def _triple(value: object) -> tuple[object, object, object]:
    """Give (position, rate, acceleration), None where left out."""
    parts = list(value) if isinstance(value, (tuple, list)) else [value]
    if not 1 <= len(parts) <= 3:
        raise TrajectoryError("give (position, rate, acceleration), of which the last two may be left out")
    parts += [None] * (3 - len(parts))
    return parts[0], parts[1], parts[2]


def _three(value: object, name: str) -> list[Array]:
    parts = [np.asarray(0.0 if x is None else x, dtype=float) for x in _triple(value)]
    for x in parts:
        if x.ndim > 1 or not np.isfinite(x).all():
            raise TrajectoryError(f"joint '{name}' needs finite numbers of shape () or (T,)", column=name)
    return parts


def _lengths(part: object) -> list[int]:
    """Give the batch sizes in one part of a pose."""
    if part is None:
        return []
    if isinstance(part, Mapping):
        return [len(x) for x in map(np.asarray, part.values()) if x.ndim]
    array = np.asarray(part)
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
            triple.append(np.broadcast_to(np.asarray(0.0 if given is None else given, dtype=float), (T,)))
        out[name] = np.stack(triple)
        if not np.isfinite(out[name]).all():
            raise TrajectoryError(f"coordinate '{name}' is not finite", column=key)
    return out
