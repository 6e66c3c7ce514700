"""Couplings of endless joints: how often they have turned, which cosine and sine do not tell.

A coupling sum c_i x_i = offset holds for positions that count whole turns. Positions that are given tell
them, and so those of joints that couplings alone derive from them. The turns of the others are unknown, and
the residual is known up to

    2 pi (largest number that divides the c_i of the endless joints whose turns are unknown)

With one such joint no doubt is left, whatever the ratio: an angle up to whole turns is all that is wanted.
With several, a motion must stay on the sheet that it began on: the change of sum c_i x_i along a step must be
zero itself, and not up to that period.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..spatial import Array, Index, Mask
from .closures import Closures, TreeCoupling, common_measure

#: Periods are the same where they differ by less than this part: rounding of their quotient.
ROUNDING = 1e-9
#: A posture stands on a sheet where it misses it by no more than this; else it stands on none.
ON_SHEET = 1e-9
#: A motion may begin so many turns from the first position given; farther off it begins within half a turn.
MOST_TURNS = 2.0


@dataclass(frozen=True)
class Term:
    """A joint of a coupling whose position is not given.

    Attributes:
        at: Its first position coordinate.
        to: Its freedom.
        weight: Its coefficient.
        endless: Whether it has no ends.
        turned: Where couplings put it, whole turns counted, shape (T,), or None where they do not tell.
    """

    at: int
    to: int
    weight: float
    endless: bool
    turned: Array | None

    def position(self, q: Array, samples: Index) -> Array:
        """Return the position, shape (T,), whole turns counted where they are known."""
        if not self.endless:
            return q[:, self.at]
        x: Array = np.arctan2(q[:, self.at + 1], q[:, self.at])
        return x if self.turned is None else _nearest(x, self.turned[samples])


@dataclass(frozen=True)
class Gear:
    """One coupling with endless joints.

    Attributes:
        row: Its row among the closures'.
        given: Share of the joints given in sum c_i x_i - offset, whole turns counted, shape (T,).
        terms: The other joints.
        follower: The joint among them that this coupling places, and where, shape (T,); or None.
        period: What the residual is known up to; 0 where it is known.
        told: Whether turns that are known tell more than cosines and sines do.
    """

    row: int
    given: Array
    terms: tuple[Term, ...]
    follower: tuple[Term, Array] | None
    period: float
    told: bool

    def residual(self, q: Array, samples: Index) -> Array:
        """Return by how much the coupling is off at samples (numbers into what is given), shape (T,)."""
        total = self.given[samples]
        for term in self.terms:
            total = total + term.weight * term.position(q, samples)
        return total - self.period * np.round(total / self.period) if self.period else total

    def keeps_sheet(self, step: Array, samples: Index) -> Mask:
        """Return whether joint steps, shape (T, nv), from samples to the next stay on their sheet."""
        if self.follower is not None or not self.period:
            return np.ones(len(step), dtype=bool)
        total = self.given[samples + 1] - self.given[samples]
        for term in self.terms:
            total = total + term.weight * step[:, term.to]
        out: Mask = np.abs(total) < self.period / 2
        return out

    def near(self, q: Array) -> Gear:
        """Return the gear with its turns counted as in a posture, shape (nq,), where they are unknown."""
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
        return replace(self, given=given, terms=terms, period=0.0, told=True)


@dataclass(frozen=True)
class Winding:
    """The couplings of a tree with endless joints, and the positions given that wind them.

    Attributes:
        closures: The closures and couplings.
        given: Numbers of the joints whose positions are given.
        angles: Positions of the endless ones among them, whole turns counted, shape (T,), [rad].
        shift: What the offset of each coupling is raised by, shape (couplings,).
        gears: The couplings with endless joints.
    """

    closures: Closures
    given: Sequence[int]
    angles: Mapping[int, Array]
    shift: Array
    gears: tuple[Gear, ...]

    def correct(self, residual: Array, q: Array, samples: Index) -> None:
        """Enter the residuals of couplings whose turns are told, in place, shape (T, rows)."""
        for gear in self.gears:
            if gear.told:
                residual[:, gear.row] = gear.residual(q, samples)

    def follow(self, q: Array, samples: Index) -> None:
        """Place joints that gears fix by themselves, in place, shape (T, nq)."""
        for gear in self.gears:
            if gear.told and gear.follower is not None:
                term, place = gear.follower
                x = place[samples]
                if term.endless:
                    q[:, term.at], q[:, term.at + 1] = np.cos(x), np.sin(x)
                else:
                    q[:, term.at] = x

    def keeps_sheets(self, step: Array, samples: Index) -> Mask:
        """Return which steps of the joints, shape (T, nv), from samples to the next stay on their sheets."""
        out = np.ones(len(step), dtype=bool)
        for gear in self.gears:
            out &= gear.keeps_sheet(step, samples)
        return out

    def between(self, sample: int, fractions: Array, known: Array) -> Winding | None:
        """Return the winding on the way from a sample to the next; enter its angles into `known`."""
        angles = {}
        for joint, x in self.angles.items():
            way = x[sample] + fractions * (x[sample + 1] - x[sample])
            angles[joint] = x = np.where(fractions == 1.0, x[sample + 1], way)
            at = self._at(joint)
            known[:, at], known[:, at + 1] = np.cos(x), np.sin(x)
        return winding_of(self.closures, known, self.given, angles, self.shift)

    def from_posture(self, q: Array, known: Array) -> Winding | None:
        """Return the winding of a way that leads from a closed posture, shape (nq,), to the first sample.

        The posture's turns are not known: those that fit the couplings are taken, counted from zero or, where
        the way is long or they do not fit, from within half a turn of the first sample.

        Args:
            q: The posture.
            known: Positions at both ends of the way, shape (2, nq).
        """
        first = {joint: float(x[0]) for joint, x in self.angles.items()}
        alone = {j: float(np.arctan2(q[self._at(j) + 1], q[self._at(j)])) for j in first}
        near = {j: float(_nearest(np.array(x), np.array(first[j]))) for j, x in alone.items()}
        far = any(abs(first[j] - x) > 2 * np.pi * MOST_TURNS for j, x in alone.items())
        ways = [self._wound(known, start, first) for start in (near, alone)]
        off = [0.0 if way is None else way._off(q) for way in ways]
        return ways[0] if far or off[0] <= off[1] + ROUNDING else ways[1]

    @property
    def in_doubt(self) -> bool:
        """True where nothing but a posture before tells the turns of some gear."""
        return any(gear.follower is None and gear.period for gear in self.gears)

    def near(self, q: Array) -> Winding:
        """Return the winding for postures near one, shape (nq,), at the first sample: on its sheets.

        Where it stands on none (the home posture may be open), that is the sheet of no whole turns.
        """
        return replace(self, gears=tuple(gear.near(q) for gear in self.gears))

    def anchored(self, q: Array, known: Array) -> Winding | None:
        """Return the winding on the sheet of a closed posture, shape (nq,), at the first sample."""
        at = np.zeros(1, dtype=int)
        shift = self.shift.copy()
        first = self.closures.rows - len(shift)
        for gear in self.gears:
            if gear.told:
                shift[gear.row - first] += float(gear.residual(q[None], at)[0])
        return winding_of(self.closures, known, self.given, self.angles, shift)

    def _wound(self, known: Array, start: Mapping[int, float], end: Mapping[int, float]) -> Winding | None:
        angles = {joint: np.array([start[joint], end[joint]]) for joint in start}
        return winding_of(self.closures, known, self.given, angles, self.shift)

    def _off(self, q: Array) -> float:
        """Return by how much the couplings are off in a posture at the first sample, shape (nq,)."""
        at = np.zeros(1, dtype=int)
        return max((abs(float(g.residual(q[None], at)[0])) for g in self.gears if g.told), default=0.0)

    def _at(self, joint: int) -> int:
        start: int = self.closures.tree.q_slices[joint].start
        return start


def _nearest(angle: Array, near: Array) -> Array:
    """Return angles with the whole turns that bring them nearest to others."""
    out: Array = angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))
    return out


def tells_turns(unknown: Sequence[float], known: Sequence[float]) -> bool:
    """Return whether known turns decide a coupling, from the coefficients of its endless joints."""
    period, least = common_measure(unknown), common_measure([*unknown, *known])
    return bool(known) and not abs(period - least) <= ROUNDING * least


def winding_of(
    closures: Closures,
    known: Array,
    given: Sequence[int],
    angles: Mapping[int, Array],
    shift: Array | None = None,
) -> Winding | None:
    """Return the winding of a tree's couplings, or None where no turn of an endless joint matters.

    Args:
        closures: The closures and couplings.
        known: Positions, of which the joints in `given` count, shape (T, nq).
        given: Numbers of the joints whose positions are given.
        angles: Positions of the endless ones, whole turns counted, shape (T,), [rad].
        shift: What the offset of each coupling is raised by, shape (couplings,); zero where left out.
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
    used = tuple(g for g in gears if g.told or (g.follower is None and g.period))
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
    """Return one coupling; a joint that it places joins the positions known, in place."""
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
    told = tells_turns(unknown, wound)
    return Gear(row, share, tuple(term for _, term in terms), follower, period, told)
