"""Builder of a program: collects kernels and calls, and allocates numbers."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from typing import Any, TypeVar, cast

import casadi as ca
import numpy as np

from ...spatial import Array, Index
from ..equations.expressions import pack
from ..program import (
    Add,
    Call,
    Constants,
    Each,
    GivenPlace,
    Kernel,
    Own,
    Program,
    ResultPlace,
    Shared,
    Source,
    Start,
    Target,
    Worst,
    stored,
)

Made = TypeVar("Made")


class Writer:
    """A program under construction.

    Attributes:
        given: Start of each user input.
        results: Start of each user output.
        computed: User outputs that an earlier model computes, where a later one reads them as its inputs.
        kernels: The kernels so far.
        steps: The steps so far.
        handed: Places of the numbers that stages of a module pass on.
    """

    def __init__(
        self,
        name: str,
        inputs: list[tuple[str, int]],
        outputs: list[tuple[str, int]],
        computed: tuple[str, ...] = (),
    ) -> None:
        self.name, self.inputs, self.outputs = name, tuple(inputs), tuple(outputs)
        self.given, self.results = ({name: at for name, _, at in stored(x)} for x in (inputs, outputs))
        self.computed = computed
        self.kernels: list[Kernel] = []
        self.steps: list[Start | Call] = []
        self.handed: set[Shared | Own] = set()
        self._number: dict[Any, int] = {}
        self._made: dict[Any, Any] = {}
        self._shared = self._own = 0

    def numbers(self, values: Array, parameters: ca.SX | None) -> Source:
        """Return the source of the copies' numbers, shape (copies, entries).

        Args:
            values: The numbers; those that are arguments are expressions of `parameters`.
            parameters: Symbols of the input "parameters", or None.
        """
        if values.dtype != object or parameters is None:
            return Constants(values)
        place = self.each(*values.shape)
        function = ca.Function("numbers", [parameters], [pack(values)])
        kernel = self.kernel(("numbers", place.start), function, "parameters")
        source = self.from_given("parameters", np.arange(parameters.numel()))
        self.call(kernel, 1, [source], [Shared(place.start, values.size)])
        return place

    def once(self, key: Any, make: Callable[..., Made], *given: Any, **more: Any) -> Made:
        """Return what is made of some arguments; equal keys share it."""
        if key not in self._made:
            self._made[key] = make(*given, **more)
        return cast("Made", self._made[key])

    def kernel(self, key: Any, function: ca.Function | Callable[[], ca.Function], part: str) -> int:
        """Return the index of a kernel; equal keys share one kernel, which the first one makes."""
        if key not in self._number:
            if not isinstance(function, ca.Function):
                function = function()
            self._number[key] = len(self.kernels)
            self.kernels.append(Kernel(f"{self.name}_{len(self.kernels)}", function, part))
        return self._number[key]

    def shared(self, size: int) -> Shared:
        """Allocate shared numbers."""
        self._shared += size
        return Shared(self._shared - size, size)

    def each(self, copies: int, size: int) -> Each:
        """Allocate shared numbers for each copy."""
        return Each(self.shared(copies * size).start, size)

    def own(self, copies: int, size: int) -> Own:
        """Allocate the copies' own numbers."""
        self._own += copies * size
        return Own(self._own - copies * size, size)

    def start(self, place: Shared, values: Array) -> Add:
        """Set shared numbers to the start of a sum and return the target that adds to them."""
        self.steps.append(Start(place.start, np.asarray(values, dtype=float)))
        return Add(place.start, place.size)

    def hand(self, copies: int, size: int) -> Shared | Own:
        """Allocate numbers that a stage passes on: shared for a single copy, the copies' own for several."""
        place = self.shared(size) if copies == 1 else self.own(copies, size)
        self.handed.add(place)
        return place

    def from_given(self, name: str, index: Index) -> GivenPlace | ResultPlace:
        """Return the source of entries of a user input, shape (entries,) or (copies, entries)."""
        if name in self.computed:
            return self.result(name, index)
        return GivenPlace(np.atleast_2d(index).astype(int) + self.given[name])

    def result(self, name: str, index: Index) -> ResultPlace:
        """Return the place of entries of a user output, shape (entries,) or (copies, entries)."""
        return ResultPlace(np.atleast_2d(index).astype(int) + self.results[name])

    def call(self, kernel: int, copies: int, sources: Sequence[Source], targets: list[Target]) -> None:
        """Add the call of a kernel."""
        self.steps.append(Call(kernel, copies, tuple(sources), tuple(targets)))

    def calls_from(self, step: int) -> list[Call]:
        """Return the calls among the steps from a number on."""
        return [call for call in self.steps[step:] if isinstance(call, Call)]

    def program(self) -> Program:
        """Return the program."""
        return Program(
            self.name,
            self.inputs,
            self.outputs,
            tuple(self.kernels),
            tuple(self.steps),
            self._shared,
            self._own,
        )


def alike(numbers: Iterable[int], key: Callable[[int], Hashable]) -> dict[Any, list[int]]:
    """Return the numbers with the same key, by the key."""
    out: dict[Any, list[int]] = {}
    for k in numbers:
        out.setdefault(key(k), []).append(k)
    return out


class ModuleWriter(Writer):
    """Writes a program that closes loops: each of its kernels has modules of one shape as copies.

    Attributes:
        parameters: Symbols of numbers that are arguments, or None.
    """

    def __init__(
        self,
        name: str,
        inputs: Mapping[str, str],
        outputs: Mapping[str, str],
        kinds: Mapping[str, tuple[int, Sequence[Index]]],
        parameters: ca.SX | None = None,
    ) -> None:
        """Begin a program.

        Args:
            inputs: Kind of each input by its name.
            outputs: Kind of each output by its name.
            kinds: Number of entries of each kind, and those of each module.
            parameters: Symbols of numbers that are arguments, the last input of the program, or None.
        """
        self.parameters, self._read, self._written = parameters, list(inputs), list(outputs)
        self._places = {name: kinds[kind][1] for name, kind in {**inputs, **outputs}.items()}
        given, results = ([(name, kinds[kind][0]) for name, kind in of.items()] for of in (inputs, outputs))
        last = [] if parameters is None else [("parameters", parameters.numel())]
        super().__init__(name, [*given, *last], results)

    def places(self, name: str, numbers: Sequence[int]) -> Index:
        """Return where the numbers of an input or an output are, those of each module, shape (modules, n)."""
        own = self._places[name]
        return np.array([own[k] for k in numbers], dtype=int).reshape(len(numbers), -1)

    def add(
        self,
        key: Any,
        numbers: Sequence[int],
        kernel: tuple[ca.Function, Array],
        *read: str,
        written: Sequence[str] = (),
    ) -> None:
        """Add the call of the kernel of some modules; outputs beyond those of the program are guards.

        Args:
            kernel: The function, and the table of numbers in which the modules differ.
            read: Names of its inputs, by default all of the program.
            written: Names of its outputs, by default all of the program.
        """
        (function, table), copies = kernel, len(numbers)
        sources: list[Source] = [self.from_given(x, self.places(x, numbers)) for x in read or self._read]
        sources.append(self.numbers(table, self.parameters))
        targets: list[Target] = [self.result(x, self.places(x, numbers)) for x in written or self._written]
        targets += [Worst()] * (function.n_out() - len(targets))
        self.call(self.kernel(key, function, "closures"), copies, sources, targets)

    def keep(self, **kept: tuple[str, Index]) -> None:
        """Copy entries of inputs: for each output the name of the input, "" for zeros, and the entries."""
        given = {name: ca.SX.sym(name, len(index)) for _, (name, index) in kept.items() if name}
        results = [given.get(name, ca.SX.zeros(len(index), 1)) for name, index in kept.values()]
        kernel = self.kernel("kept", ca.Function("kept", [*given.values()], results), "closures")
        sources: list[Source] = [self.from_given(name, index) for name, index in kept.values() if name]
        self.call(kernel, 1, sources, [self.result(name, index) for name, (_, index) in kept.items()])
