"""A coupling of continuous joints: its residual, its period, and the joint whose position it determines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..spatial import Array, Index, Mask
from .closures import Closures
from .common_measure import common_measure
from .couplings import TreeCoupling

#: Periods are equal if their relative difference is below this, the rounding of their quotient.
ROUNDING = 1e-9
#: A posture is on a sheet if its residual there is no larger than this; else it is on none.
ON_SHEET = 1e-9


@dataclass(frozen=True, eq=False)
class Term:
    """A joint of a coupling whose position is not given.

    Attributes:
        at: Index of its first position coordinate.
        to: Index of its freedom.
        weight: Its coefficient.
        endless: Whether it is continuous.
        turned: Its position from other couplings, including whole turns, shape (T,), or None if undetermined.
    """

    at: int
    to: int
    weight: float
    endless: bool
    turned: Array | None

    def position(self, q: Array, samples: Index) -> Array:
        """Return the position, shape (T,), including whole turns if they are known."""
        if not self.endless:
            return q[:, self.at]
        x: Array = np.arctan2(q[:, self.at + 1], q[:, self.at])
        return x if self.turned is None else nearest(x, self.turned[samples])


@dataclass(frozen=True, eq=False)
class Gear:
    """One coupling with continuous joints.

    Attributes:
        row: Index of its row in the closures.
        given: Part of sum c_i x_i - offset due to given joints, including whole turns, shape (T,).
        terms: The other joints.
        follower: The joint among them whose position this coupling determines, and the position, shape (T,);
            or None.
        period: Period modulo which the residual is known; 0 if it is known exactly.
        turns_matter: Whether the known turns change the residual beyond what cosines and sines determine.
    """

    row: int
    given: Array
    terms: tuple[Term, ...]
    follower: tuple[Term, Array] | None
    period: float
    turns_matter: bool

    def residual(self, q: Array, samples: Index) -> Array:
        """Compute the coupling's residual, shape (T,), at samples (indices into the given positions)."""
        total = self.given[samples]
        for term in self.terms:
            total = total + term.weight * term.position(q, samples)
        return total - self.period * np.round(total / self.period) if self.period else total

    def keeps_sheet(self, step: Array, samples: Index) -> Mask:
        """Check whether joint steps, shape (T, nv), from samples to the next ones stay on their sheet."""
        if self.follower is not None or not self.period:
            return np.ones(len(step), dtype=bool)
        total = self.given[samples + 1] - self.given[samples]
        for term in self.terms:
            total = total + term.weight * step[:, term.to]
        return np.abs(total) < self.period / 2

    def near(self, q: Array) -> Gear:
        """Return the gear with its unknown turns fixed as in a posture, shape (nq,)."""
        if self.follower is not None or not self.period:
            return self
        at = np.zeros(1, dtype=int)
        alone = [float(term.position(q[None], at)[0]) for term in self.terms]
        total = float(self.given[0]) + sum(t.weight * x for t, x in zip(self.terms, alone, strict=True))
        sheet = self.period * round(total / self.period)
        given = self.given - (sheet if abs(total - sheet) <= ON_SHEET else 0.0)
        terms = tuple(
            replace(t, turned=np.full(len(given), x)) for t, x in zip(self.terms, alone, strict=True)
        )
        return replace(self, given=given, terms=terms, period=0.0, turns_matter=True)


def gear_of(
    closures: Closures,
    row: int,
    coupling: TreeCoupling,
    offset: float,
    given: set[int],
    positions: dict[int, Array],
    size: int,
) -> Gear:
    """Build one gear; add a joint position that it determines to `positions`."""
    tree = closures.tree
    share = total = np.full(size, -offset)
    terms: list[tuple[int, Term]] = []
    unknown: list[float] = []
    wound: list[float] = []
    follower: tuple[Term, Array] | None = None
    for joint, weight in coupling.terms:
        endless = tree.joints[joint].kind == "continuous"
        turned = positions.get(joint)
        if turned is not None:
            total = total + weight * turned
        if endless:
            (unknown if turned is None else wound).append(weight)
        if joint in given:
            share = share + weight * positions[joint]
            continue
        at, to = tree.q_slices[joint].start, tree.v_slices[joint].start
        terms.append((joint, Term(at, to, weight, endless, turned)))
    free = [(joint, term) for joint, term in terms if term.turned is None]
    if len(free) == 1:
        joint, term = free[0]
        follower = term, -total / term.weight
        positions[joint] = follower[1]
    period = 2 * np.pi * common_measure(unknown)
    turns_matter = turns_decide(unknown, wound)
    return Gear(row, share, tuple(term for _, term in terms), follower, period, turns_matter)


def turns_decide(unknown: Sequence[float], known: Sequence[float]) -> bool:
    """Check whether known turns affect a coupling's residual.

    Args:
        unknown: Coefficients of its continuous joints whose turns are unknown.
        known: Coefficients of its continuous joints whose turns are known.
    """
    period, least = common_measure(unknown), common_measure([*unknown, *known])
    return bool(known) and not abs(period - least) <= ROUNDING * least


def nearest(angle: Array, near: Array) -> Array:
    """Add to angles the whole turns that bring them nearest to others."""
    return angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))
