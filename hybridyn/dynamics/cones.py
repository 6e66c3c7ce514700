"""Convex programs over efforts of friction, of which those of a ball are one vector of bounded length.

Both prove what they found, or refuse: `least_part_of_cones` by a motion whose power bounds the part from
below, `nearest` by the multipliers of the bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..errors import ActuationError
from ..spatial import Array, Index

#: By how much a part may exceed what a motion proves, of the part.
PROVEN = 1e-10
#: What the barrier may leave of the part: beyond, differences of lengths lose the digits of forces.
BARRIER = 1e-8
#: Power of a joint at its limit along the motion, over the largest.
AT_LIMIT = 1e-6
#: Steps of Newton's method on the joints at their limits, each of which squares the error.
POLISHES = 4
#: By how much the barrier is sharpened at a time: some ten times in all.
SHARPER = 30.0
#: Newton's decrement below which a barrier counts as centred; below it steps are taken in full.
CENTRED = 0.2
#: Steps of Newton's method in all, of which some sixty are usual.
MOST_STEPS = 1000
#: Multiplier of a ball that holds, over its largest answer: of efforts that move nothing it takes the least.
HOLDS = float(np.finfo(float).eps)
#: By how much the effort of a ball that slips may miss its bound, of the bound.
TOUCHES = 1e-12
#: Growth of a multiplier, as a logarithm, by which a bracket of it is sought.
GROWS = 10.0
#: Sweeps over the balls: one ball needs one, several near their common edge need more and are refused.
MOST_SWEEPS = 200
#: Bound of a ball's effort, over the largest effort, below which it has no direction.
POINTLESS = 1e-14


def least_part_of_cones(
    efforts: Array, null: Array, forward: Array, backward: Array, balls: Sequence[Index]
) -> tuple[Array, float, Array]:
    """Compute the efforts, among efforts + null z, that are the least part of what joints can hold.

    Efforts count per what their joint can hold: with x = (z, t), each joint has y = efforts + B x, and holds
    it with less than the part t if |y| < t (limits that differ by direction shift y by their middle). Where
    what joints of one loop hold differs by more than some 10^3, some programs are refused.

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
    owner, half = _owners(len(efforts), balls), (backward + forward) / 2
    size = float(np.max(np.abs(efforts) / half))  # all per what a joint can hold
    middle, given = (backward - forward) / 2 / half, efforts / half / size
    B = np.column_stack([np.linalg.qr(null / half[:, None])[0], -middle])
    try:
        x, force = _polished(given, B, owner, *_centred(given, B, owner, 1.0 - np.abs(middle)))
    except np.linalg.LinAlgError as error:
        raise _not_found(
            f"joints of one loop differ too much: {half.min():.3g} to {half.max():.3g}"
        ) from error
    y = given + B[:, :-1] @ x[:-1]
    motion = force - B[:, :-1] @ (B[:, :-1].T @ force)  # no power of efforts that move nothing
    part = float(_lengths(owner, y - middle * x[-1]).max())
    resists = float(middle @ motion + _lengths(owner, motion).sum())
    if not part * resists <= given @ motion * (1 + PROVEN):
        proven = given @ motion / resists * size
        raise _not_found(f"the part {part * size:.12g} is proven to {proven:.12g}")
    return size * half * y, part * size, -_unit_vectors(owner, motion / half)


def _not_found(why: str) -> ActuationError:
    """Return the error of a part that is not proven."""
    return ActuationError(f"what joints at rest hold was not found: {why}")


def _owners(size: int, balls: Sequence[Index]) -> Index:
    """Return the number of the joint of each freedom, shape (size,)."""
    single = np.setdiff1d(np.arange(size), np.concatenate([*balls]))
    out = np.empty(size, int)
    for number, at in enumerate([*balls, *single[:, None]]):
        out[at] = number
    return out


def _lengths(owner: Index, x: Array) -> Array:
    """Return the length of the vector of each joint."""
    out: Array = np.sqrt(np.bincount(owner, x**2))
    return out


def _unit_vectors(owner: Index, x: Array) -> Array:
    """Return the direction of the vector of each joint; zero where it is rounding beside the largest."""
    lengths = _lengths(owner, x)
    counts = (lengths > PROVEN * lengths.max())[owner]
    return np.where(counts, x / np.where(counts, lengths[owner], 1.0), 0.0)


def _centred(given: Array, B: Array, owner: Index, least: Array) -> tuple[Array, Array]:
    """Return x = (z, t) where the barrier is sharp, and the force of each joint there, per y.

    Newton's method finds the least of sharpness t - sum of log (t^2 - |y|^2), which tells the joints at their
    limits, whose forces are a motion; `_polished`, on these as equations, gives the last digits.

    Args:
        given, B: y = given + B x, shapes (k,), (k, m + 1).
        owner: Number of the joint of each freedom, shape (k,).
        least: The smaller limit of each freedom, shape (k,).
    """
    x = np.zeros(B.shape[1])
    x[-1] = 2.0 * np.max(_lengths(owner, given)[owner] / least)
    sharpness = 1.0 / x[-1]
    for _ in range(MOST_STEPS):
        y, t = given + B @ x, x[-1]
        length = _lengths(owner, y)
        room = (t - length) * (t + length)
        each = np.zeros((len(room), len(x)))  # slope of the barrier of each joint
        np.add.at(each, owner, (2.0 * y / room[owner])[:, None] * B)
        each[:, -1] -= 2.0 * t / room
        H, slope = (B.T * (2.0 / room)[owner]) @ B + each.T @ each, each.sum(axis=0)
        H[-1, -1] -= np.sum(2.0 / room)
        slope[-1] += sharpness
        step = -np.linalg.solve(H, slope)
        decrement = float(np.sqrt(max(-slope @ step, 0.0)))
        if decrement < CENTRED and 2 * len(room) <= BARRIER * sharpness * t:
            break
        sharpness *= SHARPER if decrement < CENTRED else 1.0
        x = x + step / (1.0 if decrement < CENTRED else 1.0 + decrement)
    return x, 2.0 / (sharpness * room)


def _polished(given: Array, B: Array, owner: Index, x: Array, force: Array) -> tuple[Array, Array]:
    """Return x = (z, t) where joints with forces are at their limits, and the forces, shape (k,).

    It solves |y|^2 = t^2 of these joints, and that their forces hold each other but for that of t.

    Args:
        given, B, owner: As in `_centred`.
        x, force: Where that ends.
    """
    lengths = force * _lengths(owner, given + B @ x)
    at, ahead = lengths > AT_LIMIT * lengths.max(), np.append(np.zeros(len(x) - 1), 1.0)
    while True:
        found, mu = x, np.where(at, force, 0.0)
        for _ in range(POLISHES):
            y, t = given + B @ found, found[-1]
            slopes = np.zeros((len(mu), len(x)))
            np.add.at(slopes, owner, y[:, None] * B)
            slopes[:, -1] -= t
            bend = (B.T * mu[owner]) @ B
            bend[-1, -1] -= np.sum(mu)
            J, off = slopes[at], (np.bincount(owner, y**2) - t**2)[at] / 2
            system = np.block([[bend, J.T], [J, np.zeros((len(J), len(J)))]])
            step = np.linalg.lstsq(system, -np.append(ahead + slopes.T @ mu, off))[0]
            found = found + step[: len(x)]
            mu[at] += step[len(x) :]
        if (mu >= 0).all():
            return found, mu[owner] * (given + B @ found)
        at = at & (mu > 0)


def nearest(root: Array, target: Array, lower: Array, upper: Array, balls: Sequence[Index]) -> Array:
    """Compute the efforts with the least |root efforts - target|, shape (k,), within their bounds.

    A ball that slips has a multiplier mu > 0: with mu |effort|^2 added no bound of its own is needed, and its
    effort becomes shorter as mu grows. Sweeps over the balls find the multipliers.

    Args:
        root: Shape (motions, k).
        target: Shape (motions,).
        lower, upper: Bounds, shape (k,); of balls the length of a vector.
        balls: Places of the freedoms of each ball.

    Raises:
        ActuationError: The multipliers are not found.
    """
    more, lower, upper = np.zeros(root.shape[1]), lower.copy(), upper.copy()
    size = float(np.abs(np.linalg.lstsq(root, target)[0]).max(initial=0.0)) if balls else 0.0
    lengths = [(at, float(upper[at[0]])) for at in balls if upper[at[0]] > POINTLESS * size]
    for at, _ in lengths:
        lower[at], upper[at] = -np.inf, np.inf
        more[at] = HOLDS * float(np.square(root[:, at]).sum(axis=0).max())
    holds, missed = more.copy(), 0.0
    for _ in range(MOST_SWEEPS):
        for at, most in lengths:
            _set_multiplier(lambda: _within(root, target, lower, upper, more), more, holds, at, most)
        x = _within(root, target, lower, upper, more)
        off = [float(np.linalg.norm(x[at])) / most - 1.0 for at, most in lengths]
        slips = [bool(more[at[0]] > holds[at[0]]) for at, _ in lengths]
        missed = max((max(o, -o * s) for o, s in zip(off, slips, strict=True)), default=0.0)
        if missed <= TOUCHES:
            return x
    raise ActuationError(
        f"which balls begin to move was not found in {MOST_SWEEPS} sweeps: an effort misses its bound by "
        f"{missed:.3g} of that"
    )


def _within(root: Array, target: Array, lower: Array, upper: Array, more: Array) -> Array:
    """Compute efforts within bounds of single freedoms, with multipliers `more`, shape (k,)."""
    from scipy.optimize import lsq_linear  # SciPy is slow to load

    added = np.flatnonzero(more)
    rows = np.concatenate([root, np.diag(np.sqrt(more))[added]])
    right = np.concatenate([target, np.zeros(len(added))])
    return np.asarray(lsq_linear(rows, right, (lower, upper), "bvls", tol=np.finfo(float).eps).x)


def _set_multiplier(solved: Callable[[], Array], more: Array, holds: Array, at: Index, most: float) -> None:
    """Write the multiplier of one ball: none if it holds, else that with which its effort is at its bound.

    Args:
        solved: Computes the efforts, shape (k,), with the multipliers in `more`.
        more: Multipliers, shape (k,), of which those of the ball are written.
        holds: Those of balls that hold.
        at: Places of the ball's freedoms.
        most: Length of the effort.
    """
    from scipy.optimize import brentq  # SciPy is slow to load

    def over(power: float) -> float:
        more[at] = holds[at] * np.exp(power)
        return float(np.linalg.norm(solved()[at])) / most - 1.0

    end = 0.0
    while over(end) > 0.0:
        end += GROWS
    if end:
        over(brentq(over, end - GROWS, end, xtol=1e-15, rtol=4 * np.finfo(float).eps))
