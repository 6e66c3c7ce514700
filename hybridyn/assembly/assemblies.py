"""Search for all postures with given motor positions and platform poses, from seeded random starts.

Each start takes undamped Newton steps of limited length, whether or not the residual decreases, until it
converges to some posture. Postures with small basins of attraction are therefore reached as well. The
postures reached are closed to rounding as in `assemble`, and counted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import AssemblyError, TrajectoryError
from ..linkage.newton import SMALLEST_STEP
from ..linkage.rigid_motion import RigidMotion
from ..linkage.threads import one_thread
from ..spatial import Array, Index, Mask
from ..structure.joint_position import joint_position
from ..structure.module import Module
from ..structure.robot import HybridRobot
from .assemble import module_task, place_base, settled
from .follow import first_posture
from .marks import SAME_ASSEMBLY, grouped, marks_of, unchanged_by_idle_motions
from .module_request import module_request
from .requests import Requests, gather_requests
from .residual import closure_residual
from .task import Task
from .wrist_positions import spanning_positions

#: Longest step of the search [rad, module lengths], maximum number of steps, and the residual of a start
#: that has converged.
LONGEST_STEP, MOST_STEPS, CONVERGED = 1.0, 60, 1e-10
#: Regularisation of the normal equations of the least-norm steps, relative to their trace.
REGULARISATION = 1e-12
#: Number of starts per batch: small enough that their arrays stay in the cache.
STARTS_AT_ONCE = 1000
#: Maximum number of postures of a robot; the numbers of stacked modules multiply.
MOST_POSTURES = 10_000


@dataclass(frozen=True, eq=False)
class Assemblies:
    """The postures found, ordered by distance from the home posture.

    Attributes:
        q: Positions on the spanning tree, shape (n, nq); cut wrists follow their platforms.
        counts: Number of starts that led to each, shape (n,); for stacked modules, the smallest number of
            its modules.
        residual: Closure residual of each, relative to its module's length, shape (n,).
        within_limits: Whether all joints of each posture are within their position limits, shape (n,).
        starts: Number of random starts per module.
        unseen: Estimated probability that one more start finds another posture (Good and Turing: the share of
            the starts whose posture no other start found). If it is above 0, use more starts.
    """

    q: Array
    counts: Index
    residual: Array
    within_limits: Mask
    starts: int
    unseen: float


@one_thread()
def assemblies(
    robot: HybridRobot,
    *,
    motors: Mapping[str, object] | None = None,
    platforms: Mapping[str, object] | None = None,
    starts: int = 1000,
    seed: int = 0,
) -> Assemblies:
    """Find the postures with given motor positions and platform poses.

    Two postures are equal if they agree in the placements of the outputs, the positions of the motors, the
    origins and centres of mass of the legs' links, and the closure points. Whole turns, signs of
    quaternions, a rod's idle spin, and the two solutions of a universal joint for a straight leg therefore
    do not distinguish postures. Of such variants the one nearest to the home posture is returned.

    Args:
        robot: The robot.
        motors: As in `hybridyn.assemble`, one sample; rates are not used.
        platforms: As in `hybridyn.assemble`, one sample.
        starts: Number of random starts per module with loops.
        seed: Seed of the starts; the same seed finds the same postures.

    Returns:
        The postures. Each closes all loops; joints may be beyond their limits. The search may miss postures:
        see `Assemblies.unseen`.

    Raises:
        AssemblyError: There is no posture, it is underdetermined, or stacked modules have more than 10,000.
        TrajectoryError: A name is unknown, a shape is wrong, or there are several samples.
    """
    requests = gather_requests(robot, motors or {}, platforms or {})
    if not requests.single:
        raise TrajectoryError("assemblies takes one sample: numbers, and poses of shape (7,)")
    if starts < 1:
        raise TrajectoryError(f"starts must be at least 1, not {starts}")
    search = _Search(robot, requests, starts, seed)
    for number in range(robot.base == "floating", len(robot.modules)):
        search.add(number)
    q = search.q
    return Assemblies(
        q, search.counts, closure_residual(robot, q), _within_limits(robot, q), starts, search.unseen
    )


def _within_limits(robot: HybridRobot, q: Array) -> Mask:
    """Check which postures, shape (n, nq), keep every joint within its limits."""
    within = np.ones(len(q), dtype=bool)
    for joint in robot.description.joints:
        if joint.kind in ("revolute", "prismatic"):
            x = q[:, robot.q_slices[robot.joint_index[joint.name]].start]
            slack = SAME_ASSEMBLY * max(abs(x) for x in (joint.lower, joint.upper, 1.0) if np.isfinite(x))
            within &= (x >= joint.lower - slack) & (x <= joint.upper + slack)
    return within


def postures_at_home(robot: HybridRobot, number: int, starts: int) -> Found:
    """Find the postures of one module with its motors at their home positions.

    Raises:
        AssemblyError: The motors do not determine its posture.
    """
    module = robot.modules[number]
    joints = {motor: float(joint_position(robot, robot.home, motor)) for motor in module.motors}
    requests = gather_requests(robot, joints, {})
    task = module_task(robot, module, module_request(requests, robot, number, {}))
    return postures(robot, module, task, starts, seed=0)


@dataclass(frozen=True, eq=False)
class Found:
    """The postures found for one module.

    Attributes:
        x: Postures on the module's tree after the cuts, shape (n, nq).
        q: The same on its spanning tree.
        counts: Number of starts that led to each, shape (n,).
    """

    x: Array
    q: Array
    counts: Index


class _Search:
    """All postures of the modules searched so far, from the base outwards."""

    def __init__(self, robot: HybridRobot, requests: Requests, starts: int, seed: int) -> None:
        self.robot, self.requests, self.starts, self.seed = robot, requests, starts, seed
        self.q = robot.home[None].copy()
        place_base(robot, requests, self.q, *np.zeros((2, 1, robot.nv)))
        self.counts: Index = np.array([starts])
        self.unseen = 0.0
        self._bodies = {0: RigidMotion.at_rest(1)}
        self._known: dict[tuple[int, bytes], Found] = {}

    def add(self, number: int) -> None:
        """Search a module's postures for each posture of the modules below it.

        Raises:
            AssemblyError: It has no posture for some of them, or there are too many.
        """
        module = self.robot.modules[number]
        rows_below = range(len(self.q)) if self._depends(number) else [0] * len(self.q)
        known: dict[int, Found] = {row: self._module(number, row) for row in set(rows_below)}
        found = [known[row] for row in rows_below]
        total = sum(len(f.counts) for f in found)
        if total > MOST_POSTURES:
            raise AssemblyError(
                f"module '{module.name}': with the modules below it, it has at least {total} postures "
                f"(limit {MOST_POSTURES}): the numbers of stacked modules multiply. Give the poses of some "
                "platforms",
                module=module.name,
            )
        rows = np.repeat(np.arange(len(self.q)), [len(f.counts) for f in found])
        self.q = self.q[rows]
        self.q[:, module.q_index] = np.concatenate([f.q for f in found])
        self.counts = np.minimum(self.counts[rows], np.concatenate([f.counts for f in found]))
        once = max(float((f.counts == 1).sum()) for f in found) / self.starts
        self.unseen = 1 - (1 - self.unseen) * (1 - once)
        self._place(module, rows)

    def _depends(self, number: int) -> bool:
        """Check whether a module's request depends on the posture of the modules below it."""
        place = self.robot.bodies.place
        base = place[self.robot.modules[number].base][0]
        poses = [p for p in self.requests.poses if self.robot.body_owner[place[p.link][0]][0] == number]
        return any(place[p.other][0] != base for p in poses)

    def _module(self, number: int, row: int) -> Found:
        """Return a module's postures for one posture of the modules below, searched once per request."""
        robot, module = self.robot, self.robot.modules[number]
        m = module.mechanism
        below = {body: _row(motion, row) for body, motion in self._bodies.items()}
        task = module_task(robot, module, module_request(self.requests, robot, number, below))
        asked = task.problem.residual(m.home[None], np.zeros(1, dtype=int))
        key = id(m), np.round(np.concatenate([task.known, asked], axis=1), 9).tobytes()
        if key not in self._known:
            self._known[key] = postures(robot, module, task, self.starts, self.seed)
        return self._known[key]

    def _place(self, module: Module, rows: Index) -> None:
        """Select the given rows of the bodies placed so far, and place the module's bodies."""
        self._bodies = {body: _row(motion, rows) for body, motion in self._bodies.items()}
        base = self._bodies[self.robot.bodies.place[module.base][0]]
        motion = module.mechanism.spanning.sweep(self.q[:, module.q_index])
        for i, joint in enumerate(module.joints):
            self._bodies[self.robot.body_of_joint[joint]] = base.then(RigidMotion.of_body(motion, i + 1))


def _row(motion: RigidMotion, rows: int | Index) -> RigidMotion:
    """Return some samples of a frame's motion."""
    at = np.atleast_1d(rows)
    return RigidMotion(*(x[at] for x in motion.arrays))


def postures(robot: HybridRobot, module: Module, task: Task, starts: int, seed: int) -> Found:
    """Find the postures of one module.

    Raises:
        AssemblyError: There is none.
    """
    m, rng = module.mechanism, np.random.default_rng(seed)
    reached = [first_posture(task, m.home)[None]]
    if m.closures.rows:
        spread = np.where(np.abs(m.tree.S_linear).max(axis=1, initial=0.0) > 0, m.length, np.pi)
        for first in range(0, starts, STARTS_AT_ONCE):
            noise = rng.uniform(-spread, spread, (min(STARTS_AT_ONCE, starts - first), m.tree.nv))
            reached.append(_reached(task, m.tree.integrate(np.tile(m.home, (len(noise), 1)), noise)))
    x = settled(m, np.concatenate(reached))
    marks = marks_of(module, x)[:, unchanged_by_idle_motions(task, module, x[:8])]
    label, counts = grouped(marks)
    counts[0] = counts[0] - 1 if m.closures.rows else starts  # the posture of `assemble` is no random start
    turned = np.abs(m.tree.difference(np.tile(m.home, (len(x), 1)), x) / task.problem.col_scale).sum(axis=1)
    kept = np.array([np.flatnonzero(label == i)[np.argmin(turned[label == i])] for i in range(len(counts))])
    order = np.lexsort([*np.round(marks[kept].T / SAME_ASSEMBLY), np.round(turned[kept] / SAME_ASSEMBLY)])
    x = x[kept[order]]
    guess = robot.home[module.q_index]
    one_by_one = [spanning_positions(module, row[None], m.tree.sweep(row[None]), guess) for row in x]
    return Found(x, np.concatenate(one_by_one), counts[order])


def _reached(task: Task, q: Array) -> Array:
    """Compute the closed postures reached from starts, shapes (starts, nq) and (closed, nq)."""
    problem, q = task.problem, task.with_known(q, np.zeros(len(q), dtype=int))
    active, there = np.arange(len(q)), np.zeros(len(q), dtype=bool)
    for _ in range(MOST_STEPS):
        motion = problem.tree.sweep(q[active])
        residual = problem.residual(q[active], np.zeros(len(active), dtype=int), motion)
        there[active] = np.abs(residual).max(axis=1, initial=0.0) < CONVERGED
        K = problem.matrix(motion, every=False)[:, :, problem.free]
        square = K @ K.transpose(0, 2, 1)
        size = np.trace(square, axis1=1, axis2=2)[:, None, None]
        square += (REGULARISATION * size + np.finfo(float).tiny) * np.eye(square.shape[1])
        dx = np.zeros((len(active), problem.tree.nv))
        dx[:, problem.free] = -(K.transpose(0, 2, 1) @ np.linalg.solve(square, residual[..., None]))[..., 0]
        length = np.abs(dx).max(axis=1, initial=0.0)
        there[active] |= length < SMALLEST_STEP  # for targets that contradict one another within tolerance
        dx *= np.minimum(1.0, LONGEST_STEP / np.maximum(length, LONGEST_STEP))[:, None]
        q[active] = problem.tree.integrate(q[active], dx * problem.col_scale)
        active = active[~there[active]]
        if not len(active):
            break
    result = task.solve(q[there], np.zeros(there.sum(), dtype=int))
    return result.q[task.closed(result)]
