"""Compute the workspace of a module: every pose on a lattice that its platform can reach from home.

The origin of the lattice is the home pose, or a pose that can be reached from it. The neighbours of each
reached pose are assembled starting from its posture. Every posture is therefore on home's assembly branch,
and a path within the joint limits leads to it. A neighbour counts as reached if three conditions hold: its
loops close, the step agrees with the one that their derivative predicts (otherwise smaller steps are tried),
and every joint is within its limits.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import starmap

import numpy as np

from ...assembly.assemble import assemble
from ...assembly.task import closure_residual
from ...errors import AssemblyError, ModelError, TrajectoryError
from ...linkage.targets import COORDINATES
from ...spatial import Array, Index
from ...structure.robot import HybridRobot, joint_position
from ...threads import one_thread
from .flood import CHUNK, OUT_OF_REACH, REACHED, Closing, Flood, Spread
from .measures import Measures
from .sweep import Sweep, find_sweep, values_at

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
    spread: Spread = starmap,
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
        ModelError: The origin is outside the limits, or there are too many poses.
        AssemblyError: The origin cannot be reached.
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
    raise ModelError(
        f"joint '{name}' is outside its limits at the workspace's origin: correct [home] in model.toml "
        "or the limits, choose another origin (at), or ignore the limits (limits=False)",
        file=close.robot.description.source,
        element=name,
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
    motors = {name: float(joint_position(robot, robot.home, name)) for name in robot.motors}
    return assemble(robot, motors=motors)[0]


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
