"""The library that closes the loops for one choice of what is given, and the place at which it starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....assembly.spanning import spanning_positions
from ....linkage.loop_problem import LoopProblem
from ....linkage.newton import close
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...library.closed_rows import ClosedRows, Rows
from .coupled import Coupled
from .members import Wanted
from .module_parts import (
    CLOSED_TO_ROUNDING,
    Part,
    numbers,
    places_at,
    posture_of,
    upright_is_meant,
)


@dataclass(frozen=True)
class Closing:
    """The library for one choice of given joints and targets.

    Attributes:
        parts: The modules that it closes.
        rows: The loaded library.
        chains: Those of them that poses couple.
    """

    parts: list[Part]
    rows: ClosedRows
    chains: list[Coupled]

    def numbers(self, wanted: Wanted) -> Rows:
        """Return what is prescribed, see `module_parts.numbers`."""
        every = [numbers(self.parts, wanted.own), *(one.wanted(wanted.requests) for one in self.chains)]
        g, g_dot, g_ddot = (np.concatenate(level, axis=1) for level in zip(*every, strict=True))
        return g, g_dot, g_ddot

    def at_home(self, robot: HybridRobot, given: Rows) -> Rows | None:
        """Return the home posture of designs, whose loops may be open, see `place`."""
        q, p, g = posture_of(self.parts, robot.home)
        for one in self.chains:
            known = given[0][0, len(g) : len(g) + one.given.size]
            g = np.concatenate([g, one.numbers_at(robot, q[None], known, met=False)[0]])
        return self.headed((q, p, g), given)

    def place(self, robot: HybridRobot, q: Array, given: Rows, *, met: bool = False) -> Rows | None:
        """Return the closed posture at a guess, see `place_of` and `headed`.

        Args:
            robot: The robot.
            q: Positions of the spanning tree, shape (nq,).
            given: As from `numbers`; the first row is near the guess.
            met: Whether the guess meets it.
        """
        return self.headed(place_of(robot, self.parts, q, self.chains, given[0][0], met=met), given, met=met)

    def headed(self, place: Rows | None, given: Rows, *, met: bool = False) -> Rows | None:
        """Return a posture whose headings become those of what is given.

        None where an angle is meant in another triple than the upright one, which kernels of a module know.

        Args:
            place: As from `place_of`.
            given: As from `numbers`; the first row is near the posture.
            met: Whether the posture meets it.
        """
        if place is None or not upright_is_meant(self.parts, place[0], given[0][0], met=met):
            return None
        end = given[0].shape[1] - sum(one.given.size for one in self.chains)
        for one in self.chains:
            end += one.given.size
            headings = slice(end - len(one.given.turning), end)
            given[0][:, headings] = place[2][headings]
        return place


#: Nothing is prescribed.
NOTHING_KNOWN = np.zeros(0)


def place_of(
    robot: HybridRobot,
    parts: list[Part],
    guess: Array,
    chains: Sequence[Coupled] = (),
    known: Array = NOTHING_KNOWN,
    *,
    met: bool = False,
) -> Rows | None:
    """Return the closed posture at a guess, see `ClosedRows.close`; None if its loops do not close near it.

    Args:
        parts: Its modules but a free base.
        guess: Positions of the spanning tree, shape (nq,).
        chains: Those of them that poses couple.
        known: What is prescribed, shape (numbers,); `met` as in `Coupled.numbers_at`.
        met: Whether the guess has it.
    """
    q, cut = guess.copy(), []
    for part in parts:
        m, at = part.module.mechanism, part.module.q_index
        x = m.cut.positions(q[None, at])
        if m.closures.rows:
            scale = m.reduction.row_scale
            if not open_by(part, x)[0] <= CLOSED_TO_ROUNDING:
                every = np.ones(m.tree.nv, dtype=bool)
                found = close(LoopProblem(m.closures, scale, m.reduction.col_scale, every), x)
                if not found.residual[0] <= max(robot.closure_tolerance, 1e-12):
                    return None
                x = found.q
                q[at] = spanning_positions(part.module, x, m.tree.sweep(x), q[at])[0]
        cut.append(x)
    p, g = places_at(parts, cut, 1)
    numbers = g[0]
    for one in chains:
        own = known[len(numbers) : len(numbers) + one.given.size]
        numbers = np.concatenate([numbers, one.numbers_at(robot, q[None], own, met=met)[0]])
    return q, p[0], numbers


def starts_of(parts: list[Part], postures: Array) -> tuple[Rows, Array]:
    """Return postures as `ClosedRows.close` starts from them, and which of them are closed, shape (T,).

    Args:
        parts: The modules; poses couple none of them.
        postures: Positions of the spanning tree, shape (T, nq).
    """
    cut = [part.module.mechanism.cut.positions(postures[:, part.module.q_index]) for part in parts]
    closed = np.ones(len(postures), dtype=bool)
    for part, x in zip(parts, cut, strict=True):
        if part.module.mechanism.closures.rows:
            closed &= open_by(part, x) <= CLOSED_TO_ROUNDING
    p, g = places_at(parts, cut, len(postures))
    return (postures, p, g), closed


def open_by(part: Part, x: Array) -> Array:
    """Return by how much a module's loops are open, without units, at postures of its tree after the cuts."""
    m = part.module.mechanism
    out: Array = np.abs(m.closures.residual(x, m.tree.sweep(x)) * m.reduction.row_scale).max(axis=1)
    return out
