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
from .closures import Closures
from .gears import ROUNDING, Gear, gear_of, nearest

#: Largest distance [turns] of the first given position from a posture whose turns count from zero; beyond
#: it the posture's turns count from within half a turn of that position.
MOST_TURNS = 2.0


@dataclass(frozen=True, eq=False)
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
        near = {j: float(nearest(np.array(x), np.array(first[j]))) for j, x in alone.items()}
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
            gears.append(gear_of(closures, first + i, coupling, offset, set(given), positions, len(known)))
    used = tuple(g for g in gears if g.turns_matter or (g.follower is None and g.period))
    return Winding(closures, given, angles, shift, used) if used else None
