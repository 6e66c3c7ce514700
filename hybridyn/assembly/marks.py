"""Numbers by which the postures of a module are told apart."""

from __future__ import annotations

import numpy as np

from ..spatial import Array, Index, Mask
from ..structure.module import Module
from .task import Task

#: Two postures are equal if no mark that distinguishes postures differs by more (module lengths, cosines).
SAME_ASSEMBLY = 1e-5
#: A mark that an idle motion of size `NUDGE` changes by `NUDGED` or more does not distinguish postures.
NUDGE, NUDGED = 1e-3, 1e-5


def marks_of(module: Module, x: Array) -> Array:
    """Compute the dimensionless marks that distinguish postures, shape (T, marks): see `assemblies`."""
    m = module.mechanism
    motion = m.tree.sweep(x)
    marks = [motion.p[:, 1:].reshape(len(x), -1) / m.length]
    for i, link in enumerate(m.spec.leg_bodies):
        if link is not None and link.mass:
            marks.append((motion.p[:, i + 1] + motion.R[:, i + 1] @ link.com) / m.length)
    for c in m.closures.closures:
        marks.append((motion.p[:, c.body_a] + motion.R[:, c.body_a] @ c.p_a) / m.length)
        marks.append((motion.p[:, c.body_b] + motion.R[:, c.body_b] @ c.p_b) / m.length)
    marks += [motion.R[:, body].reshape(len(x), 9) for body in m.spec.outputs]
    for i, (joint, at) in enumerate(zip(m.tree.joints, m.tree.q_slices, strict=True)):
        if m.tree.v_slices[i].start in module.motor_columns:
            value = x[:, at]
            angle = [np.cos(value), np.sin(value)]
            marks += {"revolute": angle, "prismatic": [value / m.length]}.get(joint.kind, [value])
    return np.concatenate(marks, axis=1)


def unchanged_by_idle_motions(task: Task, module: Module, x: Array) -> Mask:
    """Determine the marks that no idle motion changes, shape (marks,), from a few postures (T, nq)."""
    problem = task.problem
    K = problem.matrix(problem.tree.sweep(x))[:, :, problem.free]
    here = marks_of(module, x)
    still = np.ones(here.shape[1], dtype=bool)
    for idle in np.moveaxis(np.linalg.svd(K)[2][:, problem.rank or 0 :], 1, 0):
        dx = np.zeros((len(x), problem.tree.nv))
        dx[:, problem.free] = NUDGE * idle
        moved = marks_of(module, problem.tree.integrate(x, dx * problem.col_scale))
        still &= np.abs(moved - here).max(axis=0) < NUDGED
    return still


def grouped(marks: Array) -> tuple[Index, Index]:
    """Group equal rows of marks, shape (n, marks); return the group of each row and the group sizes."""
    label = np.full(len(marks), -1)
    groups = 0
    while (label < 0).any():
        rest = np.flatnonzero(label < 0)
        label[rest[np.abs(marks[rest] - marks[rest[0]]).max(axis=1, initial=0.0) <= SAME_ASSEMBLY]] = groups
        groups += 1
    return label, np.bincount(label)
