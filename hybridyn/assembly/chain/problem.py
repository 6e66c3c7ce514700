"""Newton's problem of a chain of modules: each module's rows, and targets between links of any two of them.

Each module gives its least step and a basis N_k of the motions that its own rows leave free, orthonormal by
the rule that measures motions (`ease`). The targets are then a small system over all these motions, sum_k J_k
N_k y_k = b, of which the least-norm solution is taken. The step is the least one that meets all rows. Its
cost is linear in the number of modules.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...linkage.elimination import least_norm, least_squares, relative_change
from ...linkage.loop_problem import LoopProblem
from ...linkage.motion import Motion
from ...linkage.targets import Target
from ...spatial import Array, Index, Mask
from .bodies import Carried, CarriedFrame, ChainMotion, ChainTree, Frames


@dataclass(frozen=True, eq=False)
class Relative:
    """A prescribed motion of a link relative to another.

    Attributes:
        link: The link's frame.
        other: The frame in which the motion is measured.
        target: The rows, of body 1 in the base of a tree whose base is that frame.
        names: Name of each row, for messages.
    """

    link: CarriedFrame
    other: CarriedFrame
    target: Target
    names: tuple[str, ...]


class _Columns(NamedTuple):
    """The Jacobian of a link relative to another over a part's freedoms, in the form of `Tree.jacobian`."""

    J: Array

    def jacobian(self, motion: Motion, body: int) -> Array:
        """Return the Jacobian, shape (T, 6, n)."""
        return self.J


def rates_of_twist(target: Target, relative: Motion, samples: Index) -> Array:
    """Compute the rates of a target's rows at the twist that a link has in the other, shape (T, rows)."""
    twist = np.concatenate([relative.p_dot[:, 1], relative.w[:, 1]], axis=1)
    whole = np.broadcast_to(np.eye(6), (len(twist), 6, 6))
    out: Array = np.einsum("tij,tj->ti", target.matrix(_Columns(whole), relative, samples), twist)
    return out


class ChainRows(NamedTuple):
    """Scaled rows at postures.

    Attributes:
        own: Rows of each part over its freedoms, shape (T, rows, n).
        targets: Rows of the targets over each part's freedoms, shape (T, targets, n).
    """

    own: tuple[Array, ...]
    targets: tuple[Array, ...]

    def take(self, samples: slice) -> ChainRows:
        """Return the rows at some of the postures."""
        return ChainRows(*(tuple(x[samples] for x in rows) for rows in self))


class Split(NamedTuple):
    """Scaled rows, with what each part's own rows leave free.

    Attributes:
        rows: The rows.
        factors: Singular value decomposition of the own rows of each part over its free freedoms, measured
            by the rule; None for a part without rows.
        bases: Motions that the own rows of each part leave free, orthonormal by the rule, shape (T, n, d).
        reach: The targets over these motions, one part after the other, shape (T, targets, sum of d).
    """

    rows: ChainRows
    factors: Sequence[tuple[Array, Array, Array] | None]
    bases: list[Array]
    reach: Array


@dataclass(frozen=True, eq=False)
class ChainProblem:
    """Rows of the parts of a chain, and targets between their links.

    Attributes:
        parts: Each module's closures and own targets.
        carried: What carries the parts.
        relatives: The targets that couple them.
        ease: Motion of each freedom of each part that counts as one, in its unit, shape (n,).
        rank: Number of independent targets at generic postures, once it is known.
    """

    parts: tuple[LoopProblem, ...]
    carried: Carried
    relatives: tuple[Relative, ...]
    ease: tuple[Array, ...]
    rank: int | None = None

    @cached_property
    def tree(self) -> ChainTree:
        """The trees of all parts."""
        return ChainTree([part.tree for part in self.parts])

    @cached_property
    def col_scale(self) -> Array:
        """Unit of each freedom, shape (nv,)."""
        return np.concatenate([part.col_scale for part in self.parts])

    @cached_property
    def free(self) -> Mask:
        """Mask of the freedoms that may move, shape (nv,)."""
        return np.concatenate([part.free for part in self.parts])

    @property
    def unweighted(self) -> ChainProblem:
        """The problem in which a unit of each freedom counts as one."""
        return replace(self, ease=tuple(map(np.ones_like, self.ease)))

    @property
    def has_loops(self) -> bool:
        """Whether a part has closures."""
        return any(part.has_loops for part in self.parts)

    def left(self, part: LoopProblem) -> int:
        """Return the number of free motions that a part's own rows leave."""
        return int(part.free.sum()) - (part.rank or 0)

    def frames(self, motion: ChainMotion, samples: Index, *, moving: bool = False) -> Frames:
        """Return the frames of the parts and links at postures; `moving` as in `Frames`."""
        return Frames(self.carried, motion, samples, moving=moving)

    def residual(self, q: Array, samples: Index, motion: ChainMotion | None = None) -> Array:
        """Compute the scaled residuals, shape (T, rows): those of each part, then the targets'."""
        motion = motion or self.tree.sweep(q)
        own = [
            part.residual(q[:, at], samples, one)
            for part, at, one in zip(self.parts, self.tree.q_of, motion.parts, strict=True)
        ]
        frames = self.frames(motion, samples)
        between = [
            one.target.residual(frames.seen(one.link, one.other), samples) / one.target.units
            for one in self.relatives
        ]
        return np.concatenate([*own, *between], axis=1)

    def matrix(self, motion: ChainMotion, samples: Index | None = None, *, every: bool = True) -> ChainRows:
        """Compute the scaled rows; `every` as in `LoopProblem.matrix`."""
        own = [
            part.matrix(one, samples, every=every) for part, one in zip(self.parts, motion.parts, strict=True)
        ]
        T = len(own[0])
        known = np.zeros(T, dtype=int) if samples is None else samples
        frames, blocks = self.frames(motion, known), []
        for one in self.relatives:
            relative, columns = frames.seen(one.link, one.other), self._columns(one, motion, frames)
            near = None if samples is None else known
            blocks.append([
                one.target.matrix(_Columns(J), relative, near) / one.target.units[:, None] * part.col_scale
                for J, part in zip(columns, self.parts, strict=True)
            ])  # fmt: skip
        targets = tuple(np.concatenate(block, axis=1) for block in zip(*blocks, strict=True))
        return ChainRows(tuple(own), targets)

    def _columns(self, one: Relative, motion: ChainMotion, frames: Frames) -> list[Array]:
        """Compute the Jacobians of a link in the frame of a target over each part, shape (T, 6, n)."""
        point, to_other = frames.of(one.link).p, np.swapaxes(frames.of(one.other).R, 1, 2)
        ways, T, out = (self.carried.way(one.link), self.carried.way(one.other)), len(point), []
        for k, (tree, own, base) in enumerate(zip(self.tree.trees, motion.parts, frames.bases, strict=True)):
            J = np.zeros((T, 6, tree.nv))
            if ways[0].get(k) != ways[1].get(k):
                at = np.einsum("tji,tj->ti", base.R, point - base.p)
                for way, sign in zip(ways, (1.0, -1.0), strict=True):
                    if k in way:
                        J += sign * tree.jacobian(own, way[k], at)
                turn = np.matmul(to_other, base.R)[:, None]
                J = np.matmul(turn, J.reshape(T, 2, 3, tree.nv)).reshape(J.shape)
            out.append(J)
        return out

    def split(self, rows: ChainRows) -> Split:
        """Compute the motions that each part's own rows leave free, and the targets over them."""
        factors, bases = [], []
        for part, K, ease in zip(self.parts, rows.own, self.ease, strict=True):
            free = np.flatnonzero(part.free)
            N = np.zeros((len(K), part.tree.nv, self.left(part)))
            found = None
            if K.shape[1] and len(free):
                found = np.linalg.svd(K[:, :, free] * ease[free], full_matrices=True)
                N[:, free] = np.swapaxes(found[2][:, part.rank or 0 :], 1, 2)
            else:
                N[:, free] = np.eye(len(free))
            factors.append(found)
            bases.append(N * ease[:, None])
        reach = [np.matmul(J, N) for J, N in zip(rows.targets, bases, strict=True)]
        return Split(rows, factors, bases, np.concatenate(reach, axis=2))

    def solve(self, rows: ChainRows, rhs: Array, damping: Array | None = None) -> Array:
        """Solve all rows for the free freedoms, least norm, scaled, shape (T, nv); the others are zero."""
        return self.solve_split(self.split(rows), rhs, damping)

    def solve_split(self, split: Split, rhs: Array, damping: Array | None = None) -> Array:
        """Solve rows, as `solve` does, with the motions that are free at hand."""
        rows, at, steps = split.rows, 0, []
        for part, K, ease, found in zip(self.parts, rows.own, self.ease, split.factors, strict=True):
            step = np.zeros((len(K), part.tree.nv))
            if found is not None:
                own = rhs[:, at : at + K.shape[1]]
                step[:, part.free] = least_norm(found, own, rank=part.rank, damping=damping) * ease[part.free]
            steps.append(step)
            at += K.shape[1]
        b = rhs[:, at:] - sum(np.einsum("tij,tj->ti", J, x) for J, x in zip(rows.targets, steps, strict=True))
        y = least_squares(split.reach, b, rank=self.rank, damping=damping)
        return np.concatenate(steps, axis=1) + self.spread(split, y)

    def spread(self, split: Split, y: Array) -> Array:
        """Return the motion of all freedoms, shape (T, nv), by the coordinates of the free motions."""
        out, at = [], 0
        for N in split.bases:
            out.append(np.einsum("tij,tj->ti", N, y[:, at : at + N.shape[2]]))
            at += N.shape[2]
        return np.concatenate(out, axis=1)

    def gathered(self, split: Split, f: Array) -> Array:
        """Return N^T f, shape (T, sum of d), of forces on all freedoms, shape (T, nv)."""
        pairs = zip(split.bases, self.tree.v_of, strict=True)
        return np.concatenate([np.einsum("tij,ti->tj", N, f[:, at]) for N, at in pairs], axis=1)

    def turned(self, q: Array, samples: Index) -> Array:
        """Compute the relative change of the rows from samples to the next ones, as `LoopProblem.turned`.

        It is the largest of parts and targets.
        """
        both, n = np.concatenate([samples, samples + 1]), len(samples)
        rows = self.matrix(self.tree.sweep(q[both]), both, every=False)
        before, after = rows.take(slice(n)), rows.take(slice(n, None))
        own = [
            part.change(x, y)
            for part, x, y in zip(self.parts, before.own, after.own, strict=True)
            if x.shape[1]
        ]
        split = self.split(before)
        later = [np.matmul(J, N) for J, N in zip(after.targets, split.bases, strict=True)]
        change = np.concatenate(later, axis=2) - split.reach
        rank = min(split.reach.shape[1:]) if self.rank is None else self.rank
        out: Array = np.max([*own, relative_change(split.reach, change, rank)], axis=0)
        return out
