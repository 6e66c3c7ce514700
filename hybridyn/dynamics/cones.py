"""Convex programs over efforts of friction, of which those of a ball are one vector of bounded length.

Both are solved by their duals, in which the unknown is a motion: w = given + B c, per what each joint can
hold, is the least of

    even |c|^2 / 2 + target . c + sum of |w_j| over the joints j

In the least, efforts y_j of friction, |y_j| <= 1, oppose the motion of joints that move, y_j = -w_j / |w_j|,
and those of joints at rest, w_j = 0, hold the others:

    even c + target = B^T y                                                                             (*)

Friction that is smoothed near rest makes the function smooth (`_smoothed`), and as a motion keeps its digits
however small it is, friction can be sharpened until it tells which joints move (`_least`). Then the equations
give the last digits (`_finished`), and what they miss proves the least, or refuses it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import ActuationError
from ..spatial import Array, Index, Mask

#: By how much a part may exceed what a motion proves, of the part.
PROVEN = 1e-10
#: What bounds, rest and equation (*) may be missed by, of the bound, of the motion, and of the terms.
TOUCHES = 1e-12
#: By how much friction is sharpened at a time.
SHARPER = 10.0
#: How often it is: motions that are rounding beside those without friction need some thirty times.
SHARPENED = 36
#: Sharpness, per motion without friction, from which it is asked which joints move.
SHARP = 1e3
#: Motion over that within which friction is smoothed, from which a joint counts as moving.
MOVES = 1e2
#: Newton's decrement below which a smoothed function counts as solved.
SOLVED = 0.1
#: Newton's steps on a smoothed function, of which some five are usual.
MOST_STEPS = 100
#: Newton's steps on the joints that move, each of which squares the error.
POLISHES = 6
#: Singular value of motions, over the largest, that is rounding.
LEAVES_REST = 1e-10


class Dual(NamedTuple):
    """The least of even |c|^2 / 2 + target . c + sum of |w_j|, where w = given + B c.

    Attributes:
        given, B: Motions, shapes (k,), (k, m).
        same: Which freedoms are of the same joint, shape (k, k).
        even: 1, or 0 without the square.
        target: Shape (m,).
    """

    given: Array
    B: Array
    same: Mask
    even: float
    target: Array

    def motion(self, c: Array) -> Array:
        """Compute w, shape (k,)."""
        out: Array = self.given + self.B @ c
        return out

    def missed(self, c: Array, y: Array) -> Array:
        """Compute what equation (*) misses, shape (m,): the slope of the function, from its efforts."""
        out: Array = self.even * c + self.target - self.B.T @ y
        return out

    def lengths(self, w: Array) -> Array:
        """Return the length of the vector of each freedom's joint, shape (k,)."""
        out: Array = np.sqrt(self.same @ w**2)
        return out

    def ways(self, w: Array) -> Array:
        """Return the unit vector of each joint's motion, shape (k,); zero where it does not move."""
        length = self.lengths(w)
        out: Array = w / np.where(length > 0, length, 1.0)
        return out

    def along(self, ways: Array) -> Array:
        """Return the projector of each joint on its direction, shape (k, k)."""
        return np.where(self.same, np.outer(ways, ways), 0.0)


class Smoothed(NamedTuple):
    """Friction that is smoothed within motions of 1 / sharpness.

    Attributes:
        c: The motion, shape (m,).
        sharpness: How sharp it is.
        y: Efforts, shape (k,).
        root: A root of how they answer to w, shape (k, k): -dy/dw = root^2.
    """

    c: Array
    sharpness: float
    y: Array
    root: Array


def least_part_of_cones(
    efforts: Array, null: Array, forward: Array, backward: Array, balls: Sequence[Index]
) -> tuple[Array, float, Array]:
    """Compute the efforts, among efforts + null z, that are the least part of what joints can hold.

    Its dual is the motion that needs it: among those along which the load has the power 1, the one that
    friction resists least. Where limits differ by direction, efforts are t (middle + y).

    Args:
        efforts: Shape (k,), not all zero.
        null: Shape (k, m).
        forward, backward: What each joint can hold, shape (k,); of balls the length of a vector.
        balls: Places of the freedoms of each ball.

    Returns:
        The efforts, shape (k,), the part, and the motion that needs it, shape (k,), of balls unit vectors.

    Raises:
        ActuationError: The part is not proven.
    """
    half = (backward + forward) / 2
    middle, size = (backward - forward) / 2 / half, float(np.max(np.abs(efforts) / half))
    load, free = efforts / size, np.linalg.qr(null, mode="complete")[0][:, null.shape[1] :]
    motions, power = half[:, None] * free, free.T @ load  # per what a joint can hold
    B = motions @ np.linalg.qr(power[:, None], mode="complete")[0][:, 1:]
    dual = Dual(-motions @ power / (power @ power), B, _same(len(half), balls), 0.0, -B.T @ middle)
    w, y = _least(dual, np.zeros(B.shape[1]))
    part = -float(load @ (w / half)) / float((dual.ways(w) - middle) @ w)
    own = part * (middle + y)
    own -= np.linalg.lstsq(motions.T, motions.T @ own - power)[0]  # rounding of what the load needs
    needs = float(dual.lengths(own - part * middle).max())
    if not needs <= part * (1 + PROVEN):
        raise _not_found(f"the part {needs * size:.12g} is proven to {part * size:.12g}")
    return size * half * own, needs * size, dual.ways(w)


def nearest(root: Array, target: Array, lower: Array, upper: Array, balls: Sequence[Index]) -> Array:
    """Compute the efforts with the least |root efforts - target|, shape (k,), within their bounds.

    Its dual is the motion c = root efforts - target, of which root^T c are the motions of the joints.

    Args:
        root: Shape (motions, k).
        target: Shape (motions,).
        lower, upper: Bounds, shape (k,); of balls the length of a vector.
        balls: Places of the freedoms of each ball.

    Raises:
        ActuationError: They are not proven.
    """
    middle, half = (upper + lower) / 2, (upper - lower) / 2
    shifted = target - root @ middle
    dual = Dual(np.zeros(len(half)), half[:, None] * root.T, _same(len(half), balls), 1.0, shifted)
    out: Array = middle + half * _least(dual, -shifted)[1]
    return out


def _same(count: int, balls: Sequence[Index]) -> Mask:
    """Return which freedoms are of the same joint, shape (k, k)."""
    out = np.eye(count, dtype=bool)
    for at in balls:
        out[np.ix_(at, at)] = True
    return out


def _not_found(why: str) -> ActuationError:
    """Return the error of efforts that are not proven."""
    return ActuationError(f"what joints at rest hold was not found: {why}")


def _least(dual: Dual, c: Array) -> tuple[Array, Array]:
    """Return the motion w and the efforts y of the least, shape (k,) each, from the motion without friction.

    Raises:
        ActuationError: They are not proven.
    """
    w, least = dual.motion(c), np.inf
    size = float(dual.lengths(w).max())
    if size == 0.0:
        return w, np.zeros(len(w))
    for sharp in SHARPER ** np.arange(SHARPENED):
        at = _smoothed(dual, c, sharp / size)
        c, moves = at.c, dual.lengths(dual.motion(at.c)) * at.sharpness > MOVES
        for those in (moves, np.zeros_like(moves)) if sharp >= SHARP else ():
            w, y, missed = _finished(dual, at, those)
            if missed <= TOUCHES:
                return w, y
            least = min(least, missed)
    raise _not_found(f"bounds of joints, their rest or what they hold are missed by {least:.3g}")


def _newton_step(rows: Array, slope: Array) -> tuple[Array, float]:
    """Compute the step with rows^T rows step = -slope, where rows answer, and its decrement."""
    _, values, V = np.linalg.svd(rows, full_matrices=False)
    answers = values > np.finfo(float).eps * values.max(initial=0.0)
    V, values = V[answers], values[answers]
    scaled = V @ slope / values
    return -V.T @ (scaled / values), float(np.linalg.norm(scaled))


def _friction(dual: Dual, c: Array, sharpness: float) -> tuple[Array, Array]:
    """Compute smoothed efforts and the root of how they answer, as in `Smoothed`, shapes (k,), (k, k)."""
    w = dual.motion(c)
    r = np.sqrt(1.0 + (sharpness * dual.lengths(w)) ** 2)
    bend = np.eye(len(w)) + (1.0 / np.sqrt(r) - 1.0)[:, None] * dual.along(dual.ways(w))
    return -sharpness * w / (1.0 + r), np.sqrt(sharpness / (1.0 + r))[:, None] * bend


def _smoothed(dual: Dual, c: Array, sharpness: float) -> Smoothed:
    """Compute the least where each joint has the effort with 2 |y| / (1 - |y|^2) = sharpness |w|.

    It is the dual of a barrier, -log (1 - |y_j|^2) / sharpness. So Newton's method from c cannot fail where
    its steps are divided by 1 + decrement; longer ones that do not pass the least are faster.
    """
    even = np.sqrt(dual.even) * np.eye(len(c))
    for _ in range(MOST_STEPS):
        y, root = _friction(dual, c, sharpness)
        slope = dual.missed(c, y)
        step, decrement = _newton_step(np.vstack([even, root @ dual.B]), slope)
        solved, part, sure = np.sqrt(sharpness) * decrement, 1.0, 0.0
        while solved > SOLVED and part > sure:
            ahead = c + part * step
            if dual.missed(ahead, _friction(dual, ahead, sharpness)[0]) @ step <= decrement**2 / 2:
                break
            sure = 1.0 / (1.0 + solved)
            part = max(part / 2, sure)
        c = c + part * step
        if solved <= SOLVED:
            break
    return Smoothed(c, sharpness, *_friction(dual, c, sharpness))


def _finished(dual: Dual, at: Smoothed, moves: Mask) -> tuple[Array, Array, float]:
    """Compute motion and efforts from which joints move, and the most by which they miss what they must.

    Args:
        at: Next to the least.
        moves: Which freedoms move, shape (k,).
    """
    sizes, tiny = dual.lengths(np.linalg.norm(dual.B, axis=1)), np.finfo(float).tiny
    c = _moved(dual, *_rested(dual, at.c, ~moves, np.where(sizes > 0, sizes, 1.0)), moves)
    w = dual.motion(c)
    y = _held(dual, at, c, np.where(moves, -dual.ways(w), at.y), ~moves)
    terms = dual.even * np.abs(c) + np.abs(dual.target) + np.abs(dual.B).T @ np.abs(y)
    still = np.maximum(dual.lengths(dual.given) + sizes * np.linalg.norm(at.c), tiny)
    missed = (
        dual.lengths(y).max() - 1.0,
        np.abs(dual.missed(c, y)).max(initial=0.0) / terms.max(initial=tiny),
        float((dual.lengths(w)[~moves] / still[~moves]).max(initial=0.0)),
    )
    return np.where(moves, w, 0.0), y, float(max(missed))


def _rested(dual: Dual, c: Array, rests: Mask, sizes: Array) -> tuple[Array, Array]:
    """Return the nearest motion at which freedoms rest, and a basis of the motions that leave them so."""
    rows, w = dual.B[rests] / sizes[rests, None], dual.motion(c)[rests] / sizes[rests]
    U, values, V = np.linalg.svd(rows)
    rank = int(np.sum(values > LEAVES_REST * values.max(initial=0.0)))
    return c - V[:rank].T @ (U[:, :rank].T @ w / values[:rank]), V[rank:].T


def _moved(dual: Dual, c: Array, free: Array, moves: Mask) -> Array:
    """Compute the least, on c + free x, where joints move: the sum of lengths is smooth there."""
    even = np.sqrt(dual.even) * np.eye(free.shape[1])
    for _ in range(POLISHES):
        w = dual.motion(c)
        ways, length = dual.ways(w) * moves, dual.lengths(w)
        bend = np.sqrt(np.where(moves & (length > 0), length, np.inf))
        across = (np.eye(len(w)) - dual.along(ways)) / bend[:, None]
        rows = np.vstack([even, across @ dual.B @ free])
        c = c + free @ _newton_step(rows, free.T @ dual.missed(c, -ways))[0]
    return c


def _held(dual: Dual, at: Smoothed, c: Array, y: Array, rests: Mask) -> Array:
    """Compute efforts of joints at rest with equation (*): they change least near their bounds."""
    root, rows = at.root[np.ix_(rests, rests)] / np.sqrt(at.sharpness), dual.B[rests].T
    for _ in range(2):  # the second removes rounding of the first
        y[rests] += root @ np.linalg.lstsq(rows @ root, dual.missed(c, y))[0]
    return y
