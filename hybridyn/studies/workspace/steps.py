"""One step of a workspace: from known poses to neighbouring ones, on the same branch and within limits."""

from __future__ import annotations

import numpy as np

from ...assembly.assemble import settled, spanning_positions
from ...assembly.follow import SAME_BRANCH, SMALL_STEP
from ...assembly.module_request import module_request
from ...assembly.requests import gather_requests
from ...assembly.task import module_task
from ...linkage.newton import close
from ...spatial import Array, Index, Mask
from ...streams.departures import position_limits
from ...structure.robot import HybridRobot
from .sweep import Sweep, pose_of

#: Largest number of Newton steps from one pose to the next. A pose that needs more counts as out of reach.
MOST_NEWTON_STEPS = 25
#: Results of a step. Any other value is the number of the joint that is outside its limits.
REACHED, OUT_OF_REACH = -1, -2


class JointLimits:
    """Position limits of a module's joints with one freedom."""

    def __init__(self, robot: HybridRobot, module: int, respected: bool) -> None:
        chosen, rows = robot.modules[module], []
        for number, (name, at) in enumerate(
            zip(chosen.joints, chosen.mechanism.spanning.q_slices, strict=True)
        ):
            joint = robot.records.get(name)
            if respected and joint is not None and joint.kind in ("revolute", "prismatic"):
                limits = position_limits(joint)
                if limits is not None:
                    rows.append((number, at.start, *limits))
        joints, columns, self.lower, self.upper = np.array(rows).reshape(-1, 4).T
        self.joints, self.columns = joints.astype(int), columns.astype(int)

    def broken(self, q: Array) -> Index:
        """Return for each posture, shape (T, its nq), the joint farthest outside its limits, or REACHED."""
        if not len(self.joints):
            return np.full(len(q), REACHED)
        positions = q[:, self.columns]
        outside = np.maximum(self.lower - positions, positions - self.upper)
        worst = outside.argmax(axis=1)
        return np.where(outside.max(axis=1) > 0, self.joints[worst], REACHED)


class Closing:
    """Closes the loops of a module at poses near known postures. Pickled for other processes."""

    def __init__(self, robot: HybridRobot, sweep: Sweep, limits: bool) -> None:
        self.robot, self.sweep = robot, sweep
        self.limits = JointLimits(robot, sweep.module, limits)

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
            way = before[left] + i / parts * (after - before)[left]
            out[left], alive[left] = self._once(way, out[left])
        state = np.full(len(q), OUT_OF_REACH)
        state[alive] = self.limits.broken(out[alive])
        return out, state

    def _once(self, values: Array, q: Array) -> tuple[Array, Mask]:
        """Close the loops at coordinates near postures; return postures, and where they are on the branch."""
        robot, module = self.robot, self.robot.modules[self.sweep.module]
        m = module.mechanism
        requests = gather_requests(robot, {}, {self.sweep.key: pose_of(self.sweep, values)})
        request = module_request(requests, robot, self.sweep.module, {})
        task = module_task(robot, module, request)
        start = m.cut.positions(q)
        samples = np.arange(len(q))
        known = task.with_known(start, samples)
        motion = m.tree.sweep(known)
        problem = task.problem
        dx = problem.solve(problem.matrix(motion, every=False), -problem.residual(known, samples, motion))
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
