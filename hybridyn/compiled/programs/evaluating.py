"""Designs along a table of motions: postures in C for many designs at once, efforts, and what goes wrong."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ...assembly.assemble import assemble_requests
from ...assembly.redundancy import LEAST
from ...assembly.requests import Requests, gather_requests
from ...dynamics.inverse import idm
from ...errors import HybridynError
from ...spatial import Array, Index, Mask
from ..library.artifact import Artifact
from ..library.calls import Calls
from ..library.closed_rows import Rows
from .closing.closing_library import Closing
from .closing.libraries import ClosingLibraries
from .closing.module_parts import posture_of
from .designs import DesignsInSlots

#: Numbers of the states that are computed at once: they stay in the processor's cache.
AT_ONCE = 3_000_000
#: Largest difference of first postures that are one [rad or m].
SAME_FIRST = 1e-9
#: Least number of designs at once: a call of a program costs as much as some hundred of them.
LEAST_DESIGNS = 256


@dataclass(frozen=True, eq=False)
class DesignTable:
    """Motions and efforts of designs along a table.

    Attributes:
        q, v, a: Motion of the spanning tree, shapes (designs, T, nq), (designs, T, nv), (designs, T, nv).
        tau: Motor efforts, shape (designs, T, motors), [N or N m]. Numbers are NaN where there are none.
        errors: The first error of each design that has one, by its number; it names the sample.
        recomputed: Number of designs that the general path has computed.
    """

    q: Array
    v: Array
    a: Array
    tau: Array
    errors: dict[int, str]
    recomputed: int

    @property
    def good(self) -> Mask:
        """Designs that can make the whole motion, shape (designs,)."""
        every = np.ones(len(self.q), dtype=bool)
        every[list(self.errors)] = False
        return every

    @property
    def peak_effort(self) -> Array:
        """Largest absolute effort of each motor, shape (designs, motors); NaN for other designs."""
        out: Array = np.abs(self.tau).max(axis=1, initial=0.0)
        return np.where(self.good[:, None], out, np.nan)


class DesignEvaluator:
    """Evaluates designs of one compiled robot."""

    def __init__(
        self,
        designs: DesignsInSlots,
        inverse: Callable[[], Calls],
        artifact: Artifact,
        threads: int = 1,
    ) -> None:
        """Prepare the evaluation.

        Args:
            designs: The robot's designs.
            inverse: Returns the compiled inverse model: from q, v, a and numbers in slots to efforts.
            artifact: Its library, loaded or not.
            threads: Number of threads that share a batch.
        """
        self.designs, self._inverse, self._threads = designs, inverse, threads
        self._artifact = artifact
        self.libraries = ClosingLibraries(designs.robot, designs.parameters)

    def in_cache(self, requests: Requests) -> bool:
        """Return whether the libraries are in the cache that move designs as requested.

        Raises:
            CompileError: There is no C compiler, or the cache cannot be used.
        """
        closing = self.libraries.artifact(requests)
        return all(one.known() is not None for one in (self._artifact, closing) if one is not None)

    def table(
        self,
        parameters: ArrayLike,
        motors: Mapping[str, object],
        platforms: Mapping[str, object],
        redundancy: str = LEAST,
        *,
        doubtful: bool = True,
    ) -> DesignTable:
        """Evaluate designs, see `CompiledRobot.designs`.

        Args:
            parameters: Numbers of each design, shape (designs, k).
            motors: As in `hybridyn.assemble`.
            platforms: As in `hybridyn.assemble`.
            redundancy: As in `hybridyn.assemble`.
            doubtful: Whether the general path computes the designs of which the C is not certain; if not,
                they have an error.
        """
        robot = self.designs.robot
        p = np.atleast_2d(np.asarray(parameters, dtype=float))
        numbers, refused = self.designs.possible(p)
        requests = gather_requests(robot, motors, platforms, redundancy=redundancy)
        T, D = requests.samples, len(p)
        chunk = max(LEAST_DESIGNS, AT_ONCE // (T * (robot.nq + 2 * robot.nv + numbers.shape[1])))
        widths = (robot.nq, robot.nv, robot.nv, len(robot.motors))
        q, v, a, tau = (np.empty((D, T, width)) for width in widths)
        out = DesignTable(q, v, a, tau, {}, 0)
        asked = self.libraries.asked(requests)
        chunks = [slice(start, start + chunk) for start in range(0, D, chunk)]
        others = [self._chunk(out, at, numbers, requests, asked) for at in chunks]
        left = np.concatenate([np.zeros(0, dtype=int), *others]).tolist()
        for room in (q, v, a, tau):
            room[left] = np.nan
        for design in left:
            if design in refused:
                out.errors[design] = str(refused[design])
            elif doubtful:
                self._by_the_general_path(out, design, numbers[design], requests)
            else:
                out.errors[design] = "not certain"
        return replace(out, recomputed=len(left) - len(refused) if doubtful else 0)

    def _chunk(
        self,
        out: DesignTable,
        at: slice,
        numbers: Array,
        requests: Requests,
        asked: tuple[Closing, Rows] | None,
    ) -> Index:
        """Evaluate some designs; return those that are left to the general path."""
        own, room = numbers[at], (out.q[at], out.v[at], out.a[at])
        if asked is None:
            return np.arange(len(numbers))[at]
        (closing, given), T = asked, out.q.shape[1]
        start = closing.at_home(self.designs.robot, given)
        if start is None:
            return np.arange(len(numbers))[at]
        close = partial(closing.rows.close, own, given=given, out=room, threads=self._threads)
        if any(one.left for one in closing.chains):
            first = self._first_postures(closing, requests.part(0, 1), own, given[0][0])
            closed = close(start=first, guess=False, strict=True) == T
            closed &= (np.abs(room[0][:, 0] - first[0]) <= SAME_FIRST).all(axis=1)
        else:  # chains have no walk that finds the branch of the guess
            closed = close(start=start, strict=bool(closing.chains)) == T
        states = [x.reshape(T * len(own), -1) for x in room]
        inverse, model_inputs = self._inverse(), [*states, np.repeat(own, T, axis=0)]
        (tau,), guard = inverse.batch(
            model_inputs[: len(inverse.inputs)], self._threads
        )  # perhaps without slots
        out.tau[at] = tau.reshape(len(own), T, -1)
        trusted = (guard <= inverse.trusted).reshape(len(own), T).all(axis=1)
        left: Index = np.flatnonzero(~(closed & trusted)) + at.start
        return left

    def _first_postures(self, closing: Closing, requests: Requests, numbers: Array, given: Array) -> Rows:
        """Return the first posture of each design, by the general path, as `ClosedRows.close` takes it.

        Which one it is depends on the whole way from home, where freedoms are left. It is NaN for designs
        that have none, or whose lengths are the units of other measures: they are powers of two.

        Args:
            closing: The library.
            requests: Those of the first row.
            numbers: Numbers in the slots, shape (designs, slots).
            given: What is prescribed in the first row, shape (numbers,).
        """
        robot, chosen = self.designs.robot, [k for one in closing.chains for k in one.numbers]
        at = [robot.modules.index(part.module) for part in closing.parts]
        platforms = sum(part.platforms for part in closing.parts)
        q, p = (np.full((len(numbers), n), np.nan) for n in (robot.nq, platforms))
        for i, design in enumerate(numbers):
            with contextlib.suppress(HybridynError):
                own = self.designs.robot_of(design)
                if all(own.modules[k].mechanism.length == robot.modules[k].mechanism.length for k in chosen):
                    parts = [
                        replace(x, module=own.modules[k]) for x, k in zip(closing.parts, at, strict=True)
                    ]
                    found = assemble_requests(own, requests, own.home)[0][0]
                    q[i], p[i], _ = posture_of(parts, found)
        return q, p, np.tile(given, (len(numbers), 1))

    def _by_the_general_path(self, out: DesignTable, k: int, numbers: Array, requests: Requests) -> None:
        """Evaluate one design by the general path."""
        try:
            robot = self.designs.robot_of(numbers)
            out.q[k], out.v[k], out.a[k] = assemble_requests(robot, requests, robot.home)
            effects = self.designs.effects_of(robot)
            out.tau[k] = idm(robot, out.q[k], out.v[k], out.a[k], effects=effects)
        except HybridynError as error:
            out.errors[k] = str(error)
