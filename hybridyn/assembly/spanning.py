"""From postures of the tree after the cuts back to the spanning tree, whose wrists follow from the bodies."""

import numpy as np

from ..linkage.closures import Closures
from ..linkage.loop_problem import LoopProblem
from ..linkage.motion import Motion
from ..linkage.newton import close
from ..linkage.reduction import LegBlock
from ..spatial import Array
from ..structure.mechanism import Mechanism
from ..structure.module import Module
from .follow import follow
from .pose_targets import whole_target
from .task import Freedom, Task

#: Closures with a larger relative residual are closed once more, with all freedoms free.
SETTLED = 1e-14


def spanning_states(
    module: Module, states: tuple[Array, Array, Array], target: Motion, guess: Array, *, trajectories: int = 0
) -> tuple[Array, Array, Array]:
    """Compute positions, rates and accelerations of the spanning tree, shapes (T, nq), (T, nv), (T, nv).

    Args:
        module: The module.
        states: Positions, rates and accelerations of the tree after the cuts.
        target: Their motion.
        guess: As for `spanning_positions`.
        trajectories: As for `spanning_positions`.
    """
    q = spanning_positions(module, states[0], target, guess, trajectories=trajectories)
    return q, *module.mechanism.spanning_rates(q, *states)


def spanning_positions(
    module: Module, x: Array, target: Motion, guess: Array, *, trajectories: int = 0
) -> Array:
    """Compute positions of the spanning tree, including the wrists that connect ends with their targets.

    Args:
        x: Positions of the tree after the cuts, shape (T, its nq).
        target: Motion of that tree.
        guess: Posture near the first sample, shape (nq,), or one near each sample, shape (T, nq).
        trajectories: Number K of trajectories of equal length, one after the other in `x`; if it is not zero,
            `guess` holds a posture near the first sample of each, shape (K, nq).
    """
    m = module.mechanism
    samples = len(x) // trajectories if trajectories else 1
    q = np.empty((len(x), m.spanning.nq))
    q[:] = np.repeat(guess, samples, axis=0) if trajectories else guess
    m.cut.positions_to_spanning(x, q)
    for number, (wrist, tree) in enumerate(zip(m.spec.wrists, m.wrists.chains, strict=True)):
        end = target.of_body(m.cut.tree_body(wrist.target)).then(Motion.at_rest(len(x), wrist.R, wrist.p))
        first = m.spanning.joints[wrist.joints[0]].parent
        relative = end.seen_from(target.of_body(m.cut.tree_body(first)))
        goal = whole_target(len(tree.joints), relative, m.length)
        free = np.ones(tree.nv, dtype=bool)
        none, units = Closures(tree, [], []), m.wrists.unit(number)
        blocks = [LegBlock(np.arange(6), np.arange(tree.nv))]
        problem = LoopProblem(none, np.zeros(0), units, free, [goal], tree.nv, blocks)
        name = f"wrist of '{module.joints[wrist.joints[-1]]}'"
        at = m.wrists.positions(number)
        task = Task(problem, q[:, at], (), 1e-6, module.name, [name] * 6, [Freedom(name, "rad")] * tree.nv)
        if trajectories or guess.ndim == 1:
            q[:, at] = follow(task, guess[..., at], keep_branch=False)[0]
        else:
            q[:, at] = task.solve(guess[:, at], np.arange(len(x))).q
    return q


def settled(m: Mechanism, x: Array) -> Array:
    """Close loops to rounding where targets contradict them within the tolerance, shape (T, nq)."""
    r, everything = m.reduction, np.ones(m.tree.nv, dtype=bool)
    loops = LoopProblem(m.closures, r.row_scale, r.col_scale, everything, (), r.rank)
    open_by = np.abs(loops.residual(x, np.arange(len(x)))).max(axis=1, initial=0.0)
    bent = np.flatnonzero(open_by > SETTLED)
    if len(bent):
        x[bent] = close(loops, x[bent]).q
    return x
