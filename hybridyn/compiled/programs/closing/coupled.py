"""Poses through several modules, in C: which modules they couple, what they prescribe, and where links are.

A chain of the general path (`assembly.chain`) becomes a `Coupled`: its modules among the parts of a closing
program, the targets as numbers behind those of the parts, and the bodies of the modules that carry its links.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ....assembly.chain.coupling import CoupledModules, chains_of, ways_between
from ....assembly.chain.problem import ChainProblem, Relative
from ....assembly.chain.solve import LeftToRule, chain_task, cut_positions
from ....assembly.module_request import ModuleRequest
from ....assembly.requests import Requests
from ....linkage.targets import CoordinateTarget, PoseTarget
from ....linkage.tree import Motion
from ....spatial import Array, quaternion_from_rotation
from ....structure.robot import HybridRobot
from .given import ANGLE, NUMBER, POSE, WIDTH, Given, GivenCoordinates, modules_of


@dataclass(frozen=True)
class Prescribed(Given):
    """What poses through several modules prescribe: at the end a heading for each link with angles."""

    @property
    def all_kinds(self) -> tuple[int, ...]:
        """The kind of each prescribed position, then those of the headings."""
        return (*super().all_kinds, *(NUMBER,) * len(self.turning))

    @property
    def turning(self) -> list[int]:
        """Numbers of the coordinates with angles."""
        return [i for i, some in enumerate(self.coordinates) if ANGLE in some.kinds]

    @property
    def rates(self) -> int:
        """Number of prescribed rates."""
        return super().rates - len(self.turning)


@dataclass(frozen=True)
class Coupled:
    """Modules that poses couple.

    Attributes:
        numbers: Their numbers in the robot, those nearer to the root first.
        parts: Their numbers among the parts of the program.
        poses: Numbers of the poses among those of the requests: the whole ones, then the others.
        given: What is prescribed.
        problem: Rows and rule of the general path, at one sample.
        left: What is left to the rule, or None.
    """

    numbers: tuple[int, ...]
    parts: tuple[int, ...]
    poses: tuple[int, ...]
    given: Prescribed
    problem: ChainProblem = field(compare=False)
    left: LeftToRule | None = field(compare=False)

    @property
    def relatives(self) -> list[Relative]:
        """The targets, those of whole poses first."""
        whole = [one for one in self.problem.relatives if isinstance(one.target, PoseTarget)]
        return whole + [one for one in self.problem.relatives if not isinstance(one.target, PoseTarget)]

    @property
    def rows(self) -> int:
        """Number of prescribed rows."""
        return sum(len(one.target.units) for one in self.relatives)

    def ports(self, part: int) -> tuple[int, ...]:
        """Return the bodies of a part (its number in the chain) whose motion moves a target."""
        found = set[int]()
        for one in self.relatives:
            link, other = (self.problem.carried.way(place) for place in (one.link, one.other))
            if link.get(part) != other.get(part):
                found |= {way[part] for way in (link, other) if part in way}
        return tuple(sorted(found))

    def numbers_at(self, robot: HybridRobot, q: Array, known: Array, *, met: bool) -> Array:
        """Compute what is prescribed at a posture of the robot, shape (1, nq); shape (1, numbers).

        Args:
            known: What is prescribed next, shape (numbers,): angles near it are meant.
            met: Whether the posture has these coordinates.
        """
        out, first, headings = [], np.zeros(1, dtype=int), []
        motions = self.seen(robot, q)
        whole, at = len(self.given.bodies), WIDTH[POSE] * len(self.given.bodies)
        for motion in motions[:whole]:
            out += [motion.p[:, 1], quaternion_from_rotation(motion.R[:, 1])]
        for some, motion in zip(self.given.coordinates, motions[whole:], strict=True):
            own = known[None, at : at + len(some.names)]
            at += len(some.names)
            target = some.target._replace(value=own)
            target = target.headed_at(motion, own) if met else target.headed(motion, first)
            out.append(target.coordinates(motion, first))
            if target.turns and target.heading is not None:
                headings.append(target.heading[:1, None])
        return np.concatenate([*out, *headings], axis=1)

    def seen(self, robot: HybridRobot, q: Array) -> list[Motion]:
        """Return the motion of each target's link in its other one at a posture, shape (1, nq)."""
        motion = self.problem.tree.sweep(cut_positions(robot, self.numbers, q))
        frames = self.problem.frames(motion, np.zeros(1, dtype=int))
        return [frames.seen(one.link, one.other) for one in self.relatives]

    def wanted(self, requests: Requests) -> tuple[Array, Array, Array]:
        """Return what is prescribed, shape (T, numbers), its rates and accelerations, shape (T, rates).

        The headings are zero, see `numbers_at`.
        """
        levels: list[tuple[Array, ...]] = []
        for pose in (requests.poses[i] for i in self.poses):
            if (m := pose.motion) is not None:
                pairs = (m.p, quaternion_from_rotation(m.R)), (m.p_dot, m.w), (m.p_ddot, m.w_dot)
                levels.append(tuple(np.concatenate(pair, axis=1) for pair in pairs))
            else:
                levels.append(tuple(np.stack([x[i] for x in pose.coordinates.values()], 1) for i in range(3)))
        g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*levels, strict=True))
        return np.concatenate([g, np.zeros((len(g), len(self.given.turning)))], axis=1), g_dot, g_ddot


#: Numbers of the poses that modules meet alone, and the modules that meet others, with the numbers of these.
Split = tuple[list[int], list[tuple[tuple[int, ...], tuple[int, ...]]]]


def split_poses(robot: HybridRobot, requests: Requests) -> Split:
    """Return which poses modules meet alone, and which modules meet the others together.

    Raises:
        AssemblyError: As in `chains_of`.
    """
    alone, chains = chains_of(robot, requests)
    number = {id(pose): i for i, pose in enumerate(requests.poses)}
    found = [(chain.modules, tuple(number[id(pose)] for pose in chain.poses)) for chain in chains]
    return sorted(number[id(pose)] for pose in alone.poses), found


def coupled_of(
    robot: HybridRobot,
    requests: Requests,
    modules: tuple[int, ...],
    poses: Sequence[int],
    own: Sequence[ModuleRequest],
) -> Coupled | None:
    """Return modules that poses couple; None if the general path must assemble them.

    Kernels know whole poses and single coordinates, each of which the modules can move, between links that no
    other module moves.

    Args:
        modules: Numbers of the modules.
        poses: Numbers of the poses.
        own: What is given in each module alone, of all modules that requests close.

    Raises:
        AssemblyError: The modules cannot move what is prescribed.
    """
    place = {k: i for i, (k, _) in enumerate(modules_of(robot))}
    parts = tuple(place[k] for k in modules)
    states = robot.home[None], *np.zeros((2, 1, robot.nv))
    poses = sorted(poses, key=lambda i: requests.poses[i].motion is None)
    first = CoupledModules(modules, tuple(requests.poses[i].part(0, 1) for i in poses))
    if any(own[i].targets for i in parts) or not _closed_between(robot, first):
        return None
    task = chain_task(robot, first, [one_sample(own[i]) for i in parts], states)
    targets = [one.target for one in task.problem.relatives]
    whole = sum(isinstance(target, PoseTarget) for target in targets)
    given = Prescribed(
        (),
        (),
        (1,) * whole,
        tuple(GivenCoordinates.of(t) for t in targets if isinstance(t, CoordinateTarget)),
    )
    names = tuple(part.module for part in task.parts)
    left = LeftToRule(task.left, names) if task.redundant else None
    out = Coupled(modules, parts, tuple(poses), given, task.problem, left)
    return out if task.problem.rank == out.rows else None


def _closed_between(robot: HybridRobot, chain: CoupledModules) -> bool:
    """Return whether the modules of a chain alone move its links in one another."""
    moved = {k for pose in chain.poses for way in ways_between(robot, pose) for k, _ in way}
    return all(k in chain.modules or not robot.modules[k].mobility for k in moved) and all(
        pose.frame is None and pose.turn is None and not pose.further for pose in chain.poses
    )


def one_sample(request: ModuleRequest) -> ModuleRequest:
    """Return a request at its first sample, without targets."""
    return replace(
        request,
        known=request.known[:1],
        known_v=request.known_v[:1],
        known_a=request.known_a[:1],
        given=list(request.given),
        angles={joint: x[:1] for joint, x in request.angles.items()},
    )
