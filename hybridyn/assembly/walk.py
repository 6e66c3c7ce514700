"""Steps from a posture to the next on one assembly branch, and walks of as many steps as one needs.

A step is compared with the Newton prediction, from which a change of branch deviates. A step that is too long
for this comparison is divided into smaller ones.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..linkage.newton import STALLED, Closed, newton_step
from ..spatial import Array, Index, Mask
from .task import Task

if TYPE_CHECKING:  # most tasks are those of one module
    from .chain.task import ChainTask

#: The task of a module, or of a chain of modules.
AnyTask = TypeVar("AnyTask", Task, "ChainTask")

#: Largest deviation of a step between samples from its prediction, relative to it, plus `SMALL_STEP`.
SAME_BRANCH = 0.25
#: Steps below this [rad, module lengths] are not checked: the rounding of a prediction is as large.
SMALL_STEP = 1e-7
#: Largest relative change of the Jacobian along a step. Two solutions across a fold differ by
#: |J^-1 (J(x) - J)| = 1, however close to each other they are relative to the step.
MOST_TURNING = 0.5
#: Longest step of a given joint [rad, module lengths] that the checks can judge: different branches may look
#: alike at the ends of a longer one.
FARTHEST = 1.0
#: Number of parts of the motion from a guess to a first sample that are solved at once.
PARTS = 32
#: Number of steps that a walk takes at once, once it has taken one of their length.
AT_ONCE = 8
#: Largest number of parts into which a step is divided.
FINEST = 4096
#: The same if Newton does not converge at the end of the step: it is out of reach then, but for few, and the
#: walk finds where the motion ends. Of 347 steps on random stacks that a fine motion makes, it refuses none.
COARSEST = 16


def steps_as_predicted(task: AnyTask, q: Array, samples: Index) -> Mask:
    """Check for each sample whether the step to the next agrees with the Newton prediction.

    The rows are compared with those at the sample itself, before the given joints move: these alone may turn
    the rows beyond a fold.
    """
    problem, tree = task.problem, task.problem.tree
    start = task.with_known(q[samples], samples + 1)
    motion = tree.sweep(start)
    K = problem.matrix(motion, samples + 1, every=False)
    dx, size, _ = newton_step(problem, K, problem.residual(start, samples + 1, motion))
    predicted = tree.integrate(start, dx * problem.col_scale)
    if (lowered := task.predicted(predicted, samples + 1)) is not None:
        predicted = lowered
        dx = tree.difference(start, predicted) / problem.col_scale
        size = np.abs(dx).max(axis=1, initial=0.0)
    off = tree.difference(predicted, q[samples + 1]) / problem.col_scale
    out: Mask = np.abs(off).max(axis=1, initial=0.0) <= SAME_BRANCH * size + SMALL_STEP
    if problem.has_loops:
        given = tree.difference(q[samples], start) / problem.col_scale
        out &= np.abs(given).max(axis=1, initial=0.0) <= FARTHEST
    rest = np.flatnonzero(out & (size > SMALL_STEP))
    if len(rest):
        out[rest] = problem.turned(q, samples[rest]) <= MOST_TURNING
    return out


def joined(task: AnyTask, q: Array, end: Array, sample: int) -> bool:
    """Return whether `PARTS` steps, all as predicted, join a sample's posture and one of the next, (nq,)."""
    tree, fractions = task.problem.tree, np.arange(PARTS + 1) / PARTS
    way = task.between(sample, fractions)
    whole = tree.difference(q[None], end[None])
    start = tree.integrate(np.tile(q, (PARTS - 1, 1)), fractions[1:-1, None] * whole)
    result = way.solve(start, np.arange(1, PARTS), enough=STALLED)
    if not way.closed(result).all():
        return False
    return bool(
        steps_as_predicted(way, np.concatenate([q[None], result.q, end[None]]), np.arange(PARTS)).all()
    )


def walk(task: AnyTask, q: Array, sample: int, finest: bool = False) -> tuple[Array, float]:
    """Follow the branch from a sample to the next, with steps as long as predictions hold.

    Args:
        finest: Whether the shortest steps are tried even if Newton's method does not close the loops at the
            end of the whole one.

    Returns:
        The last posture on the branch, shape (nq,), and which part of the way it is at; 1 at the next sample.
    """
    start, done, step, sure = q, 0.0, 0.25, 0.0
    alone = task.redundant or task.headed(q[None], np.array([sample]), done=done) is not task
    while done < 1.0:
        step = min(step, 1.0 - done)
        count = 1 if alone or step > sure else AT_ONCE
        ends = np.asarray(done + step * np.arange(count + 1), dtype=float)
        ends = np.append(ends[ends < 1.0], 1.0)[: count + 1]
        path, taken = _path(task.between(sample, ends), q)
        if taken:
            q, done, whole = path[taken], float(ends[taken]), taken == len(path) - 1
            task = task.headed(q[None], np.array([sample]), done=done)
            sure, step = step, 2 * step if whole and step <= sure else step
            continue
        if step <= 1 / COARSEST and not finest:
            finest = bool(task.closed(task.solve(start[None], np.array([sample + 1])))[0])
        if step <= 1 / (FINEST if finest else COARSEST):
            return q, done
        sure, step = 0.0 if step <= sure else sure, step / 2
    return q, 1.0


def _path(way: AnyTask, q: Array) -> tuple[Array, int]:
    """Solve all samples of a way after the first, whose posture is known.

    Returns:
        Positions, shape (n + 1, nq), and how many steps from the first one on are as predicted.
    """
    after = np.arange(1, len(way.known))
    result: Closed = way.solve(np.tile(q, (len(after), 1)), after, enough=STALLED)
    path, good = np.concatenate([q[None], result.q]), way.closed(result)
    if good.any():
        good &= steps_as_predicted(way, path, after - 1)
    return path, len(good) if good.all() else int(good.argmin())
