"""Compute the workspace of a link: every pose on a lattice that it can reach from home.

All modules between the link and the one in which its pose is measured move. Where they have more freedoms
than the pose, a rule takes them: by default, each step from a pose to the next is the least motion of the
motors (`assembly.chain`).

The origin of the lattice is the home pose, or a pose that can be reached from it. The neighbours of each
reached pose are assembled starting from its posture. Every posture is therefore on home's assembly branch,
and a path within the joint limits leads to it. A neighbour counts as reached if three conditions hold: its
loops close, the step agrees with the one that their derivative predicts, and every joint is within its
limits. Whole steps are tried first. Where they fail, smaller steps follow.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...assembly.assemble import assemble_home
from ...assembly.redundancy import LEAST, check_rule
from ...assembly.task import closure_residual
from ...errors import AssemblyError, ModelError, TrajectoryError
from ...linkage.targets import COORDINATES
from ...spatial import Array, Index
from ...structure.robot import HybridRobot
from ...threads import one_thread
from .closing import OUT_OF_REACH, REACHED, PoseClosing
from .flood import CHUNK, Flood, Spread
from .link_sweep import LinkSweep, find_sweep, values_at
from .measures import Measures

#: Default steps, by number of swept coordinates: lattice points per module length, and angles [rad].
POINTS = {1: 200, 2: 50, 3: 24, 4: 8, 5: 5, 6: 4}
TURNS = {1: 0.02, 2: 0.05, 3: 0.1, 4: 0.2, 5: 0.3, 6: 0.4}
#: Numbers of parts in which the step from home to another origin is tried.
WALK = (8, 32, 128)


@dataclass(frozen=True, eq=False)
class Workspace:
    """The poses that a link reaches.

    Attributes:
        sweep: Links and coordinates.
        steps: Step of each swept coordinate, shape (axes,), [m, rad].
        start: Values of all coordinates at the lattice's origin, shape (names,).
        index: Lattice points that were reached, steps from the origin, shape (n, axes).
        coordinates: Their coordinates, shape (n, names), [m, rad].
        q: Postures of the whole robot, shape (n, nq); other modules are at home.
        motors: Positions of the modules' motors by name, shape (n,) each, without continuous joints.
        measures: Measures of the postures by name, shape (n,) each (see `Measures`).
        rejected: Steps that were rejected, by the joint whose limit was exceeded: the lattice points from and
            to which they go, shape (n, 2, axes). "reach" has steps at which the loops do not close or the
            branch ends, "half a turn" those by which an angle goes farther from the origin.
        spare: Number of freedoms beyond those of the link, which the rule takes; poses that are not among
            these may then be reached by another motion.
        redundancy: The rule.
    """

    sweep: LinkSweep
    steps: Array
    start: Array
    index: Index
    coordinates: Array
    q: Array
    motors: dict[str, Array]
    measures: dict[str, Array]
    rejected: dict[str, Index]
    spare: int
    redundancy: str = LEAST

    @property
    def size(self) -> float:
        """Number of points times the lattice cell: volume, area or length, product of [m, rad]."""
        return float(len(self.index) * np.prod(self.steps))

    @property
    def blocked(self) -> dict[str, int]:
        """Number of rejected steps, by reason."""
        return {reason: len(steps) for reason, steps in self.rejected.items()}

    @property
    def edges(self) -> dict[str, Array]:
        """Coordinates in the middle of the rejected steps, by reason, shape (n, names) each, [m, rad]."""
        return {
            reason: self.sweep.at(self.start, self.steps, steps.mean(axis=1))
            for reason, steps in self.rejected.items()
        }

    def ended(self, axis: str, side: int) -> dict[str, int]:
        """Return what ends the region at the least value of a swept coordinate (side -1), or the largest (1).

        Returns:
            Number of rejected steps from there in this direction, by reason, the most frequent one first.
        """
        column = self.sweep.axes.index(axis)
        edge = side * (side * self.index[:, column]).max()
        out = {
            reason: int(np.sum((steps[:, 0, column] == edge) & (steps[:, 1, column] == edge + side)))
            for reason, steps in self.rejected.items()
        }
        return {reason: n for reason, n in sorted(out.items(), key=lambda one: (-one[1], one[0])) if n}


@one_thread()
def workspace(
    robot: HybridRobot, module: int | str | None = None, *, link: str | None = None,
    axes: Sequence[str] | None = None, at: Mapping[str, float] | None = None,
    steps: Mapping[str, float] | None = None, limits: bool = True, redundancy: str = LEAST,
    spread: Spread = itertools.starmap, progress: Callable[[int], None] | None = None,
) -> Workspace:  # fmt: skip
    """Find every pose on a lattice that a link reaches from home.

    Args:
        robot: The robot; modules that do not move the link stay at home.
        module: Number (from 1) or name of the only module that moves; by default the only one with closures.
            If only a link is named, all modules move that move this link.
        link: "link", "link@other" or "link@world", measured in the other link, or in the world, where a
            moving or floating base stays at home: then all modules between the two move. By default the
            platform of the module, in its base link, or in the root link if several modules move the link.
        axes: Coordinates to sweep, of x, y, z, roll, pitch, yaw; by default up to three that are independent,
            else the translations.
        at: Values of coordinates that are not swept, or of the lattice's origin [m, rad]; default home.
        steps: Steps of swept coordinates [m, rad]; by default parts of the modules' lengths, or fixed angles.
        limits: Whether joint limits are respected.
        redundancy: The rule for freedoms that the pose leaves, as in `hybridyn.assemble`.
        spread: Distributes the chunks of work, for example to other processes.
        progress: Called with the number of poses reached.

    Raises:
        TrajectoryError: A name is unknown, or the coordinates are not independent.
        ModelError: There are too many poses.
        AssemblyError: The origin cannot be reached, or is outside the limits.
    """
    check_rule(redundancy)
    home = _closed_home(robot)
    sweep = find_sweep(robot, module, link, axes, home)
    start, step = values_at(sweep, at or {}), _steps(robot, sweep, steps or {})
    close, measures = PoseClosing(robot, sweep, limits, redundancy), Measures(robot, sweep)
    flood = Flood(close, start, step, _at_start(close, start, home))
    flood.run(spread, progress)
    index, q = _postures(flood, home)
    return Workspace(
        sweep, step, start, index, flood.values(index), q, _motors(robot, sweep, q),
        _measured(measures, q, spread), {name: np.array(steps) for name, steps in flood.rejected.items()},
        measures.spare, redundancy,
    )  # fmt: skip


def _postures(flood: Flood, home: Array) -> tuple[Index, Array]:
    """Return the reached lattice points, shape (n, axes), and the robot's postures there, shape (n, nq)."""
    index, inner = flood.found()
    q = np.tile(home, (len(index), 1))
    q[:, flood.close.q_index] = inner
    return index, q


def _steps(robot: HybridRobot, sweep: LinkSweep, given: Mapping[str, float]) -> Array:
    """Return the step of each swept coordinate, shape (axes,), [m, rad]."""
    for name in given:
        if name not in sweep.axes:
            raise TrajectoryError(f"'{name}' is not swept; the swept coordinates are {', '.join(sweep.axes)}")
    length = sum(robot.modules[k].mechanism.length for k in sweep.modules)
    dimensions, out = len(sweep.axes), []
    for name in sweep.axes:
        linear = COORDINATES.index(name) < 3
        out.append(given.get(name, length / POINTS[dimensions] if linear else TURNS[dimensions]))
        if not 0 < out[-1] < np.inf:
            raise ModelError(f"the step of '{name}' must be positive, not {out[-1]:g}")
    return np.array(out, dtype=float)


def _check_origin(close: PoseClosing, q: Array) -> None:
    """Check that the posture at the origin, shape (nq of the modules,), is within the joint limits."""
    joint = int(close.outside(q[None])[0])
    if joint == REACHED:
        return
    name = close.names[joint]
    raise AssemblyError(
        f"joint '{name}' is outside its limits at the workspace's origin: correct [home] in model.toml "
        "or the limits, choose another origin (at), or ignore the limits (limits=False)",
        module=next(m.name for m in close.robot.modules if name in m.joints),
    )


def _measured(measures: Measures, q: Array, spread: Spread) -> dict[str, Array]:
    """Compute the measures of postures, shape (n,) each."""
    parts = list(spread(measures, ((q[i : i + CHUNK],) for i in range(0, len(q), CHUNK))))
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _motors(robot: HybridRobot, sweep: LinkSweep, q: Array) -> dict[str, Array]:
    """Return the positions of the modules' motors without continuous joints, shape (n,) each."""
    motors = [name for k in sweep.modules for name in robot.modules[k].motors]
    joints = {name: robot.joint_index[name] for name in motors}
    return {
        name: q[:, robot.q_slices[joint].start]
        for name, joint in joints.items()
        if not robot.kinds[joint].endless
    }


def _closed_home(robot: HybridRobot) -> Array:
    """Return the home posture; if its loops are open, assemble it at the home positions of the motors."""
    if not robot.description.closures or closure_residual(robot, robot.home) <= robot.closure_tolerance:
        return robot.home
    return assemble_home(robot)


def _at_start(close: PoseClosing, start: Array, home: Array) -> Array:
    """Return the modules' posture at the lattice's origin, shape (their nq,), which is within the limits."""
    q = _stepped(close, start, home)
    _check_origin(close, q)
    return q


def _stepped(close: PoseClosing, start: Array, home: Array) -> Array:
    """Step from home to the lattice's origin and return the modules' posture there, shape (their nq,)."""
    sweep = close.sweep
    q: Array = home[close.q_index]
    if (start == sweep.home).all() and close.redundancy == LEAST:
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
        module=close.robot.modules[sweep.modules[-1]].name,
    )
