"""Continuation from one posture along a trajectory, with detection of changes of the assembly branch.

All samples are solved together, from coarse to fine. Then each step between neighbours is judged, and a walk
replaces it where that is in doubt.
"""

from __future__ import annotations

import numpy as np

from ..errors import AssemblyError
from ..linkage.newton import SETTLED, STALLED, Closed
from ..spatial import Array, Index, Mask, in_turn
from .refusals import Ended, lost, unreachable
from .walk import SMALL_STEP, AnyTask, joined, steps_as_predicted, walk

#: Stride of the samples that are solved first, before all others.
STRIDE = 8
#: A guess whose loops are open by more than this [module lengths] is no posture, and has no branch.
NEARLY_CLOSED = 1e-3


def follow(
    task: AnyTask, guess: Array, *, keep_branch: bool = True, strict: bool = False
) -> tuple[Array, AnyTask]:
    """Compute a posture for every sample, on the branch of the previous one; the first on that of the guess.

    Args:
        guess: Initial posture, shape (nq,). With shape (K, nq), the task's samples are K trajectories of
            equal length, one after the other, which are followed together.
        keep_branch: Whether leaving the branch is an error. If False, whatever posture Newton finds is
            accepted where no branch leads on (a wrist in gimbal lock has none to stay on).
        strict: Whether the first sample, too, must be reached by a straight motion from the guess, if that
            is a posture (`NEARLY_CLOSED`).

    Returns:
        Positions, shape (T, nq), and the task with the headings of its angles at every sample.

    Raises:
        AssemblyError: There is no first posture, a sample is unreachable, or a step leaves the branch. With
            several trajectories, also if one of them needs more than plain steps: follow each alone then.
    """
    guess = np.atleast_2d(guess)
    T = len(task.known) // len(guess)
    q = np.empty((len(task.known), task.problem.tree.nq))
    starts = T * np.arange(len(guess))
    task = task.headed(guess[:1], starts[:1])
    q[starts] = first_postures(task, guess, starts, strict)
    last, chunk = 0, 1 if task.redundant else T
    task = task.headed(q[:1], starts[:1])
    while last < T - 1:
        stop = min(T, last + 1 + chunk)
        samples = starts[:, None] + np.arange(last, stop)
        q[samples], good = _coarse_to_fine(task, q[starts + last], samples)
        task = task.headed(q[last:stop], samples[0])
        pairs, steady = samples[:, :-1].ravel(), good[:, 1:].ravel()
        steady &= ~task.mirrored(q[pairs + 1], pairs + 1)
        steady &= steps_as_predicted(task, q, pairs)
        bad = pairs[~steady]
        if len(bad):
            _only_alone(guess)
        for pair in bad:
            walked = _next(task, q[pair], int(pair), keep_branch)
            off = task.problem.tree.difference(walked[None], q[pair + 1 : pair + 2])
            off /= task.problem.col_scale
            q[pair + 1], before = walked, np.abs(off).max(initial=0.0)
            if before > SMALL_STEP:
                last, chunk = int(pair) + 1, 1 if task.redundant else 64
                task = task.headed(q[pair : pair + 2], np.array([pair, pair + 1]))
                break
        else:
            last, chunk = stop - 1, chunk if task.redundant else 4 * chunk
    return q, task


def first_postures(task: AnyTask, guess: Array, starts: Index, strict: bool) -> Array:
    """Compute the postures reached from guesses at the samples where trajectories start, (K, nq), (K,).

    Each is the end of a continuous path from the guess on its own assembly branch. If there is no such path,
    it is the posture that Newton finds from the guess, or from seeded restarts about it.
    """
    tree = task.problem.tree
    result = _solved(task, guess, starts)
    strict = strict and task.open_by(guess) <= NEARLY_CLOSED
    if strict or task.closed(result).all():
        return _on_branch_of(task, guess, result, starts, strict)
    _only_alone(guess)
    rng = np.random.default_rng(2010)
    best, iterations = result, result.iterations
    for spread, count in ((0.1, 32), (0.5, 64), (1.5, 128), (3.2, 256)):
        noise = rng.uniform(-spread, spread, (count, tree.nv)) * task.problem.col_scale
        about = tree.integrate(np.tile(guess, (count, 1)), noise)
        result = task.solve(about, np.zeros(count, dtype=int), enough=SETTLED)
        iterations += result.iterations
        good = np.flatnonzero(task.closed(result))
        if len(good):
            away = tree.difference(np.tile(guess, (len(good), 1)), result.q[good]) / task.problem.col_scale
            nearest: Array = result.q[good[np.argmin(np.linalg.norm(away, axis=1))]]
            return nearest[None]
        if result.residual.min() < best.residual.min():
            best = result
    raise unreachable(task, best._replace(iterations=iterations), 0)


def _only_alone(guess: Array) -> None:
    """Raise if there is more than one trajectory, guesses of shape (K, nq)."""
    if len(guess) > 1:
        raise AssemblyError("one of several trajectories has to be followed alone")


def _on_branch_of(task: AnyTask, guess: Array, result: Closed, starts: Index, strict: bool) -> Array:
    """Return the ends of the straight motions from guesses to the first samples, shape (K, nq).

    If the branch of a guess ends before, it is an error where `strict`, else the result.
    """
    found, start = result.q.copy(), task.closed_near(guess)
    if (start.residual > task.tolerance).any():
        _only_alone(guess)
        if strict:
            raise unreachable(task, result, 0)
        return found
    closed, problem = task.closed(result), task.problem
    moved = problem.tree.difference(start.q, found) / problem.col_scale
    if closed.all() and np.abs(moved).max(initial=0.0) <= SMALL_STEP:
        return found
    way = task.from_here(start.q, starts)
    steady = steps_as_predicted(way, in_turn(start.q, found), 2 * np.arange(len(guess)))
    for k in np.flatnonzero(~(steady & closed)):
        if closed[k] and joined(way, start.q[k], found[k], 2 * int(k)):
            continue
        end, done = walk(way, start.q[k], 2 * int(k), strict)
        if done == 1.0:
            found[k] = end
        elif strict:
            raise lost(task, result, 0, "straight from the guess", Ended(way, 2 * int(k), end, done))
    return found


def _solved(task: AnyTask, starts: Array, samples: Index) -> Closed:
    """Close the loops of samples from starts.

    Raises:
        AssemblyError: Newton's method stalls, and polygons prove that no posture closes a sample of the task.
    """
    result = task.solve(starts, samples, enough=STALLED)
    if task.closed(result).all():
        return result
    lacking = task.lacking(starts, samples)
    if not lacking.any():
        return task.solve(starts, samples)
    first, start = samples[:1], result.q
    if len(samples) > 1:  # the first of the whole task is named
        lacking = task.lacking(np.tile(starts[:1], (len(task.known), 1)), np.arange(len(task.known)))
        first, start = np.flatnonzero(lacking > 0.0)[:1], starts[:1]
        lacking = lacking[first]
    result = task.solve(start, first, enough=SETTLED)  # the error tells the least residual
    raise unreachable(task, result, int(first[0]), float(lacking[0]))


def _coarse_to_fine(task: AnyTask, start: Array, samples: Index) -> tuple[Array, Mask]:
    """Solve all samples after a known first one: some, then all, from starts interpolated between them.

    Args:
        start: Positions at the first sample of each of K trajectories, shape (K, nq).
        samples: Indices of their samples, shape (K, n).

    Returns:
        Positions, shape (K, n, nq), and a mask of the closed ones, shape (K, n).
    """
    tree = task.problem.tree
    K, n = samples.shape
    q = np.repeat(start[:, None], n, axis=1)
    good = np.arange(n) == np.zeros((K, 1))
    coarse, every = np.arange(0, n, STRIDE), np.arange(n)
    for have, todo in ((coarse[:1], coarse[1:]), (coarse, every[every % STRIDE > 0])):
        if len(todo):
            guess = tree.integrate(*_interpolated(task, q, have, todo))
            result = _solved(task, guess, samples[:, todo].ravel())
            q[:, todo] = result.q.reshape(K, -1, tree.nq)
            good[:, todo] = task.closed(result).reshape(K, -1)
    return q, good


def _interpolated(task: AnyTask, q: Array, have: Index, todo: Index) -> tuple[Array, Array]:
    """Interpolate starts between solved samples: cubic from four neighbours, lower order if there are fewer.

    Returns:
        Positions at the previous solved sample, and the step from it, shapes (K n, nq), (K n, nv).
    """
    tree, K = task.problem.tree, len(q)
    at, last = np.searchsorted(have, todo, side="right") - 1, len(have) - 1

    def at_samples(numbers: Index) -> Array:
        return q[:, numbers].reshape(-1, tree.nq)

    before, step = at_samples(have[at]), np.zeros((K * len(todo), tree.nv))
    if last >= 1:
        first = np.clip(at - 1, 0, max(last - 3, 0))
        nodes = [have[np.minimum(first + i, last)] for i in range(min(4, last + 1))]
        for i, node in enumerate(nodes):
            weight = np.ones(len(todo))
            for j, other in enumerate(nodes):
                if i != j:
                    weight *= (todo - other) / (node - other)
            step += np.tile(weight, K)[:, None] * tree.difference(before, at_samples(node))
    return before, step


def _next(task: AnyTask, q: Array, sample: int, keep_branch: bool) -> Array:
    """Compute the posture of the next sample, on the branch of a sample or, unless kept, on any."""
    there, ended = np.array([sample + 1]), None
    if not task.lacking(q[None], there).any():
        q, done = walk(task, q, sample)
        if done == 1.0:
            return q
        ended = Ended(task, sample, q, done)
    result = task.solve(q[None], there)
    if keep_branch or not task.closed(result)[0]:
        raise lost(task, result, sample + 1, "from the one before", ended)
    return np.asarray(result.q[0])
