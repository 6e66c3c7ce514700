"""Rows of a table closed in C, with the general path for uncertain rows: for compiled models and commands."""

from __future__ import annotations

from functools import partial

import numpy as np

from ....assembly.assemble import assemble_requests, place_base
from ....assembly.requests import Requests, in_root
from ....errors import HybridynError
from ....logs import held_warnings, inform
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...library.closed_rows import ClosedRows, Rows
from ..sources import kept
from .closing_library import place_of
from .libraries import ClosingLibraries
from .own_requests import structure_of

#: Rows that the general path computes where one is not certain; twice as many each time it follows at once.
AT_ONCE = 8
#: Relative difference below which two postures are one.
SAME_LEAD = 1e-9


class Assembler:
    """Assembles one robot in C.

    Attributes:
        recomputed: Number of samples that the general path has computed so far.
    """

    def __init__(self, robot: HybridRobot) -> None:
        """Start without any library: each is built when requests need it."""
        self.robot, self.recomputed, self._libraries = robot, 0, ClosingLibraries(robot)
        self._home: dict[tuple[object, ...], Rows | None] = {}

    def follow_motors(self, requests: Requests, q: Array) -> ClosedRows | None:
        """Return the library that closes a row from motors after a posture, see `ClosedRows.from_motors`.

        Args:
            requests: The requests for the posture, which has been assembled: positions of all motors.
            q: The posture, shape (nq,).
        """
        closing = self._libraries.known(requests)
        place = None if closing is None or closing.chains else place_of(self.robot, closing.parts, q)
        if closing is None or place is None:
            return None
        closing.rows.keep(place)
        return closing.rows

    def assemble(self, requests: Requests, guess: Array) -> Rows:
        """Compute the postures of `assembly.assemble_requests`, with its results, errors and warnings."""
        requests = in_root(self.robot, requests, guess)
        found = self._in_c(requests, guess)
        if found is None:
            self.recomputed += requests.samples
            return assemble_requests(self.robot, requests, guess)
        place_base(self.robot, requests, *found)
        return found

    def _in_c(self, requests: Requests, guess: Array) -> Rows | None:
        """Compute the postures; None if the general path must compute all of them."""
        asked = self._libraries.asked(requests)
        if asked is None:
            return None
        closing, given = asked
        if not requests.samples:
            return np.empty((0, self.robot.nq)), *np.empty((2, 0, self.robot.nv))
        find = partial(place_of, self.robot, closing.parts, guess)
        if closing.chains or not np.array_equal(guess, self.robot.home):
            place = closing.place(self.robot, guess, given)
        else:
            place = closing.headed(kept(self._home, structure_of(requests), find), given)
        T, done, at_once = requests.samples, 0, AT_ONCE
        for left in (one.left for one in closing.chains if one.left):
            inform(str(left), log="hybridyn.assembly")
        out = np.empty((T, self.robot.nq)), np.empty((T, self.robot.nv)), np.empty((T, self.robot.nv))
        while place is not None and done < T:
            rest, room = [x[done:] for x in given], [x[None, done:] for x in out]
            count = int(
                closing.rows.close(np.zeros((1, 0)), place, rest, room, guess=not done, strict=True)[0]
            )
            done += count
            if done < T:
                at_once = AT_ONCE if count >= at_once else 2 * at_once
                start, done = done, min(T, done + at_once)
                if not self._by_the_general_path(requests, guess, out, slice(start, done)):
                    return None
                g, g_dot, g_ddot = (x[done - 1 :] for x in given)
                near = closing.place(self.robot, out[0][done - 1], (g, g_dot, g_ddot), met=True)
                place = None if near is None else (*near[:2], given[0][done - 1])
        return out if done == T else None

    def _by_the_general_path(self, requests: Requests, guess: Array, out: Rows, at: slice) -> bool:
        """Compute some rows by the general path, from the last one before them.

        Returns:
            Whether they are those that it finds in the whole table; errors and warnings name its samples.
        """
        lead = min(at.start, 1)
        guess = out[0][at.start - 1] if lead else guess
        try:
            with held_warnings() as warned:
                rows = assemble_requests(self.robot, requests.part(at.start - lead, at.stop), guess)
        except HybridynError:
            return False
        scale = 1.0 + np.abs(guess).max(initial=0.0)
        base = 7 if self.robot.base != "fixed" else 0
        off = np.abs(rows[0][0, base:] - guess[base:]).max(initial=0.0)
        for whole, own in zip(out, rows, strict=True):
            whole[at] = own[lead:]
        self.recomputed += at.stop - at.start
        return not warned and (not lead or bool(off <= SAME_LEAD * scale))
