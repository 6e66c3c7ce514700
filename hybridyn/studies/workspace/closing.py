"""Steps of modules from poses of a link to neighbouring ones, on the same assembly branch."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ...assembly.chain.between import pose_task
from ...assembly.chain.lowest import LowestTask
from ...assembly.chain.solve import cut_positions
from ...assembly.chain.task import ChainTask
from ...assembly.requests import gather_requests
from ...assembly.spanning import settled, spanning_positions
from ...assembly.task import Task
from ...assembly.walk import SAME_BRANCH, SMALL_STEP
from ...linkage.newton import STALLED, Problem, close
from ...spatial import Array, Index, Mask
from ...streams.departures import position_limits
from ...structure.robot import HybridRobot
from .link_sweep import LinkSweep, pose_of

#: Largest number of Newton steps from one pose to the next. A pose that needs more, or to which they
#: stall, counts as out of reach.
MOST_NEWTON_STEPS = 25
#: Results of a step. Any other value is the number of the joint that is outside its limits.
REACHED, OUT_OF_REACH = -1, -2


class PoseClosing:
    """Closes the loops of modules at poses near known postures. Pickled for other processes.

    Attributes:
        robot: The robot.
        sweep: Links and coordinates.
        redundancy: The rule for freedoms that the poses leave, as in `hybridyn.assemble`.
    """

    def __init__(self, robot: HybridRobot, sweep: LinkSweep, limits: bool, redundancy: str) -> None:
        self.robot, self.sweep, self.redundancy = robot, sweep, redundancy
        modules = [robot.modules[k] for k in sweep.modules]
        self.names = [name for module in modules for name in module.joints]
        self.q_index = np.concatenate([module.q_index for module in modules])
        #: Positions of each module's joints, and those of its tree after the cuts.
        self.own = _after([module.mechanism.spanning.nq for module in modules])
        self.cut = _after([module.mechanism.tree.nq for module in modules])
        #: Number, column and position limits of each limited joint with one freedom.
        self.limited: list[tuple[int, int, float, float]] = []
        for number, name in enumerate(self.names):
            joint = robot.records.get(name)
            if limits and joint is not None and joint.kind.additive:
                at = robot.q_slices[robot.joint_index[name]].start
                ends, column = position_limits(joint), int(np.flatnonzero(self.q_index == at)[0])
                self.limited += [(number, column, *ends)] if ends is not None else []

    def outside(self, q: Array) -> Index:
        """Return for each posture, shape (T, their nq), the joint farthest outside its limits, or REACHED."""
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
            q: Known postures of the modules, one after the other, shape (T, their nq).

        Returns:
            Postures reached, shape (T, their nq), and for each REACHED, OUT_OF_REACH or the number of the
            joint that is outside its limits.
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
        robot, numbers = self.robot, self.sweep.modules
        pose = {self.sweep.key: pose_of(self.sweep, values)}
        requests = gather_requests(robot, {}, pose, redundancy=self.redundancy)
        whole = np.tile(robot.home, (len(q), 1))
        whole[:, self.q_index] = q
        start = cut_positions(robot, numbers, whole)
        task = pose_task(robot, numbers, requests, whole)
        there, good = _step(task, start, here)
        out = q.copy()
        if good.any():
            found = np.flatnonzero(good)
            for k, own, cut in zip(numbers, self.own, self.cut, strict=True):
                module = robot.modules[k]
                m, x = module.mechanism, settled(module.mechanism, there[found, cut])
                out[found, own] = spanning_positions(module, x, m.tree.sweep(x), q[found, own])
                residual = m.residual(out[found, own], m.spanning.sweep(out[found, own]))
                good[found] &= np.abs(residual).max(axis=1, initial=0.0) <= task.tolerance
        return out, good


def _step(task: Task | ChainTask, start: Array, here: Array) -> tuple[Array, Mask]:
    """Close the loops near postures at coordinates `here`; return where the step is as predicted, too.

    A second rule then takes what is left from there.
    """
    task, samples = task.headed_at(start, here), np.arange(len(start))
    problem: Problem = task.problem
    tree, known = problem.tree, task.with_known(start, samples)
    motion = tree.sweep(known)
    K = problem.matrix(motion, samples, every=False)
    dx = problem.solve(K, -problem.residual(known, samples, motion))
    predicted = tree.integrate(known, dx * problem.col_scale)
    result = close(problem, known, samples, iterations=MOST_NEWTON_STEPS, enough=STALLED)
    off = np.abs(tree.difference(predicted, result.q) / problem.col_scale).max(axis=1, initial=0.0)
    good = off <= SAME_BRANCH * np.abs(dx).max(axis=1, initial=0.0) + SMALL_STEP
    q, good = result.q, task.closed(result) & good
    if isinstance(task, LowestTask):
        q[good], good[good] = task.lowered(q[good], samples[good])
    return q, good


def _after(sizes: Sequence[int]) -> list[slice]:
    """Return parts of given sizes, one after the other."""
    return [slice(*ends) for ends in itertools.pairwise(np.cumsum([0, *sizes]).tolist())]
