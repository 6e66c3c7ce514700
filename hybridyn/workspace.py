"""The workspace of a module: every pose on a lattice that its platform can reach from home.

The lattice has the home posture (or a posture reached from it) as a point. From each pose that is reached its
neighbours are closed, starting from the posture at hand, so that every posture is on home's assembly branch
and no joint passes a limit on the way: what is found is what the robot can really go to. A neighbour counts
as reached where the loops close, where the step is the one that their derivative predicts (else in smaller
steps), and where every joint keeps its limits.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .assembly import assemble
from .errors import AssemblyError, ModelError, TrajectoryError
from .forward import closure_residual
from .robot import HybridRobot
from .spatial import Array, Index
from .targets import COORDINATES
from .workspace_measures import Measures
from .workspace_steps import OUT_OF_REACH, REACHED, Closing
from .workspace_targets import Sweep, find_sweep, values_at

#: Lattice points along the module's length, and steps of an angle [rad], by number of swept coordinates.
POINTS = {1: 200, 2: 50, 3: 24, 4: 8, 5: 5, 6: 4}
TURNS = {1: 0.02, 2: 0.05, 3: 0.1, 4: 0.2, 5: 0.3, 6: 0.4}
#: A step to a neighbour is tried whole, then in so many parts.
PARTS = (1, 4, 16)
#: Parts of the way from home to an origin elsewhere.
WALK = (8, 32, 128)
#: Poses that are closed at once; fixed, so that no result depends on the number of processes.
CHUNK = 256
#: More poses than this are a mistake.
MOST = 200_000

Spread = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Iterator[Any]]
"""Applies a function, always the same, to tuples of arguments, in order; perhaps in other processes."""


@dataclass(frozen=True)
class Workspace:
    """The poses that a module's platform reaches.

    Attributes:
        sweep: Link and coordinates.
        steps: Step of each swept coordinate, shape (axes,), [m, rad].
        start: Values of all coordinates at the lattice's origin, shape (names,).
        index: Lattice points that were reached, steps from the origin, shape (n, axes).
        coordinates: Their coordinates, shape (n, names), [m, rad].
        q: Postures of the whole robot, shape (n, nq); other modules stand at home.
        motors: Positions of the module's motors by name, shape (n,) each; none of continuous joints.
        measures: What each posture is worth by name, shape (n,) each, as `workspace_measures` says.
        blocked: How many steps were refused, by joint whose limit refused them; "reach" where loops cannot
            close or the branch ends.
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
        """Number of points times the cell of the lattice: volume, area or length, [m, rad] to the axes."""
        return float(len(self.index) * np.prod(self.steps))


def in_this_process(function: Callable[..., Any], tasks: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
    """Apply a function to tuples of arguments, one after the other."""
    return itertools.starmap(function, tasks)


def workspace(
    robot: HybridRobot,
    module: int | str | None = None,
    *,
    link: str | None = None,
    axes: Sequence[str] | None = None,
    at: Mapping[str, float] | None = None,
    steps: Mapping[str, float] | None = None,
    limits: bool = True,
    spread: Spread = in_this_process,
    progress: Callable[[int], None] | None = None,
) -> Workspace:
    """Find every pose on a lattice that a module's platform reaches from home.

    Args:
        robot: The robot; its other modules stay at home.
        module: Number (from 1) or name; the only module with closures where left out.
        link: A link of the module; its platform where left out.
        axes: Coordinates that are swept, of x, y, z, roll, pitch, yaw relative to the module's base link;
            where left out all independent ones up to three, else the translations.
        at: Values of coordinates that are not swept, or of the lattice's origin [m, rad]; home's where left
            out.
        steps: Step of swept coordinates [m, rad]; a part of the module's length where left out.
        limits: Whether joints keep their limits.
        spread: How chunks of work are done.
        progress: Called with the number of poses done.

    Raises:
        TrajectoryError: Unknown names, or coordinates that cannot be asked for.
        ModelError: The origin lies outside the limits, or there are too many poses.
        AssemblyError: The origin cannot be reached.
    """
    home = _closed_home(robot)
    sweep = find_sweep(robot, module, link, axes, home)
    start = values_at(sweep, at or {})
    for name in steps or {}:
        if name not in sweep.axes:
            raise TrajectoryError(f"'{name}' is not swept; swept are {', '.join(sweep.axes)}")
    mechanism = robot.modules[sweep.module].mechanism
    step = np.array([_step(name, sweep, mechanism.length, steps or {}) for name in sweep.axes])
    work = Work(Closing(robot, sweep, limits), Measures(robot, sweep))
    close = work.closing
    q0 = home.copy()
    q0[robot.modules[sweep.module].q_index] = _at_start(close, start, home)
    first = close.limits.broken(q0[None, robot.modules[sweep.module].q_index])[0]
    if first != REACHED:
        name = robot.modules[sweep.module].joints[first]
        raise ModelError(
            f"joint '{name}' is outside its limits at the workspace's origin: correct [home] in model.toml "
            "or the limits, choose another origin (at), or leave limits out of account (limits=False)",
            file=robot.description.source,
            element=name,
        )
    flood = _Flood(work, start, step, q0[robot.modules[sweep.module].q_index])
    flood.run(spread, progress)
    index = np.array(list(flood.reached)).reshape(-1, len(step))
    order = np.lexsort(index.T[::-1])
    inner = np.array(list(flood.reached.values()))[order]
    q = np.tile(q0, (len(order), 1))
    q[:, robot.modules[sweep.module].q_index] = inner
    parts = list(spread(work, (("measure", q[i : i + CHUNK]) for i in range(0, len(q), CHUNK))))
    measures = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    index = index[order]
    return Workspace(
        sweep,
        step,
        start,
        index,
        flood.values(index),
        q,
        _motors(robot, sweep, q),
        measures,
        dict(flood.blocked),
    )


def _motors(robot: HybridRobot, sweep: Sweep, q: Array) -> dict[str, Array]:
    """Give the positions of a module's motors, shape (n,) each."""
    joints = {name: robot.joint_index[name] for name in robot.modules[sweep.module].motors}
    return {
        name: q[:, robot.q_slices[joint].start]
        for name, joint in joints.items()
        if robot.kinds[joint] != "continuous"
    }


def _closed_home(robot: HybridRobot) -> Array:
    """Give the home posture, assembled at its motors' positions where its loops are open."""
    if not robot.description.closures or closure_residual(robot, robot.home) <= robot.closure_tolerance:
        return robot.home
    motors = {}
    for name in robot.motors:
        joint = robot.joint_index[name]
        at = robot.home[robot.q_slices[joint]]
        motors[name] = float(at[0]) if len(at) == 1 else float(np.arctan2(at[1], at[0]))
    return assemble(robot, motors=motors)[0]


def _at_start(close: Closing, start: Array, home: Array) -> Array:
    """Walk from home to the lattice's origin: the module's posture there, shape (its nq,).

    Raises:
        AssemblyError: The origin is out of reach.
    """
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
        f"link '{sweep.link}' does not reach the workspace's origin ({there}) from home; choose another",
        module=close.robot.modules[sweep.module].name,
    )


def _step(name: str, sweep: Sweep, length: float, steps: Mapping[str, float]) -> float:
    linear, dimensions = COORDINATES.index(name) < 3, len(sweep.axes)
    step = steps.get(name, length / POINTS[dimensions] if linear else TURNS[dimensions])
    if not 0 < step < np.inf:
        raise ModelError(f"the step of '{name}' must be positive, not {step:g}")
    return float(step)


@dataclass(frozen=True)
class Work:
    """What is done to chunks of postures; it travels to other processes once.

    Attributes:
        closing: Goes from poses to neighbouring ones.
        measures: Measures postures.
    """

    closing: Closing
    measures: Measures

    def __call__(self, what: str, *arguments: Any) -> Any:
        """Do one of the two, "close" or "measure"."""
        return self.closing(*arguments) if what == "close" else self.measures(*arguments)


Point = tuple[int, ...]
"""A lattice point: steps from the origin along each axis."""
Pair = tuple[Point, Point]
"""A step from one point to a neighbour."""


class _Flood:
    """The lattice, flooded from its origin."""

    def __init__(self, work: Work, start: Array, step: Array, q: Array) -> None:
        self.work, self.close, self.start, self.step = work, work.closing, start, step
        names = self.close.sweep.names
        self.columns = [names.index(axis) for axis in self.close.sweep.axes]
        self.angular = [COORDINATES.index(axis) >= 3 for axis in self.close.sweep.axes]
        self.reached: dict[Point, Array] = {(0,) * len(step): q}
        self.waiting: dict[Point, list[Point]] = {}
        self.hard: list[list[Pair]] = [[] for _ in PARTS]
        self.blocked: Counter[str] = Counter()

    def values(self, index: Index) -> Array:
        """Give the coordinates of lattice points (n, axes), shape (n, names)."""
        out = np.tile(self.start, (len(index), 1))
        out[:, self.columns] += index * self.step
        return out

    def run(self, spread: Spread, progress: Callable[[int], None] | None) -> None:
        """Reach whatever can be reached: by whole steps as far as they go, then the rest in smaller ones."""
        self._neighbours(next(iter(self.reached)))
        while (found := self._next()) is not None:
            level, pairs = found
            done = 0
            for q, state in spread(self.work, self._chunks(level, pairs)):
                for posture, what, pair in zip(q, state, pairs[done : done + len(q)], strict=True):
                    self._arrived(level, pair, posture, int(what))
                done += len(q)
                if progress:
                    progress(len(self.reached))
            if len(self.reached) > MOST:
                raise ModelError(
                    f"the workspace has more than {MOST:,} poses: take larger steps or fewer coordinates, or "
                    "state limits in the robot's file"
                )

    def _next(self) -> tuple[int, list[Pair]] | None:
        """Give the steps to take next, and the number of their entry in `PARTS`; None at the end."""
        if self.waiting:  # one step to each point: from the first neighbour not tried yet
            pairs = [(sides.pop(0), to) for to, sides in self.waiting.items()]
            self.waiting = {to: sides for to, sides in self.waiting.items() if sides}
            return 0, pairs
        for level in range(1, len(PARTS)):
            pairs = [pair for pair in self.hard[level] if pair[1] not in self.reached]
            self.hard[level] = []
            if pairs:
                return level, pairs
        return None

    def _arrived(self, level: int, pair: Pair, posture: Array, what: int) -> None:
        """Enter what a step came to."""
        to = pair[1]
        if to in self.reached:
            return
        if what == REACHED:
            self.reached[to] = posture
            self.waiting.pop(to, None)
            self._neighbours(to)
        elif what == OUT_OF_REACH and level + 1 < len(PARTS):
            self.hard[level + 1].append(pair)
        else:
            names = self.close.robot.modules[self.close.sweep.module].joints
            self.blocked["reach" if what == OUT_OF_REACH else names[what]] += 1

    def _neighbours(self, at: Point) -> None:
        """Let the neighbours of a point wait to be reached from it."""
        for axis, direction in itertools.product(range(len(at)), (1, -1)):
            to = (*at[:axis], at[axis] + direction, *at[axis + 1 :])
            turned = self.angular[axis] and abs(to[axis]) * self.step[axis] > np.pi
            if to not in self.reached and not turned:
                self.waiting.setdefault(to, []).append(at)

    def _chunks(self, level: int, pairs: list[Pair]) -> Iterator[tuple[Any, ...]]:
        for i in range(0, len(pairs), CHUNK):
            part = pairs[i : i + CHUNK]
            before, after = (self.values(np.array([pair[side] for pair in part])) for side in (0, 1))
            yield "close", PARTS[level], before, after, np.array([self.reached[at] for at, _ in part])
