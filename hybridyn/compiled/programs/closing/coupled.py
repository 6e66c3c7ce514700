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
from ....assembly.chain.solve import chain_task, cut_positions
from ....assembly.module_request import ModuleRequest
from ....assembly.redundancy import LEAST, LeftToRule
from ....assembly.requests import Requests
from ....linkage.motion import Motion
from ....linkage.pointing import DirectionTarget, DistanceTarget
from ....linkage.targets import CoordinateTarget, PoseTarget, Target
from ....spatial import Array, quaternion_from_rotation
from ....structure.robot import HybridRobot
from .given import AXES, GivenCoordinates, Pointing, Prescribed
from .own_requests import modules_of

#: Targets in the order of what they prescribe; orientations come last.
TARGETS = PoseTarget, CoordinateTarget, DirectionTarget, DistanceTarget


def is_turn(target: Target) -> bool:
    """Return whether a target is an orientation without a position."""
    return isinstance(target, PoseTarget) and not target.lengths


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
        """The targets: whole poses, coordinates, directions, distances, orientations."""
        return sorted(
            self.problem.relatives, key=lambda one: (is_turn(one.target), TARGETS.index(type(one.target)))
        )

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
        prescribed = *self.given.bodies, *self.given.coordinates, *self.given.pointing
        for one, at, motion in zip(prescribed, self.given.places, self.seen(robot, q), strict=True):
            own = known[None, at]
            if isinstance(one, Pointing):
                out.append(one.at(motion, own[0]))
            elif isinstance(one, GivenCoordinates):
                target = one.target._replace(value=own)
                target = target.headed_at(motion, own) if met else target.headed(motion, first)
                out.append(target.coordinates(motion, first))
                if target.turns and target.heading is not None:
                    headings.append(target.heading[:1, None])
            else:
                out += [motion.p[:, 1], quaternion_from_rotation(motion.R[:, 1])]
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
        poses = [requests.poses[i] for i in self.poses]
        for m in (pose.motion for pose in poses if pose.motion is not None):
            pairs = (m.p, quaternion_from_rotation(m.R)), (m.p_dot, m.w), (m.p_ddot, m.w_dot)
            levels.append(tuple(np.concatenate(pair, axis=1) for pair in pairs))
        for some in (pose.coordinates for pose in poses if pose.coordinates):
            levels.append(tuple(np.stack([x[i] for x in some.values()], 1) for i in range(3)))
        levels += [tuple(pose.direction[1]) for pose in poses if pose.direction is not None]
        for far, centre in (pose.distance for pose in poses if pose.distance is not None):
            levels.append(tuple(np.concatenate([far[:, :, None], centre], axis=2)))
        for m in (pose.turn for pose in poses if pose.turn is not None):
            levels.append((quaternion_from_rotation(m.R), m.w, m.w_dot))
        g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*levels, strict=True))
        return np.concatenate([g, np.zeros((len(g), len(self.given.turning)))], axis=1), g_dot, g_ddot


#: Numbers of the poses that modules meet alone, and the modules that meet others, with the numbers of these.
Split = tuple[list[int], list[tuple[tuple[int, ...], tuple[int, ...]]]]


def split_poses(robot: HybridRobot, requests: Requests, *, every: bool = False) -> Split:
    """Return which poses modules meet alone, and which modules meet the others together.

    Directions and distances are among the others, also where one module meets them alone.

    Args:
        every: Whether all poses are among the others.

    Raises:
        AssemblyError: As in `chains_of`.
    """
    alone, chains = chains_of(robot, requests)
    number = {id(pose): i for i, pose in enumerate(requests.poses)}
    found = [(chain.modules, tuple(number[id(pose)] for pose in chain.poses)) for chain in chains]
    own: dict[int, list[int]] = {}
    for pose in alone.poses:
        own.setdefault(robot.body_owner[robot.bodies.place[pose.link][0]][0], []).append(number[id(pose)])
    pointing = [k for k, poses in own.items() if every or any(requests.poses[i].further for i in poses)]
    found += [((k,), tuple(own.pop(k))) for k in pointing]
    return sorted(i for poses in own.values() for i in poses), sorted(found)


def coupled_of(
    robot: HybridRobot,
    requests: Requests,
    modules: tuple[int, ...],
    poses: Sequence[int],
    own: Sequence[ModuleRequest],
) -> Coupled | None:
    """Return modules that poses couple; None if the general path must assemble them.

    Kernels know whole poses, orientations, coordinates, directions and distances, all rows of which the
    modules can move, between links that no other module moves but those without loops whose joints are all
    given: these are among the coupled modules, too. Of the rules they know the least motion.

    Args:
        modules: Numbers of the modules.
        poses: Numbers of the poses.
        own: What is given in each module alone, of all modules that requests close.

    Raises:
        AssemblyError: The modules cannot move what is prescribed.
    """
    place = {k: i for i, (k, _) in enumerate(modules_of(robot))}
    states = robot.home[None], *np.zeros((2, 1, robot.nv))
    poses = sorted(poses, key=lambda i: requests.poses[i].motion is None)
    first = tuple(requests.poses[i].part(0, 1) for i in poses)
    between = {k for pose in first for way in ways_between(robot, pose) for k, _ in way}
    between = {k for k in between.difference(modules) if robot.modules[k].mobility}
    open_modules, modules = modules, tuple(sorted(between.union(modules)))
    parts = tuple(place[k] for k in modules)
    alone = all(_given_alone(own[place[k]]) for k in between)
    if not alone or any(own[i].targets for i in parts) or any(pose.frame is not None for pose in first):
        return None
    chain = CoupledModules(modules, first)
    task = chain_task(robot, chain, [one_sample(own[i]) for i in parts], states)
    given = _prescribed([one.target for one in task.problem.relatives])
    names = tuple(robot.modules[k].name for k in open_modules)
    left = LeftToRule(task.left, names) if task.redundant else None
    out = Coupled(modules, parts, tuple(poses), given, task.problem, left)
    ruled = task.redundant and requests.redundancy != LEAST
    return out if task.problem.rank == out.rows and not ruled else None


def _prescribed(targets: Sequence[Target]) -> Prescribed:
    """Return what targets prescribe."""
    whole = sum(isinstance(target, PoseTarget) and not is_turn(target) for target in targets)
    some = tuple(GivenCoordinates.of(t) for t in targets if isinstance(t, CoordinateTarget))
    pointing = [Pointing(AXES[t.axis]) for t in targets if isinstance(t, DirectionTarget)]
    pointing += [Pointing("distance") for t in targets if isinstance(t, DistanceTarget)]
    pointing += [Pointing("turn") for t in targets if is_turn(t)]
    return Prescribed((), (), (1,) * whole, some, tuple(pointing))


def _given_alone(request: ModuleRequest) -> bool:
    """Return whether what is given are all joints of a module without loops."""
    m = request.mechanism
    held = sum(at.stop - at.start for at in (m.tree.v_slices[joint] for joint in request.given))
    return not m.closures.rows and held == m.tree.nv


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
