"""What joints at rest hold, and which of them begin to move: two convex programs.

Joints at rest have the efforts phi of friction, within -forward <= phi <= backward, and the accelerations
a + G phi, where G is symmetric and positive semidefinite. In a loop several joints follow one motion: G loses
rank, and statics does not say what each of them holds.

`Hold.share` asks for the efforts that keep all joints at rest and need the least part t of what each joint
can hold. Its dual is a motion d of these joints: t is the power of the load along d over that of the friction
that resists it, sum of backward |d| or forward |d|, and d is the motion where this is largest. So a motion is
released when the power along it exceeds what its joints can hold together. The three efforts of a ball are
one vector phi with |phi| <= level, which resists a motion by level |d|: the linear program becomes one over
cones (`cones`). Loops without balls keep the linear program, which is solved in a fifteenth of the
time.

`begin` asks for the efforts with the least Gauss constraint phi^T G phi / 2 + a^T phi. The accelerations are
unique; friction at its limit opposes each that is not zero.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import ActuationError
from ..spatial import Array, Index
from .cones import least_part_of_cones, nearest

#: Eigenvalue of G, scaled to 1 on its diagonal, from which joints count as following the same motion.
FOLLOWING = 1e-11
#: Answer of a joint to its own effort, over the largest one, below which its loops lock it.
LOCKED = 1e-13
#: Entry of the projector on efforts that hold each other below which two joints are not of one loop.
APART = 1e-9
#: Tolerance of the linear program, the least that its solver takes.
TIGHTEST = 1e-10
#: Difference of the parts that joints need below which they begin to move at once: those of mirrored legs.
TOGETHER = 1e-9
#: Part of the largest effort that a joint without friction is taken to hold, so that ratios are finite.
NOTHING = 1e-12


class Held(NamedTuple):
    """What joints at rest hold.

    Attributes:
        efforts: Efforts of friction, shape (k,).
        ratio: The largest part that a joint needs of what it can hold; above 1 a motion is released.
        motion: Direction in which each joint would begin to move: 1, -1, or 0 for no motion, shape (k,); of
            balls unit vectors.
    """

    efforts: Array
    ratio: float
    motion: Array


class Hold:
    """Joints at rest, and what moves them.

    Attributes:
        inverse: Efforts that cause unit accelerations, a symmetric pseudo-inverse of G, shape (k, k).
        root: A factor of G = root^T root, shape (motions, k).
        loops: Efforts that move nothing, in parts that do not concern each other: joints, and basis.
        balls: Places of the freedoms of each ball.
    """

    def __init__(self, G: Array, balls: Sequence[Index] = ()) -> None:
        """Factorize G, shape (k, k)."""
        own = np.diag(G)
        scale = np.sqrt(np.where(own > LOCKED * own.max(initial=0.0), own, np.inf))
        values, vectors = np.linalg.eigh(G / scale[:, None] / scale)
        moving, free = values > FOLLOWING, np.isfinite(scale)
        part = vectors[:, moving] / scale[:, None]
        self.inverse: Array = (part / values[moving]) @ part.T
        lengths = np.where(free, scale, 0.0)[:, None]
        self.root: Array = (lengths * vectors[:, moving] * np.sqrt(values[moving])).T
        self.balls = tuple(balls)
        self.loops = _loops(np.flatnonzero(free), vectors[free][:, ~moving], scale[free], self.balls)

    def share(self, efforts: Array, forward: Array, backward: Array) -> Held:
        """Share out what keeps joints at rest.

        Args:
            efforts: Some efforts that do so, shape (k,).
            forward, backward: What each joint can hold against positive and negative motion, shape (k,); of
                balls the length of a vector.
        """
        least = NOTHING * max(float(np.abs(efforts).max(initial=0.0)), np.finfo(float).tiny)
        forward, backward = np.maximum(forward, least), np.maximum(backward, least)
        out, parts, motion = efforts.copy(), np.zeros(len(efforts)), np.zeros(len(efforts))
        for joints, null in self.loops:
            balls = [np.flatnonzero(np.isin(joints, at)) for at in self.balls if np.isin(at, joints).any()]
            own = _least_part(efforts[joints], null, forward[joints], backward[joints], balls)
            out[joints], parts[joints], motion[joints] = own
        ratio = float(parts.max(initial=0.0))
        begins = (parts >= 1.0 - TOGETHER) & (ratio > 1.0)
        return Held(out, ratio, np.where(begins, motion, 0.0))

    def begin(self, a: Array, forward: Array, backward: Array) -> Array:
        """Compute the efforts of friction of joints at rest, some of which begin to move, shape (k,).

        Args:
            a: Accelerations without friction, shape (k,).
            forward, backward: As in `share`.
        """
        target = -np.linalg.lstsq(self.root.T, a)[0]
        return nearest(self.root, np.asarray(target), -forward, backward, self.balls)


def _loops(at: Index, still: Array, scale: Array, balls: Sequence[Index]) -> list[tuple[Index, Array]]:
    """Return groups of joints whose efforts can hold each other, and a basis of such efforts, (joints, m).

    Args:
        at: Numbers of the joints that can move.
        still: Scaled efforts that move nothing, orthonormal, shape (joints, m).
        scale: What scales answers, shape (joints,).
        balls: Freedoms that belong together.
    """
    from scipy.sparse.csgraph import connected_components  # SciPy is slow to load

    projector = still @ still.T
    together = np.abs(projector) > APART
    for ball in balls:
        own = np.isin(at, ball)
        together |= np.outer(own, own)
    count, label = connected_components(together, directed=False)
    out = []
    for mine in (np.flatnonzero(label == k) for k in range(count)):
        values, basis = np.linalg.eigh(projector[np.ix_(mine, mine)])
        out.append((at[mine], basis[:, values > 0.5] / scale[mine][:, None]))
    return out


def _least_part(
    efforts: Array, null: Array, forward: Array, backward: Array, balls: Sequence[Index]
) -> tuple[Array, float, Array]:
    """Compute the efforts, among efforts + null z, that are the least part of what joints can hold.

    Returns:
        The efforts, shape (k,), the part, and the motion that needs it, shape (k,).

    Raises:
        ActuationError: The program was not solved.
    """
    if not null.shape[1] and balls:  # a ball by itself
        length = float(np.linalg.norm(efforts))
        return efforts, length / float(forward[0]), -efforts / (length or 1.0)
    if not null.shape[1]:  # a joint by itself
        can = np.where(efforts > 0, backward, forward)
        return efforts, float((np.abs(efforts) / can)[0]), -np.sign(efforts)
    from scipy.optimize import linprog  # SciPy is slow to load

    size, most = float(np.abs(efforts).max()), float(np.maximum(forward, backward).max())
    if size == 0.0:
        return efforts, 0.0, np.zeros(len(efforts))
    if balls:
        return least_part_of_cones(efforts, null, forward, backward, balls)
    rows, given = null / np.abs(null).max(), efforts / size
    A = np.block([[rows, -backward[:, None] / most], [-rows, -forward[:, None] / most]])
    solved = linprog(
        np.eye(A.shape[1])[-1], A, np.concatenate([-given, given]), bounds=(None, None), method="highs",
        options={"primal_feasibility_tolerance": TIGHTEST, "dual_feasibility_tolerance": TIGHTEST},
    )  # fmt: skip
    if solved.x is None:
        raise ActuationError(f"what joints at rest hold was not found: {solved.message}")
    up, down = np.split(-np.asarray(solved.ineqlin.marginals), 2)
    part = float(solved.x[-1]) * size / most
    motion = np.where(np.abs(down - up) > APART, np.sign(down - up), 0.0)
    return size * (given + rows @ solved.x[:-1]), part, motion
