"""Couplings of continuous joints: the number of whole turns, which cosine and sine do not determine.

A coupling sum c_i x_i = offset holds for positions that count whole turns. The turns are known for joints
whose positions are given, and for joints whose positions follow from those by couplings alone. The turns of
the other joints are unknown, and the residual is determined modulo

        2 pi (greatest common divisor of the c_i of the continuous joints whose turns are unknown)

With one such joint the posture is unique, whatever the ratio, since its angle is needed only up to whole
turns. With several, a motion must stay on its initial sheet: the change of sum c_i x_i along a step must be
zero exactly, and not only modulo that period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..spatial import Array, Index, Mask
from .closures import Closures, TreeCoupling
from .common_measure import common_measure

#: Periods are equal if their relative difference is below this, the rounding of their quotient.
ROUNDING = 1e-9
#: A posture is on a sheet if its residual there is no larger than this; else it is on none.
ON_SHEET = 1e-9
#: Largest distance [turns] of the first given position from a posture whose turns count from zero; beyond
#: it the posture's turns count from within half a turn of that position.
MOST_TURNS = 2.0


@dataclass(frozen=True)
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
        return x if self.turned is None else _nearest(x, self.turned[samples])


@dataclass(frozen=True)
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
        out: Mask = np.abs(total) < self.period / 2
        return out

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


@dataclass(frozen=True)
class Winding:
    """The couplings of a tree with continuous joints, and the given positions that determine their turns.

    Attributes:
        closures: The closures and couplings.
        given: Indices of the joints whose positions are given.
        angles: Positions of the continuous ones among them, including whole turns, shape (T,), [rad].
        shift: Addition to the offset of each coupling, shape (couplings,).
        gears: The couplings with continuous joints.
    """

    closures: Closures
    given: Sequence[int]
    angles: Mapping[int, Array]
    shift: Array
    gears: tuple[Gear, ...]

    def correct(self, residual: Array, q: Array, samples: Index) -> None:
        """Overwrite, in place, the residuals, shape (T, rows), of couplings whose turns matter."""
        for gear in self.gears:
            if gear.turns_matter:
                residual[:, gear.row] = gear.residual(q, samples)

    def follow(self, q: Array, samples: Index) -> None:
        """Set, in place, positions, shape (T, nq), of joints that a single gear determines."""
        for gear in self.gears:
            if gear.turns_matter and gear.follower is not None:
                term, place = gear.follower
                x = place[samples]
                if term.endless:
                    q[:, term.at], q[:, term.at + 1] = np.cos(x), np.sin(x)
                else:
                    q[:, term.at] = x

    def keeps_sheets(self, step: Array, samples: Index) -> Mask:
        """Check which joint steps, shape (T, nv), from samples to the next ones stay on their sheets."""
        out = np.ones(len(step), dtype=bool)
        for gear in self.gears:
            out &= gear.keeps_sheet(step, samples)
        return out

    def between(self, sample: int, fractions: Array, known: Array) -> Winding | None:
        """Interpolate the winding from a sample to the next; write its angles into `known`."""
        angles = {}
        for joint, x in self.angles.items():
            way = x[sample] + fractions * (x[sample + 1] - x[sample])
            angles[joint] = x = np.where(fractions == 1.0, x[sample + 1], way)
            at = self._at(joint)
            known[:, at], known[:, at + 1] = np.cos(x), np.sin(x)
        return winding_of(self.closures, known, self.given, angles, self.shift)

    def from_posture(self, q: Array, known: Array) -> Winding | None:
        """Build the winding of a path from a closed posture, shape (nq,), to the first sample.

        The posture's turns are unknown. They count from zero, or from within half a turn of the first sample
        if that satisfies the couplings better or the path is longer than `MOST_TURNS`.

        Args:
            q: The posture.
            known: Positions at both ends of the path, shape (2, nq).
        """
        first = {joint: float(x[0]) for joint, x in self.angles.items()}
        alone = {j: float(np.arctan2(q[self._at(j) + 1], q[self._at(j)])) for j in first}
        near = {j: float(_nearest(np.array(x), np.array(first[j]))) for j, x in alone.items()}
        far = any(abs(first[j] - x) > 2 * np.pi * MOST_TURNS for j, x in alone.items())
        ways = [self._wound(known, start, first) for start in (near, alone)]
        off = [0.0 if way is None else way._off(q) for way in ways]
        return ways[0] if far or off[0] <= off[1] + ROUNDING else ways[1]

    @property
    def ambiguous(self) -> bool:
        """Whether only a previous posture determines the turns of some gear."""
        return any(gear.follower is None and gear.period for gear in self.gears)

    def near(self, q: Array) -> Winding:
        """Return the winding on the sheets of a posture, shape (nq,), at the first sample.

        If the posture is on no sheet (the home posture may be open), the sheet of zero turns is used.
        """
        return replace(self, gears=tuple(gear.near(q) for gear in self.gears))

    def anchored(self, q: Array, known: Array) -> Winding | None:
        """Return the winding with offsets shifted so that a closed posture, (nq,), is on it at sample 0."""
        at = np.zeros(1, dtype=int)
        shift = self.shift.copy()
        first = self.closures.rows - len(shift)
        for gear in self.gears:
            if gear.turns_matter:
                shift[gear.row - first] += float(gear.residual(q[None], at)[0])
        return winding_of(self.closures, known, self.given, self.angles, shift)

    def _wound(self, known: Array, start: Mapping[int, float], end: Mapping[int, float]) -> Winding | None:
        angles = {joint: np.array([start[joint], end[joint]]) for joint in start}
        return winding_of(self.closures, known, self.given, angles, self.shift)

    def _off(self, q: Array) -> float:
        """Compute the largest coupling residual of a posture, shape (nq,), at the first sample."""
        at = np.zeros(1, dtype=int)
        return max(
            (abs(float(g.residual(q[None], at)[0])) for g in self.gears if g.turns_matter), default=0.0
        )

    def _at(self, joint: int) -> int:
        start: int = self.closures.tree.q_slices[joint].start
        return start


def _nearest(angle: Array, near: Array) -> Array:
    """Add to angles the whole turns that bring them nearest to others."""
    out: Array = angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))
    return out


def turns_decide(unknown: Sequence[float], known: Sequence[float]) -> bool:
    """Check whether known turns affect a coupling's residual.

    Args:
        unknown: Coefficients of its continuous joints whose turns are unknown.
        known: Coefficients of its continuous joints whose turns are known.
    """
    period, least = common_measure(unknown), common_measure([*unknown, *known])
    return bool(known) and not abs(period - least) <= ROUNDING * least


def winding_of(
    closures: Closures,
    known: Array,
    given: Sequence[int],
    angles: Mapping[int, Array],
    shift: Array | None = None,
) -> Winding | None:
    """Build the winding of a tree's couplings, or return None if no turn of a continuous joint matters.

    Args:
        known: Positions, shape (T, nq); only those of the joints in `given` are used.
        given: Indices of the joints whose positions are given.
        angles: Positions of the continuous ones, including whole turns, shape (T,), [rad].
        shift: Addition to the offset of each coupling, shape (couplings,); zero by default.
    """
    tree = closures.tree
    kinds = [joint.kind for joint in tree.joints]
    if not any(kinds[joint] == "continuous" for c in closures.couplings for joint, _ in c.terms):
        return None
    shift = np.zeros(len(closures.couplings)) if shift is None else shift
    held = {joint for c in closures.couplings for joint, _ in c.terms}
    angles = {joint: x for joint, x in angles.items() if joint in held}
    positions: dict[int, Array] = {
        j: angles[j] if j in angles else known[:, tree.q_slices[j].start] for j in held if j in given
    }
    first = closures.rows - len(shift)
    waiting = {i: c for i, c in enumerate(closures.couplings) if any(j not in positions for j, _ in c.terms)}
    gears: list[Gear] = []
    while waiting:
        open_joints = {i: sum(j not in positions for j, _ in c.terms) for i, c in waiting.items()}
        i = min(open_joints, key=lambda k: open_joints[k])
        coupling = waiting.pop(i)
        if open_joints[i]:
            offset = coupling.offset + float(shift[i])
            gears.append(_gear(closures, first + i, coupling, offset, set(given), positions, len(known)))
    used = tuple(g for g in gears if g.turns_matter or (g.follower is None and g.period))
    return Winding(closures, given, angles, shift, used) if used else None


def _gear(
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
