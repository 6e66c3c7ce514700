"""Compute the workspace of a module: every pose on a lattice that its platform can reach from home.

The origin of the lattice is the home pose, or a pose that can be reached from it. The neighbours of each
reached pose are assembled starting from its posture. Every posture is therefore on home's assembly branch,
and a path within the joint limits leads to it. A neighbour counts as reached if three conditions hold: its
loops close, the step agrees with the one that their derivative predicts, and every joint is within its
limits. Whole steps are tried first. Where they fail, smaller steps follow.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...assembly.assemble import assemble_home
from ...assembly.follow import SAME_BRANCH, SMALL_STEP
from ...assembly.module_request import module_request
from ...assembly.requests import gather_requests
from ...assembly.spanning import settled, spanning_positions
from ...assembly.task import closure_residual, module_task
from ...errors import AssemblyError, ModelError, TrajectoryError
from ...linkage.newton import close
from ...linkage.targets import COORDINATES
from ...spatial import Array, Index, Mask
from ...streams.departures import position_limits
from ...structure.robot import HybridRobot
from ...threads import one_thread
from .measures import Measures
from .sweep import Sweep, find_sweep, pose_of, values_at

#: Largest number of Newton steps from one pose to the next. A pose that needs more counts as out of reach.
MOST_NEWTON_STEPS = 25
#: Results of a step. Any other value is the number of the joint that is outside its limits.
REACHED, OUT_OF_REACH = -1, -2


#: Numbers of parts into which a step to a neighbour is divided, one attempt after the other.
PARTS = (1, 4, 16)
#: Number of poses that are closed at once. It is fixed, so that no result depends on the number of processes.
CHUNK = 256
#: Largest number of poses.
MOST = 200_000


class Closing:
    """Closes the loops of a module at poses near known postures. Pickled for other processes."""

    def __init__(self, robot: HybridRobot, sweep: Sweep, limits: bool) -> None:
        self.robot, self.sweep = robot, sweep
        module = robot.modules[sweep.module]
        self.names = module.joints
        #: Number, column and position limits of each limited joint with one freedom.
        self.limited: list[tuple[int, int, float, float]] = []
        for number, (name, at) in enumerate(
            zip(module.joints, module.mechanism.spanning.q_slices, strict=True)
        ):
            joint = robot.records.get(name)
            if limits and joint is not None and joint.kind in ("revolute", "prismatic"):
                ends = position_limits(joint)
                self.limited += [(number, at.start, *ends)] if ends is not None else []

    def outside(self, q: Array) -> Index:
        """Return for each posture, shape (T, its nq), the joint farthest outside its limits, or REACHED."""
        out = np.zeros((len(q), len(self.names)))
        for number, column, lower, upper in self.limited:
            out[:, number] = np.maximum(lower - q[:, column], q[:, column] - upper)
        return np.where(out.max(axis=1) > 0, out.argmax(axis=1), REACHED)

    def __call__(self, parts: int, before: Array, after: Array, q: Array) -> tuple[Array, Index]:
        """Step from poses to neighbouring ones.

        Args:
            parts: Number of parts of the step.
            before: Coordinates of the known poses, shape (T, names), [m, rad].
            after: Coordinates of their neighbours, shape (T, names), [m, rad].
            q: Known postures of the module, shape (T, its nq).

        Returns:
            Postures reached, shape (T, its nq), and for each REACHED, OUT_OF_REACH or the number of the joint
            that is outside its limits.
        """
        out, alive = q.copy(), np.ones(len(q), dtype=bool)
        for i in range(1, parts + 1):
            left = np.flatnonzero(alive)
            if not len(left):
                break
            here, way = (before[left] + k / parts * (after - before)[left] for k in (i - 1, i))
            out[left], alive[left] = self._once(here, way, out[left])
        state = np.full(len(q), OUT_OF_REACH)
        state[alive] = self.outside(out[alive])
        return out, state

    def _once(self, here: Array, values: Array, q: Array) -> tuple[Array, Mask]:
        """Close the loops at coordinates near those `here`; return postures, and which are on the branch."""
        robot, module = self.robot, self.robot.modules[self.sweep.module]
        m = module.mechanism
        requests = gather_requests(robot, {}, {self.sweep.key: pose_of(self.sweep, values)})
        request = module_request(requests, robot, self.sweep.module, {})
        start, samples = m.cut.positions(q), np.arange(len(q))
        task = module_task(robot, module, request)
        before = m.tree.sweep(start)
        targets = [target.headed_at(before, here) for target in task.problem.targets]
        task = task._replace(problem=replace(task.problem, targets=targets))
        known = task.with_known(start, samples)
        motion = m.tree.sweep(known)
        problem = task.problem
        K = problem.matrix(motion, samples, every=False)
        dx = problem.solve(K, -problem.residual(known, samples, motion))
        predicted = m.tree.integrate(known, dx * problem.col_scale)
        result = close(problem, known, samples, iterations=MOST_NEWTON_STEPS)
        off = np.abs(m.tree.difference(predicted, result.q) / problem.col_scale).max(axis=1, initial=0.0)
        good = task.closed(result) & (off <= SAME_BRANCH * np.abs(dx).max(axis=1, initial=0.0) + SMALL_STEP)
        out = q.copy()
        if good.any():
            x = settled(m, result.q[good])
            out[good] = spanning_positions(module, x, m.tree.sweep(x), q[good])
            residual = m.residual(out[good], m.spanning.sweep(out[good]))
            good[np.flatnonzero(good)] = np.abs(residual).max(axis=1, initial=0.0) <= task.tolerance
        return out, good


#: Applies one function to tuples of arguments, in order, possibly in other processes.
Spread = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Iterator[Any]]


#: A lattice point: steps from the origin along each axis.
Point = tuple[int, ...]
#: A step from one point to a neighbour.
Pair = tuple[Point, Point]


class Flood:
    """The lattice points that are reached, and the steps that remain to be tried."""

    def __init__(self, close: Closing, start: Array, step: Array, q: Array) -> None:
        """Start at the origin.

        Args:
            close: Steps from poses to neighbouring ones.
            start: Coordinates of the origin, shape (names,), [m, rad].
            step: Step of each swept coordinate, shape (axes,), [m, rad].
            q: Posture of the module at the origin, shape (its nq,).
        """
        self.close, self.start, self.step = close, start, step
        self.columns = [close.sweep.names.index(axis) for axis in close.sweep.axes]
        self.angular = [COORDINATES.index(axis) >= 3 for axis in close.sweep.axes]
        self.reached: dict[Point, Array] = {(0,) * len(step): q}
        self.waiting: dict[Point, list[Point]] = {}
        self.hard: list[list[Pair]] = [[] for _ in PARTS]
        self.blocked: Counter[str] = Counter()

    def values(self, index: Index) -> Array:
        """Return the coordinates of lattice points (n, axes), shape (n, names)."""
        out = np.tile(self.start, (len(index), 1))
        out[:, self.columns] += index * self.step
        return out

    def found(self) -> tuple[Index, Array]:
        """Return the reached lattice points, shape (n, axes), sorted, and the module's postures there."""
        index = np.array(list(self.reached)).reshape(-1, len(self.step))
        order = np.lexsort(index.T[::-1])
        return index[order], np.array(list(self.reached.values()))[order]

    def run(self, spread: Spread, progress: Callable[[int], None] | None) -> None:
        """Find all reachable lattice points.

        Args:
            spread: Distributes the chunks of steps.
            progress: Called with the number of poses reached, or None.

        Raises:
            ModelError: There are too many poses.
        """
        self._queue_neighbours(next(iter(self.reached)))
        while (found := self._next()) is not None:
            level, pairs = found
            done = 0
            for q, state in spread(self.close, self._chunks(level, pairs)):
                for posture, what, pair in zip(q, state, pairs[done : done + len(q)], strict=True):
                    self._record(level, pair, posture, int(what))
                done += len(q)
                if progress:
                    progress(len(self.reached))
            if len(self.reached) > MOST:
                raise ModelError(
                    f"the workspace has more than {MOST:,} poses: take larger steps or fewer coordinates, or "
                    "state limits in the robot's file"
                )

    def _next(self) -> tuple[int, list[Pair]] | None:
        """Return the index in `PARTS` and the steps to try next, or None at the end."""
        if self.waiting:  # one step to each point, from the first neighbour not tried yet
            pairs = [(sides.pop(0), to) for to, sides in self.waiting.items()]
            self.waiting = {to: sides for to, sides in self.waiting.items() if sides}
            return 0, pairs
        for level in range(1, len(PARTS)):
            pairs = [pair for pair in self.hard[level] if pair[1] not in self.reached]
            self.hard[level] = []
            if pairs:
                return level, pairs
        return None

    def _record(self, level: int, pair: Pair, posture: Array, what: int) -> None:
        to = pair[1]
        if to in self.reached:
            return
        if what == REACHED:
            self.reached[to] = posture
            self.waiting.pop(to, None)
            self._queue_neighbours(to)
        elif what == OUT_OF_REACH and level + 1 < len(PARTS):
            self.hard[level + 1].append(pair)
        else:
            self.blocked["reach" if what == OUT_OF_REACH else self.close.names[what]] += 1

    def _queue_neighbours(self, at: Point) -> None:
        """Queue the steps from a point to its neighbours."""
        for axis, direction in itertools.product(range(len(at)), (1, -1)):
            to = (*at[:axis], at[axis] + direction, *at[axis + 1 :])
            turned = self.angular[axis] and abs(to[axis]) * self.step[axis] > np.pi
            if to not in self.reached and not turned:
                self.waiting.setdefault(to, []).append(at)

    def _chunks(self, level: int, pairs: list[Pair]) -> Iterator[tuple[Any, ...]]:
        for i in range(0, len(pairs), CHUNK):
            part = pairs[i : i + CHUNK]
            before, after = (self.values(np.array([pair[side] for pair in part])) for side in (0, 1))
            yield PARTS[level], before, after, np.array([self.reached[at] for at, _ in part])


#: Default steps, by number of swept coordinates: lattice points per module length, and angles [rad].
POINTS = {1: 200, 2: 50, 3: 24, 4: 8, 5: 5, 6: 4}
TURNS = {1: 0.02, 2: 0.05, 3: 0.1, 4: 0.2, 5: 0.3, 6: 0.4}
#: Numbers of parts in which the step from home to another origin is tried.
WALK = (8, 32, 128)


@dataclass(frozen=True, eq=False)
class Workspace:
    """The poses that a module's platform reaches.

    Attributes:
        sweep: Link and coordinates.
        steps: Step of each swept coordinate, shape (axes,), [m, rad].
        start: Values of all coordinates at the lattice's origin, shape (names,).
        index: Lattice points that were reached, steps from the origin, shape (n, axes).
        coordinates: Their coordinates, shape (n, names), [m, rad].
        q: Postures of the whole robot, shape (n, nq); other modules are at home.
        motors: Positions of the module's motors by name, shape (n,) each, without continuous joints.
        measures: Measures of the postures by name, shape (n,) each (see `Measures`).
        blocked: Number of rejected steps by the joint whose limit was exceeded; "reach" for steps at which
            the loops do not close or the branch ends.
    """

    sweep: Sweep
    steps: Array
    start: Array
    index: Index
    coordinates: Array
    q: Array
    motors: dict[str, Array]
    measures: dict[str, Array]
    blocked: dict[str, int]

    @property
    def size(self) -> float:
        """Number of points times the lattice cell: volume, area or length, product of [m, rad]."""
        return float(len(self.index) * np.prod(self.steps))


@one_thread()
def workspace(
    robot: HybridRobot,
    module: int | str | None = None,
    *,
    link: str | None = None,
    axes: Sequence[str] | None = None,
    at: Mapping[str, float] | None = None,
    steps: Mapping[str, float] | None = None,
    limits: bool = True,
    spread: Spread = itertools.starmap,
    progress: Callable[[int], None] | None = None,
) -> Workspace:
    """Find every pose on a lattice that a module's platform reaches from home.

    Args:
        robot: The robot; its other modules stay at home.
        module: Number (from 1) or name; by default the only module with closures.
        link: A link of the module; by default its platform.
        axes: Coordinates to sweep, of x, y, z, roll, pitch, yaw relative to the module's base link. By
            default all independent ones if there are at most three, else the translations.
        at: Values of coordinates that are not swept, or of the lattice's origin [m, rad]; by default those of
            home.
        steps: Steps of swept coordinates [m, rad]; by default a part of the module's length or a fixed
            angle.
        limits: Whether joint limits are respected.
        spread: Distributes the chunks of work, for example to other processes.
        progress: Called with the number of poses reached.

    Raises:
        TrajectoryError: A name is unknown, or the coordinates are not independent.
        ModelError: There are too many poses.
        AssemblyError: The origin cannot be reached, or is outside the limits.
    """
    home = _closed_home(robot)
    sweep = find_sweep(robot, module, link, axes, home)
    start, step = values_at(sweep, at or {}), _steps(robot, sweep, steps or {})
    close, measures = Closing(robot, sweep, limits), Measures(robot, sweep)
    columns = robot.modules[sweep.module].q_index
    q0 = home.copy()
    q0[columns] = _at_start(close, start, home)
    _check_origin(close, q0[columns])
    flood = Flood(close, start, step, q0[columns])
    flood.run(spread, progress)
    index, inner = flood.found()
    q = np.tile(q0, (len(index), 1))
    q[:, columns] = inner
    return Workspace(
        sweep=sweep,
        steps=step,
        start=start,
        index=index,
        coordinates=flood.values(index),
        q=q,
        motors=_motors(robot, sweep, q),
        measures=_measured(measures, q, spread),
        blocked=dict(flood.blocked),
    )


def _steps(robot: HybridRobot, sweep: Sweep, given: Mapping[str, float]) -> Array:
    """Return the step of each swept coordinate, shape (axes,), [m, rad]."""
    for name in given:
        if name not in sweep.axes:
            raise TrajectoryError(f"'{name}' is not swept; the swept coordinates are {', '.join(sweep.axes)}")
    length, dimensions, out = robot.modules[sweep.module].mechanism.length, len(sweep.axes), []
    for name in sweep.axes:
        linear = COORDINATES.index(name) < 3
        out.append(given.get(name, length / POINTS[dimensions] if linear else TURNS[dimensions]))
        if not 0 < out[-1] < np.inf:
            raise ModelError(f"the step of '{name}' must be positive, not {out[-1]:g}")
    return np.array(out, dtype=float)


def _check_origin(close: Closing, q: Array) -> None:
    """Check that the posture at the origin, shape (nq of the module,), is within the joint limits."""
    joint = int(close.outside(q[None])[0])
    if joint == REACHED:
        return
    name = close.names[joint]
    raise AssemblyError(
        f"joint '{name}' is outside its limits at the workspace's origin: correct [home] in model.toml "
        "or the limits, choose another origin (at), or ignore the limits (limits=False)",
        module=close.robot.modules[close.sweep.module].name,
    )


def _measured(measures: Measures, q: Array, spread: Spread) -> dict[str, Array]:
    """Compute the measures of postures, shape (n,) each."""
    parts = list(spread(measures, ((q[i : i + CHUNK],) for i in range(0, len(q), CHUNK))))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _motors(robot: HybridRobot, sweep: Sweep, q: Array) -> dict[str, Array]:
    """Return the positions of a module's motors without continuous joints, shape (n,) each."""
    joints = {name: robot.joint_index[name] for name in robot.modules[sweep.module].motors}
    return {
        name: q[:, robot.q_slices[joint].start]
        for name, joint in joints.items()
        if robot.kinds[joint] != "continuous"
    }


def _closed_home(robot: HybridRobot) -> Array:
    """Return the home posture; if its loops are open, assemble it at the home positions of the motors."""
    if not robot.description.closures or closure_residual(robot, robot.home) <= robot.closure_tolerance:
        return robot.home
    return assemble_home(robot)


def _at_start(close: Closing, start: Array, home: Array) -> Array:
    """Step from home to the lattice's origin and return the module's posture there, shape (its nq,)."""
    sweep = close.sweep
    q: Array = home[close.robot.modules[sweep.module].q_index]
    if (start == sweep.home).all():
        return q
    for parts in WALK:
        reached, state = close(parts, sweep.home[None], start[None], q[None])
        if state[0] != OUT_OF_REACH:
            out: Array = reached[0]
            return out
    there = ", ".join(f"{name} {value:.4g}" for name, value in zip(sweep.names, start, strict=True))
    raise AssemblyError(
        f"link '{sweep.link}' does not reach the workspace's origin ({there}) from home; choose another "
        "origin",
        module=close.robot.modules[sweep.module].name,
    )
