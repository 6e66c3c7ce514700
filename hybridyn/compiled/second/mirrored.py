"""A program under construction beside which the changes of its numbers along a direction are computed."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import TypeVar, cast

import casadi as ca
import numpy as np

from ..program import (
    Call,
    Constants,
    GivenPlace,
    MemoryPlace,
    Program,
    ResultPlace,
    Shared,
    SharedPlace,
    Source,
    Worst,
)
from ..programs.writer import Writer

Place = TypeVar("Place", bound=MemoryPlace)
#: Rates of inputs and outputs in a program.
ORDERS = ("_dot", "_ddot")


class Mirrored(Writer):
    """A program with the numbers of another one, and copies of them for their changes.

    Inputs and outputs keep their places, and are first. The changes of inputs are inputs, those of outputs
    are outputs, and those of other numbers stand behind these.
    """

    def __init__(
        self,
        program: Program,
        name: str,
        orders: int,
        moving: Collection[str],
        zero: Collection[str] = (),
        inputs: Sequence[tuple[str, int]] = (),
        outputs: Sequence[tuple[str, int]] = (),
        read: Collection[int] | None = None,
    ) -> None:
        """Begin with a program.

        Args:
            program: The program.
            name: Name of the new one.
            orders: Number of copies.
            moving: Inputs that change.
            zero: Inputs that are zero themselves: they are none of the new program.
            inputs: Further inputs, last.
            outputs: Further outputs, last.
            read: Results whose outputs have changes; None for all.
        """
        self._input = [(x, k) for x, size in program.inputs for k in range(size)]
        self._output = [(x, k) for x, size in program.outputs for k in range(size)]
        own = [(x, size) for x, size in program.inputs if x not in zero]
        changes = [(f"{x}{o}", size) for o in ORDERS[:orders] for x, size in program.inputs if x in moving]
        changing = {x for k, (x, _) in enumerate(self._output) if read is not None and k in read}
        changed = [(x, size) for x, size in program.outputs if read is None or x in changing]
        results = [*program.outputs, *((f"{x}{o}", size) for o in ORDERS[:orders] for x, size in changed)]
        super().__init__(name, [*own, *changes, *inputs], [*results, *outputs])
        self._of, self._zero = program, set(zero)
        self._shared, self._own = (orders + 1) * program.shared, (orders + 1) * program.own

    def at(self, end: Place, order: int = 0) -> Place:
        """Return the place of a source's or target's numbers, or of their changes of an order."""
        found: MemoryPlace = end
        if isinstance(end, GivenPlace):
            found = self._given(end, order)
        elif isinstance(end, ResultPlace):
            places = [self._output[k] for k in end.index.ravel().tolist()]
            index = [self.results[x + ("", *ORDERS)[order]] + k for x, k in places]
            found = ResultPlace(np.array(index, dtype=int).reshape(end.index.shape))
        elif isinstance(end, Constants):
            found = end if order == 0 else Constants(np.zeros(end.values.shape))
        elif not isinstance(end, Worst):
            found = self.shifted(end, order * (self._of.shared if end.memory == "shared" else self._of.own))
        return cast("Place", found)

    def shifted(self, end: Place, by: int) -> Place:
        """Return numbers of the program's memory further behind."""
        if isinstance(end, SharedPlace):
            return cast("Place", SharedPlace(end.index + by))
        return replace(end, start=end.start + by)  # type: ignore[type-var, attr-defined]

    def _given(self, end: GivenPlace, order: int) -> Source:
        """Return where a program's inputs, or their changes, are read; a source reads of one input."""
        which = [self._input[k] for k in end.index.ravel().tolist()]
        name = which[0][0] + ("", *ORDERS)[order] if which else ""
        if name not in self.given:
            return Constants(np.zeros(end.index.shape))
        return self.from_given(name, np.array([k for _, k in which]).reshape(end.index.shape))

    def zeros(self, call: Call) -> tuple[int, ...]:
        """Return the sources of a call that are zero."""
        ends = [end.index.ravel().tolist() if isinstance(end, GivenPlace) else [] for end in call.sources]
        return tuple(n for n, at in enumerate(ends) if at and self._input[at[0]][0] in self._zero)

    def as_it_is(self, call: Call) -> None:
        """Add a call whose numbers do not change."""
        kernel = self._of.kernels[call.kernel]
        at = self.kernel(("as it is", call.kernel), kernel.function, kernel.part)
        self.call(at, call.copies, [self.at(x) for x in call.sources], [self.at(x) for x in call.targets])

    def rest(self, order: int) -> None:
        """Set all changes of an order to zero: those of numbers that do not change are not computed."""
        size = self._of.shared
        if size:
            self.start(Shared(order * size, size), np.zeros(size))
        starts = {x: self.results.get(x + ORDERS[order - 1]) for x, _ in self._of.outputs}
        found = [(starts[x], k) for x, k in self._output]
        index = np.array([at + k for at, k in found if at is not None], dtype=int)
        if len(index):
            zeros = ca.Function("rest", [], [ca.SX.zeros(len(index))])
            self.call(self.kernel(("rest", len(index)), zeros, "rest"), 1, [], [ResultPlace(index[None])])
