"""Positions of cut wrists, which connect the ends of their legs with the bodies these carry."""

from __future__ import annotations

import numpy as np

from ..linkage.closures import Closures
from ..linkage.newton import LoopProblem
from ..linkage.reduction import Block
from ..linkage.targets import PoseTarget
from ..linkage.tree import Motion, Tree
from ..spatial import Array
from ..structure.module import Module
from .follow import follow
from .task import Task


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
    for number, wrist in enumerate(m.spec.wrists):
        tree = Tree(list(m.wrists.joints(number)))
        end = target.of_body(m.cut.tree_body(wrist.target)).then(Motion.at_rest(len(x), wrist.R, wrist.p))
        first = m.spanning.joints[wrist.joints[0]].parent
        relative = end.seen_from(target.of_body(m.cut.tree_body(first)))
        rest = np.zeros((len(x), 6))
        units = np.array([m.length] * 3 + [1.0] * 3)
        goal = PoseTarget(len(tree.joints), relative.R, relative.p, rest, rest, units)
        free = np.ones(tree.nv, dtype=bool)
        none = Closures(tree, [], [])
        cols = m.wrists.columns(number)
        blocks = [Block(np.arange(6), np.arange(tree.nv))]
        problem = LoopProblem(none, np.zeros(0), m.spanning_col_scale[cols], free, [goal], tree.nv, blocks)
        name = f"wrist of '{module.joints[wrist.joints[-1]]}'"
        at = m.wrists.positions(number)
        task = Task(problem, q[:, at], (), 1e-6, module.name, [name] * 6)
        if trajectories or guess.ndim == 1:
            q[:, at] = follow(task, guess[..., at], keep_branch=False)
        else:
            q[:, at] = task.solve(guess[:, at], np.arange(len(x))).q
    return q
