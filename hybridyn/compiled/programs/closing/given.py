"""What is prescribed in modules, its numbers at postures and in requests; whether kernels can close loops."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ....assembly.follow import MOST_TURNING
from ....assembly.module_request import ModuleRequest, module_request, on_own_bases, place_in_tree
from ....assembly.poses import PoseRequest
from ....assembly.requests import Requests, gather_requests
from ....assembly.task import module_task
from ....joints.kinds import JointKind
from ....linkage.angles import angles_of
from ....linkage.motion import Motion
from ....linkage.newton import LoopProblem
from ....linkage.reduction import LegBlock
from ....linkage.targets import COORDINATES, CoordinateTarget, PoseTarget, TurnTarget
from ....linkage.tree import Tree
from ....spatial import Array, Index, cross, quaternion_from_rotation
from ....structure.module import Module
from ....structure.robot import HybridRobot
from ....structure.samples import as_batch, same_samples
from .extended import extended

if TYPE_CHECKING:
    from ...equations.spins import Spin
    from .coupled import Coupled

#: No part keeps anything.
NOTHING: Mapping[int, int] = MappingProxyType({})
#: Kinds of prescribed numbers: a length or an angle, an angle up to whole turns, a pose (7 numbers).
NUMBER, ANGLE, POSE = 0, 1, 2
#: Numbers of each kind, of its rates and of its accelerations.
WIDTH, RATES = (1, 1, 7), (1, 1, 6)


@dataclass(frozen=True)
class GivenCoordinates:
    """Some coordinates of a link's pose that are prescribed.

    Attributes:
        body: Body of the tree after the cuts.
        links: The link, and the link in which the coordinates are measured.
        names: The coordinates.
        target: The target with all coordinates zero, one sample.
    """

    body: int
    links: tuple[str, str]
    names: tuple[str, ...]
    target: CoordinateTarget = field(compare=False)

    @classmethod
    def of(cls, target: CoordinateTarget) -> GivenCoordinates:
        """Return the coordinates that a target prescribes."""
        zero = np.zeros((1, len(target.names)))
        at_zero = target._replace(value=zero, rate=zero, acceleration=zero, heading=None)
        return cls(target.body, target.links, target.names, at_zero)

    @property
    def rows(self) -> tuple[int, ...]:
        """Their places in `COORDINATES`."""
        return tuple(COORDINATES.index(name) for name in self.names)

    @property
    def kinds(self) -> tuple[int, ...]:
        """The kind of each: a number, or an angle."""
        return tuple(ANGLE if row >= 3 else NUMBER for row in self.rows)


@dataclass(frozen=True)
class Given:
    """What is prescribed in a module.

    Attributes:
        joints: Joints of the tree after the cuts whose positions are given; platforms are among them.
        kinds: Their kinds: `NUMBER`, `ANGLE` or `POSE`.
        bodies: Bodies of that tree whose poses are targets.
        coordinates: Links of which some coordinates of the pose are targets.
    """

    joints: tuple[int, ...]
    kinds: tuple[int, ...]
    bodies: tuple[int, ...]
    coordinates: tuple[GivenCoordinates, ...] = ()

    @property
    def all_kinds(self) -> tuple[int, ...]:
        """The kind of each prescribed position: those of the joints, the poses, and the coordinates."""
        return (
            *self.kinds,
            *(POSE,) * len(self.bodies),
            *(kind for one in self.coordinates for kind in one.kinds),
        )

    @property
    def size(self) -> int:
        """Number of prescribed numbers."""
        return sum(WIDTH[kind] for kind in self.all_kinds)

    @property
    def rates(self) -> int:
        """Number of prescribed rates."""
        return sum(RATES[kind] for kind in self.all_kinds)

    def columns(self, tree: Tree) -> Index:
        """Return the freedoms of the given joints, in their order."""
        every = np.arange(tree.nv)
        return np.concatenate([np.zeros(0, dtype=int), *(every[tree.v_slices[j]] for j in self.joints)])

    def of_posture(self, tree: Tree, x: Array) -> Array:
        """Compute the prescribed numbers at postures of the tree after the cuts, shape (T, size)."""
        parts = [np.zeros((len(x), 0))]
        for joint, kind in zip(self.joints, self.kinds, strict=True):
            own = x[:, tree.q_slices[joint]]
            parts.append(np.arctan2(own[:, 1:], own[:, :1]) if kind == ANGLE else own)
        motion = tree.sweep(x)
        for body in self.bodies:
            parts += [motion.p[:, body], quaternion_from_rotation(motion.R[:, body])]
        first = np.zeros(len(x), dtype=int)
        parts += [one.target.residual(motion, first) for one in self.coordinates]
        return np.concatenate(parts, axis=1)


def upright_is_meant(parts: Sequence[Part], q: Array, known: Array, *, met: bool) -> bool:
    """Return whether one or two angles are meant of the upright triple, the only one that kernels know.

    Args:
        parts: The modules.
        q: A closed posture of the spanning tree, shape (nq,).
        known: What is prescribed next, shape (numbers,).
        met: Whether the posture has it.
    """
    at, first = 0, np.zeros(1, dtype=int)
    for part in parts:
        at += sum(WIDTH[kind] for kind in part.given.kinds) + WIDTH[POSE] * len(part.given.bodies)
        for some in part.given.coordinates:
            own = known[None, at : at + len(some.names)]
            at += len(some.names)
            if some.kinds.count(ANGLE) not in (1, 2):  # three are a rotation
                continue
            m = part.module.mechanism
            motion = m.tree.sweep(m.cut.positions(q[None, part.module.q_index]))
            target = some.target._replace(value=own)
            target = target.headed_at(motion, own) if met else target.headed(motion, first)
            upright = angles_of(target.axes(motion))[:, 2]
            if target.heading is not None and np.cos(target.heading - upright)[0] < 0.0:
                return False
    return True


def requests_of_motors(
    robot: HybridRobot, position: ArrayLike, rates: tuple[ArrayLike | None, ArrayLike | None]
) -> Requests:
    """Return the requests that prescribe all motors.

    Args:
        position: Positions in the order of `robot.motors`, shape (motors,) or (T, motors), [m or rad].
        rates: Their rates and accelerations, of the same shape; zero where left out.

    Raises:
        TrajectoryError: An array has a wrong shape, or is not finite.
    """
    count = len(robot.motors)
    first, single = as_batch(position, count, "position")
    given = {"rate": rates[0], "acceleration": rates[1]}
    found = {name: as_batch(x, count, name)[0] for name, x in given.items() if x is not None}
    same_samples(position=first, **found)
    each = [x[0] if single else x for x in (first, *(found.get(name, 0.0 * first) for name in given))]
    motors = {name: tuple(x[..., i] for x in each) for i, name in enumerate(robot.motors)}
    return gather_requests(robot, motors, {})


def given_of(request: ModuleRequest) -> Given:
    """Return what a request prescribes."""
    tree = request.mechanism.tree
    kinds = {JointKind.CONTINUOUS: ANGLE, JointKind.FLOATING: POSE}
    return Given(
        tuple(request.given),
        tuple(kinds.get(tree.joints[joint].kind, NUMBER) for joint in request.given),
        tuple(pose.body for _, pose in request.targets if isinstance(pose, PoseTarget)),
        tuple(map(GivenCoordinates.of, _by_coordinates(request))),
    )


def _by_coordinates(request: ModuleRequest) -> list[CoordinateTarget]:
    """Return the targets that are no whole poses, by coordinates: orientations by their angles."""
    partial = (
        target.by_angles() if isinstance(target, TurnTarget) else target for _, target in request.targets
    )
    return [target for target in partial if isinstance(target, CoordinateTarget)]


def numbers_of(request: ModuleRequest, given: Given) -> tuple[Array, Array, Array]:
    """Return the prescribed numbers, shape (T, size), their rates and accelerations, shape (T, rates)."""
    tree, T = request.mechanism.tree, len(request.known)
    levels: list[tuple[Array, ...]] = [(np.zeros((T, 0)),) * 3]
    for joint, kind in zip(given.joints, given.kinds, strict=True):
        at, to = tree.q_slices[joint], tree.v_slices[joint]
        known = request.angles[joint][:, None] if kind == ANGLE else request.known[:, at]
        levels.append((known, request.known_v[:, to], request.known_a[:, to]))
    for goal in (target.goal for _, target in request.targets if isinstance(target, PoseTarget)):
        pairs = (goal.p, quaternion_from_rotation(goal.R)), (goal.p_dot, goal.w), (goal.p_ddot, goal.w_dot)
        levels.append(tuple(np.concatenate(pair, axis=1) for pair in pairs))
    for some in _by_coordinates(request):
        levels.append((some.value, some.rate, some.acceleration))
    g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*levels, strict=True))
    return g, g_dot, g_ddot


#: Largest residual of closed loops, without units: rounding. Rows that contradict each other by more are for
#: the general path.
CLOSED_TO_ROUNDING = 1e-13
#: Largest rounding of over-determined closures in the robot's file. Above it they can only be met in the
#: least-squares sense, which elimination with pivots cannot do.
CONTRADICTING_FILE = 1e-12
#: Newton steps below this (rad, module lengths) are followed by the rates: the next step is its square, which
#: is below the limits of a last step and of its residual.
QUADRATIC = 3e-7
#: Largest last step: the rates before it are those after it to rounding.
LAST_ROW_STEP = 2e-13
#: Largest bound t of |J'^-1 (J' - J)|: then |J^-1 (J' - J)| <= t / (1 - t) is within `MOST_TURNING`, and a
#: tenth is left to rounding.
MOST_BOUND = 0.9 * MOST_TURNING / (1.0 + MOST_TURNING)
#: Most Newton steps from row to row, and from a guess.
ITERATIONS, PATIENCE = 12, 60
#: Most free freedoms of a module: its kernels grow with their cube.
MOST_FREEDOMS = 60


@dataclass(frozen=True)
class Part:
    """A module to close.

    Attributes:
        module: The module.
        given: What is prescribed in it.
        blocks: Blocks of its free freedoms (`LoopProblem.blocks`).
        spins: Idle spins that are left open: their rates are the least.
    """

    module: Module
    given: Given
    blocks: Sequence[LegBlock]
    spins: tuple[Spin, ...] = ()

    @property
    def platforms(self) -> int:
        """Number of the platforms' coordinates."""
        return 7 * len(self.module.mechanism.spec.platforms)


def places_at(parts: Sequence[Part], postures: Sequence[Array], samples: int) -> tuple[Array, Array]:
    """Compute the coordinates of all platforms and what is prescribed, at postures of each part.

    Args:
        postures: Positions of the tree after the cuts of each part, shape (T, its nq).
        samples: Number T.

    Returns:
        Shapes (T, platforms), (T, numbers).
    """
    platforms, given = [np.zeros((samples, 0))], [np.zeros((samples, 0))]
    for part, x in zip(parts, postures, strict=True):
        m = part.module.mechanism
        platforms += [x[:, m.tree.q_slices[i]] for i in m.spec.platforms]
        given.append(part.given.of_posture(m.tree, x))
    return np.concatenate(platforms, axis=1), np.concatenate(given, axis=1)


def posture_of(parts: Sequence[Part], q: Array) -> tuple[Array, Array, Array]:
    """Return a posture of the spanning tree, shape (nq,), its platforms, and what is prescribed there."""
    cut = [part.module.mechanism.cut.positions(q[None, part.module.q_index]) for part in parts]
    p, g = places_at(parts, cut, 1)
    return q, p[0], g[0]


def kinds_of(
    robot: HybridRobot, parts: Sequence[Part], chains: Sequence[Given] = (), kept: Mapping[int, int] = NOTHING
) -> dict[str, tuple[int, list[Index]]]:
    """Return the numbers of each kind: how many there are, and those of each part, then of each chain.

    Args:
        chains: What chains prescribe.
        kept: Number of numbers that a part in a chain keeps from a start, by the part.
    """

    def after(sizes: list[int]) -> tuple[int, list[Index]]:
        """Return entries that lie one part after the other, by their number in each."""
        ends = np.cumsum([0, *sizes])
        return int(ends[-1]), [np.arange(start, end) for start, end in pairwise(ends.tolist())]

    return {
        "q": (robot.nq, [part.module.q_index for part in parts]),
        "v": (robot.nv, [part.module.v_index for part in parts]),
        "p": after([part.platforms for part in parts]),
        "g": after([given.size for given in (*(part.given for part in parts), *chains)]),
        "rates": after([given.rates for given in (*(part.given for part in parts), *chains)]),
        "each": after([1] * len(parts)),
        "kept": after([kept.get(k, 0) for k in range(len(parts))]),
    }


def lanes_for(parts: Sequence[Part]) -> int:
    """Return the lanes that equal modules fill, at least 2: rows come one by one, so more would be idle."""
    equal = Counter((extended(part.module.mechanism).shape, part.given) for part in parts)
    return 1 << max(1, (max(equal.values()) - 1).bit_length())


def motors_given(robot: HybridRobot, parts: Sequence[Part]) -> list[int]:
    """Return the motor of each prescribed number; empty if other numbers than the motors' are prescribed."""
    number = {name: i for i, name in enumerate(robot.motors)}
    order = []
    for part in parts:
        source = part.module.mechanism.spec.tree_joint
        joints = [source[joint] for joint in part.given.joints]
        order += [number.get(part.module.joints[i], -1) if i is not None else -1 for i in joints]
        order += [-1] * (len(part.given.all_kinds) - len(joints))
    return order if sorted(order) == list(range(len(robot.motors))) else []


def modules_of(robot: HybridRobot) -> list[tuple[int, Module]]:
    """Return the modules that requests close, with their numbers: all but a free base."""
    first = 1 if robot.base == "floating" else 0
    return list(enumerate(robot.modules))[first:]


def module_requests(robot: HybridRobot, requests: Requests) -> list[ModuleRequest] | None:
    """Build the request for each module; None if one depends on the posture of another module.

    That also holds for the motion of a frame in which a pose is measured. A pose relative to the base of its
    own module needs no motion of the base.

    Raises:
        HybridynError: As in `assembly.module_request`.
    """
    if any(pose.frame is not None or pose.further for pose in requests.poses):
        return None
    still, out = Motion.at_rest(requests.samples), list[ModuleRequest]()
    placed, known = {0: still}, {0}  # the motions that are not known do not matter
    far = not on_own_bases(requests, robot)
    for k, module in modules_of(robot):
        base = robot.bodies.place[module.base][0]
        poses = [p for p in requests.poses if robot.body_owner[robot.bodies.place[p.link][0]][0] == k]
        for pose in poses:
            other = robot.bodies.place[pose.other][0]
            if other != base and other in placed and not {other, base} <= known:
                return None
        own = [pose for pose in poses if _is_own(robot, pose, base)]
        others = tuple(pose for pose in poses if pose not in own)
        # Kernels take the motors' numbers alone, and find what follows by gears among the unknowns.
        request = module_request(requests._replace(poses=others), robot, k, placed, followers=False)
        for pose in own:
            request.give_floating(place_in_tree(robot, pose.link)[0] - 1, _of_platform(robot, pose))
        out.append(request)
        placed |= dict.fromkeys((robot.body_of_joint[joint] for joint in module.joints), still)
        for pose in poses if far else ():
            other = robot.bodies.place[pose.other][0]
            if pose.motion is not None and other in known:
                body = robot.bodies.place[pose.link][0]
                placed[body] = _of_body(robot, pose, placed[other])
                known.add(body)
    return out


def _is_own(robot: HybridRobot, pose: PoseRequest, base: int) -> bool:
    """Return whether a pose is the whole pose of a platform in the base of its own module."""
    body, other = (robot.bodies.place[link][0] for link in (pose.link, pose.other))
    if pose.motion is None or other != base:
        return False
    m = robot.modules[robot.body_owner[body][0]].mechanism
    return place_in_tree(robot, pose.link)[0] - 1 in m.spec.platforms


def _of_platform(robot: HybridRobot, pose: PoseRequest) -> Motion:
    """Compute the motion of a platform's body in its base from that of a link of it in a link of the base."""
    _, R_link, p_link = place_in_tree(robot, pose.link)
    _, R_other, p_other = robot.bodies.place[pose.other]
    m = pose.motion
    assert m is not None
    arm = m.R @ (-R_link.T @ p_link)  # from the link's origin to the body's, axes of the other link
    swing = cross(m.w, arm)
    p_dot = m.p_dot + swing
    p_ddot = m.p_ddot + cross(m.w_dot, arm) + cross(m.w, swing)
    back = R_other.T
    return Motion(
        R_other @ (m.R @ R_link.T), (m.p + arm) @ back + p_other, m.w @ back, p_dot @ back,
        m.w_dot @ back, p_ddot @ back,
    )  # fmt: skip


def _of_body(robot: HybridRobot, pose: PoseRequest, other: Motion) -> Motion:
    """Compute the motion of the body whose whole pose is given in another body, of known motion."""
    _, R, p = robot.bodies.place[pose.link]
    assert pose.motion is not None
    in_other = Motion.at_rest(len(pose.motion.p), *robot.bodies.place[pose.other][1:])
    link = other.then(in_other).then(pose.motion)
    return link.then(Motion.at_rest(len(pose.motion.p), R.T, -R.T @ p))


def parts_of(
    robot: HybridRobot, wanted: list[ModuleRequest], coupled: Sequence[Coupled] = ()
) -> list[Part] | None:
    """Return the parts of a closing program; None if the general path must close the loops.

    Of motions that are left to the least norm, kernels know idle spins alone. They do not average loops that
    contradict each other by a file's rounding.

    Args:
        wanted: What is asked of each module alone.
        coupled: Those of them that poses couple.

    Raises:
        AssemblyError: What is given does not determine the posture of a module.
    """
    parts: list[Part] = []
    carrying = {part: one.ports(i) for one in coupled for i, part in enumerate(one.parts)}
    for (_, module), request in zip(modules_of(robot), wanted, strict=True):
        given, m, number = given_of(request), module.mechanism, len(parts)
        task = module_task(robot, module, request, alone=number not in carrying)
        free = int(task.problem.free.sum())
        spins = _open_spins(module, task.problem) if task.problem.rank != free else ()
        if number in carrying:
            spins = tuple(spin for spin in spins if not _carries(m.tree, spin, carrying[number]))
        elif task.problem.rank != free - len(spins):
            return None
        if free > MOST_FREEDOMS or m.rounding > CONTRADICTING_FILE:
            return None
        parts.append(Part(module, given, tuple(task.problem.blocks), spins))
    return parts if coupled or sum(part.given.rates for part in parts) else None


def _carries(tree: Tree, spin: Spin, bodies: Sequence[int]) -> bool:
    """Return whether the joint of a spin moves one of some bodies."""
    return bool(tree.support[list(bodies)][:, list(spin.cols)].any())


def _open_spins(module: Module, problem: LoopProblem) -> tuple[Spin, ...]:
    """Return the idle spins of a module that neither loops nor targets determine."""
    from ...equations.spins import UNFELT, spins_of

    m, unit = module.mechanism, problem.col_scale
    K = problem.matrix(m.tree.sweep(m.postures))
    return tuple(
        spin
        for spin in spins_of(m, module.motor_columns)
        if problem.free[list(spin.cols)].all()
        and np.abs(K[:, :, spin.cols] @ (spin.axis / unit[list(spin.cols)])).max() <= UNFELT
    )


def structure_of(requests: Requests) -> tuple[object, ...]:
    """Return what requests have in common that the same program closes."""
    poses = tuple(
        (
            p.link, p.other, p.motion is None, p.turn is None, tuple(p.coordinates),
            p.direction and p.direction[0], p.distance is None,
        )
        for p in requests.poses
    )  # fmt: skip
    rule = requests.redundancy, *requests.weights.items()
    return tuple(requests.joints), poses, requests.base is None, rule


def numbers(parts: list[Part], wanted: list[ModuleRequest]) -> tuple[Array, Array, Array]:
    """Return what is prescribed, its rates and accelerations, shapes (T, numbers), (T, rates), (T, rates)."""
    each = [numbers_of(request, part.given) for part, request in zip(parts, wanted, strict=True)]
    g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*each, strict=True))
    return g, g_dot, g_ddot
