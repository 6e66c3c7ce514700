"""Checks that given joints and targets determine a module's posture, and block structure of the rows."""

from __future__ import annotations

import numpy as np

from ..errors import AT_SAMPLE, AssemblyError, SingularityError
from ..linkage.newton import LoopProblem
from ..linkage.reduction import Block, decide_rank
from ..spatial import Array, Mask
from ..structure.module import Module

#: A motion is idle (a rod's spin) if it moves outputs, motors and centres of mass by less than this.
IDLE = 1e-6
#: Rows over the free freedoms are singular if their reciprocal condition number is below this.
SINGULAR_ROWS = 1e-10
#: Ratio of computed to prescribed rates above which a singularity is suspected.
BOUNDED = 1e6


def check_determined(module: Module, problem: LoopProblem, generic: Array) -> int:
    """Compute the generic rank of a problem's rows over its free freedoms, and check that it suffices.

    Args:
        generic: Scaled rows at generic postures, shape (samples, rows, nv).

    Raises:
        AssemblyError: A motion that is not idle remains free; the message names what it moves.
    """
    free = problem.free
    report = decide_rank(generic[:, :, free], problem.rank_tolerance)
    left = int(free.sum()) - report.rank
    if left:
        K = generic[0][:, free]
        null = np.linalg.svd(K, full_matrices=True)[2][report.rank :].T
        motion = np.zeros((problem.tree.nv, left))
        motion[free] = null
        _check_idle(module, problem, motion)
    return report.rank


def _check_idle(module: Module, problem: LoopProblem, motion: Array) -> None:
    """Check that free motions, shape (nv, count), move no motor, no output, and no leg's centre of mass."""
    m = module.mechanism
    moved = motion * problem.col_scale[:, None]
    posture = m.tree.sweep(m.postures[:1])
    names = [f"motor '{name}'" for name in module.motors]
    sizes = [np.abs(motion[c]).max() for c in module.motor_columns]
    for name, body in zip(module.outputs, m.spec.outputs, strict=True):
        J = m.tree.jacobian(posture, body)[0] @ moved
        names.append(f"link '{name}'")
        sizes.append(max(np.abs(J[:3]).max() / m.length, np.abs(J[3:]).max()))
    if not m.spec.outputs:
        for i, link in enumerate(m.spec.leg_bodies):
            if link is not None and link.mass:
                centre = posture.p[:, i + 1] + posture.R[:, i + 1] @ link.com
                J = m.tree.jacobian(posture, i + 1, centre)[0] @ moved
                names.append(f"joint '{module.joints[m.spec.tree_joint[i] or 0]}'")
                sizes.append(np.abs(J[:3]).max() / m.length)
    if not sizes or max(sizes) <= IDLE:
        return
    worst = names[int(np.argmax(sizes))]
    raise AssemblyError(
        f"module '{module.name}': what is given leaves {motion.shape[1]} of its {module.mobility} freedoms "
        f"open; {worst} could still move. Give {module.mobility} positions of its motors or coordinates of "
        "its platform" + (f" (motors: {', '.join(module.motors)})" if module.motors else ""),
        module=module.name,
        open_freedoms=motion.shape[1],
    )


def check_bounded(module: Module, problem: LoopProblem, K: Array, x: Array, wanted: Array, what: str) -> None:
    """Check that joint rates or accelerations stay bounded, which fails at singular postures.

    Args:
        K: Scaled rows over all freedoms, shape (T, rows, nv).
        x: Scaled solution, shape (T, nv).
        wanted: Scaled right-hand side of the rows, shape (T, rows).
        what: "rates" or "accelerations".

    Raises:
        SingularityError: They are unbounded; the message names module, joint, sample and condition number.
    """
    given = np.abs(x[:, ~problem.free]).max(axis=1, initial=0.0)
    asked = np.maximum(given, np.abs(wanted).max(axis=1, initial=0.0))
    missed = np.abs(np.einsum("tij,tj->ti", K, x) - wanted).max(axis=1, initial=0.0)
    fast = np.abs(x).max(axis=1, initial=0.0) > BOUNDED * asked
    suspect = np.flatnonzero(fast | (BOUNDED * missed > asked))
    if not len(suspect):
        return
    s = np.linalg.svd(K[suspect][:, :, problem.free], compute_uv=False)
    least = s[:, (problem.rank or s.shape[1]) - 1]
    singular = np.flatnonzero(least < SINGULAR_ROWS * s[:, 0])
    if not len(singular):
        return
    t, i = int(suspect[singular[0]]), int(singular[0])
    condition = float(s[i, 0] / least[i]) if least[i] else np.inf
    lost, kind, mend = _what_is_singular(module, problem, K[t])
    joint = module.freedom_names()[int(np.argmax(np.abs(x[t])))]
    raise SingularityError(
        f"module '{module.name}': the {what} given{AT_SAMPLE} cannot be followed, those of {joint} would "
        f"have no bound ({kind}; condition number {condition:.1e}, limit {1 / SINGULAR_ROWS:.0e}). Move the "
        f"motion away from there{mend}",
        module=module.name,
        what=lost,
        condition=condition,
        sample=t,
    )


def _what_is_singular(module: Module, problem: LoopProblem, K: Array) -> tuple[str, str, str]:
    """Determine what lost rank: "closures", "legs" or "motors", a description, and a remedy.

    Args:
        K: Scaled rows over all freedoms at one sample, shape (rows, nv).
    """
    m = module.mechanism
    s = np.linalg.svd(K[: m.closures.rows], compute_uv=False)
    if m.reduction.rank and s[m.reduction.rank - 1] < SINGULAR_ROWS * s[0]:
        return "closures", "constraint singularity: the closures lose rank", ""
    given = [not problem.free[m.tree.v_slices[joint]].all() for joint in m.spec.platforms]
    if problem.targets or any(given):
        kind = "serial singularity: a leg is stretched, folded or of no length"
        return "legs", kind, ", or give motors instead of a platform"
    kind = "parallel singularity: the motors lose a direction"
    return "motors", kind, ", or give a platform instead of motors"


def full_rank_blocks(generic: Array, free: Mask, tolerance: float) -> list[Block]:
    """Find the connected blocks of rows and free columns; empty if one lacks full column rank."""
    cols = np.flatnonzero(free)
    touched: Mask = np.abs(generic[:, :, cols]).max(axis=0, initial=0.0) > 1e-12
    label = np.arange(len(cols))
    for row in touched:
        members = set(label[row].tolist())
        if len(members) > 1:
            label[[one in members for one in label.tolist()]] = min(members)
    blocks = []
    for name in sorted(set(label.tolist())):
        own = label == name
        rows = np.flatnonzero(touched[:, own].any(axis=1))
        K = generic[:, rows[:, None], cols[own]]
        if decide_rank(K, tolerance).rank < own.sum():
            return []
        blocks.append(Block(rows, cols[own]))
    return blocks
