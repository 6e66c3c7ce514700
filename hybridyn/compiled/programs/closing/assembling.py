"""Rows of a table closed in C, with the general path for uncertain rows: for compiled models and commands."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ....assembly.assemble import assemble_requests, place_base
from ....assembly.requests import Requests
from ....errors import HybridynError
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...code.scalars import Scalar
from ...library.building import best_lanes
from ...library.cache import Built
from ...library.closed_rows import ClosedRows, Place
from ..sources import Artifact, kept, robot_key
from .checking import check_rows, from_place, place_of
from .choosing import Closing, lanes_for, module_requests, numbers, parts_of, structure_of

if TYPE_CHECKING:
    from ....assembly.module_request import ModuleRequest
    from ...code.library_source import Source


#: Rows that the general path computes where one is not certain; twice as many each time it follows at once.
AT_ONCE = 8
#: Relative difference below which two postures are one.
SAME_LEAD = 1e-9

Rows = tuple[Array, Array, Array]


class Assembler:
    """Assembles one robot in C.

    Attributes:
        recomputed: Number of samples that the general path has computed so far.
    """

    def __init__(self, robot: HybridRobot) -> None:
        """Start without any program: each is written when requests need it."""
        self.robot, self.recomputed = robot, 0
        self._known: dict[tuple[object, ...], Closing[ClosedRows] | None] = {}
        self._home: dict[tuple[object, ...], Place | None] = {}

    def follow_motors(self, requests: Requests, q: Array) -> ClosedRows | None:
        """Return the program that closes a row from motors after a posture, see `ClosedRows.from_motors`.

        Args:
            requests: The requests for the posture, which has been assembled: positions of all motors.
            q: The posture, shape (nq,).
        """
        closing = self._known.get(structure_of(requests))
        place = None if closing is None else place_of(self.robot, closing.parts, q)
        if closing is None or place is None:
            return None
        closing.rows.keep(place)
        return closing.rows

    def assemble(self, requests: Requests, guess: Array) -> Rows:
        """Compute the postures of `assembly.assemble_requests`, with its results, errors and warnings."""
        try:
            found = self._in_c(requests, guess)
        except _UncertainError:
            found = None
        if found is None:
            self.recomputed += requests.samples
            return assemble_requests(self.robot, requests, guess)
        place_base(self.robot, requests, *found)
        return found

    def _in_c(self, requests: Requests, guess: Array) -> Rows | None:
        """Compute the postures; None if the general path must compute all of them."""
        try:
            wanted = module_requests(self.robot, requests)
            key = structure_of(requests)
            closing = None
            if wanted is not None:
                closing = kept(self._known, key, partial(self._closing, wanted, key))
        except HybridynError:  # the general path says it, after the errors of the modules before
            return None
        place = None if closing is None else self._start(closing, key, guess)
        if wanted is None or closing is None or place is None:
            return None
        given = numbers(closing.parts, wanted)
        return _Table(self, closing, requests, given, guess).close(place)

    def _closing(self, wanted: list[ModuleRequest], key: tuple[object, ...]) -> Closing[ClosedRows] | None:
        """Load the program for some requests; build it if it is new."""
        parts, lanes = parts_of(self.robot, wanted), best_lanes()
        alone = getattr(sys, "_is_gil_enabled", lambda: True)()  # rows share one workspace
        if parts is None or lanes == 1 or not alone:
            return None
        scalar, robot = Scalar("float64", min(lanes, lanes_for(parts))), self.robot

        def write() -> Source:
            """Generate the C source."""
            from .closing_source import closing_source

            return closing_source(robot, parts, scalar)

        def check(built: Built) -> None:
            """Compare a new library with the general path."""
            check_rows(from_place(ClosedRows(built), robot, parts), robot, parts)

        name = f"closing {key!r} {robot_key(robot, None)} {scalar!r}"
        otherwise = "assemble: the general path closes the loops"
        rows = Artifact(robot, name, write, check).tried(ClosedRows, otherwise)
        return None if rows is None else Closing(parts, rows)

    def _start(self, closing: Closing[ClosedRows], key: tuple[object, ...], guess: Array) -> Place | None:
        """Return the closed posture at a guess; that of the home posture is kept."""
        if not np.array_equal(guess, self.robot.home):
            return place_of(self.robot, closing.parts, guess)
        home = kept(self._home, key, partial(place_of, self.robot, closing.parts, guess))
        return None if home is None else Place(home.q.copy(), home.p.copy(), home.g.copy())


class _UncertainError(Exception):
    """The general path must compute the whole table."""


class _Table:
    """One table of rows."""

    def __init__(
        self,
        assembler: Assembler,
        closing: Closing[ClosedRows],
        requests: Requests,
        given: Rows,
        guess: Array,
    ) -> None:
        self.assembler, self.closing, self.requests = assembler, closing, requests
        self.given, self.guess = given, guess
        T, robot = requests.samples, assembler.robot
        self.out = np.empty((T, robot.nq)), np.empty((T, robot.nv)), np.empty((T, robot.nv))

    def close(self, place: Place) -> Rows:
        """Compute all rows."""
        T, done, at_once = self.requests.samples, 0, AT_ONCE
        while True:
            rest = tuple(x[done:] for x in self.given)
            room = tuple(x[done:] for x in self.out)
            count = self.closing.rows.follow(place, rest, room, done == 0)  # type: ignore[arg-type]
            done += count
            if done == T:
                return self.out
            at_once = AT_ONCE if count >= at_once else 2 * at_once
            stop = min(T, done + at_once)
            self._by_the_general_path(done, stop)
            done = stop
            if done == T:
                return self.out
            next_place = place_of(self.assembler.robot, self.closing.parts, self.out[0][done - 1])
            if next_place is None:
                raise _UncertainError
            place = Place(next_place.q, next_place.p, self.given[0][done - 1].copy())

    def _by_the_general_path(self, start: int, stop: int) -> None:
        """Compute some rows by the general path, from the last one before them."""
        lead = 1 if start else 0
        guess = self.out[0][start - 1] if lead else self.guess
        requests = self.requests.part(start - lead, stop)
        try:
            with _unwarned() as warned:
                rows = assemble_requests(self.assembler.robot, requests, guess)
        except HybridynError as error:  # its sample numbers are those of the whole table only there
            raise _UncertainError from error
        scale = 1.0 + np.abs(guess).max(initial=0.0)
        base = 7 if self.assembler.robot.base != "fixed" else 0
        off = np.abs(rows[0][0, base:] - guess[base:]).max(initial=0.0)
        if warned or (lead and not off <= SAME_LEAD * scale):
            raise _UncertainError
        for whole, own in zip(self.out, rows, strict=True):
            whole[start:stop] = own[lead:]
        self.assembler.recomputed += stop - start


@contextmanager
def _unwarned() -> Iterator[list[logging.LogRecord]]:
    """Hold back the package's warnings, whose counts would be those of some rows only, and yield them."""
    held: list[logging.LogRecord] = []

    def hold(record: logging.LogRecord) -> bool:
        """Keep a record, and drop it from the log."""
        held.append(record)
        return False

    logger = logging.getLogger("hybridyn")
    logger.addFilter(hold)
    try:
        yield held
    finally:
        logger.removeFilter(hold)
