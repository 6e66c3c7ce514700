"""Representation of a compiled model: kernels of straight-line arithmetic and the order of their calls.

A `Program` maps one sample's inputs to its outputs. It is a list of calls of kernels. Each kernel is a CasADi
function of scalars. A kernel of legs is called once for several equal legs ("copies"), which share the code
and differ in their numbers. The code generator spreads samples or copies over the lanes of a vector unit:

    batch    each lane holds a sample; copies are called one after the other
    single   each lane holds a copy; numbers that the copies share are the same in all lanes

Both ways run the same machine code, so a sample's result has the same bits in both.

Numbers are stored in four places:

    given    user inputs, one after the other (`Program.inputs`): read only
    result   user outputs (`Program.outputs`): written once, readable afterwards
    shared   one number per sample, `Program.shared` of them
    own      one number per sample and copy, `Program.own` of them: intermediate results of the legs
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import TYPE_CHECKING, ClassVar

import numpy as np

if TYPE_CHECKING:
    import casadi as ca

    from ..spatial import Array, Index
    from .code.c_tables import Tables


@dataclass(frozen=True)
class Kernel:
    """A function of scalars.

    Attributes:
        name: A C identifier, unique in the program.
        function: CasADi SX function; every input and output is a dense column (of any length, also 0).
        part: Its heading in operation counts: "kinematics", "legs", "module", "acceleration", ...
    """

    name: str
    function: ca.Function
    part: str


class MemoryPlace:
    """Numbers that a call reads or writes.

    Attributes:
        memory: Where they are stored; empty for constants and the guard.
        adds: Whether outputs are added to them.
    """

    memory: ClassVar[str] = ""
    adds: ClassVar[bool] = False

    @property
    def handed(self) -> bool:
        """Whether a kernel may read and write them directly, one after the other."""
        return bool(self.memory)

    def at(self, copies: int) -> Index:
        """Return where the numbers of each copy are, shape (copies, numbers)."""
        raise NotImplementedError

    def numbers(self, copy: int) -> list[tuple[str, int]]:
        """Return the memory and the place of each number of one copy; none for constants and the guard."""
        return [(self.memory, k) for k in self.at(copy + 1)[copy].tolist()] if self.memory else []

    def span(self, copies: int) -> tuple[str, int, int]:
        """Return the memory, start and end of the range that the numbers of some copies cover."""
        at = self.at(copies)
        return (self.memory, int(at.min()), int(at.max()) + 1) if self.memory and at.size else ("", 0, 0)

    def begin(self, copies: int, tables: Tables) -> str:
        """Return the C expression of the place of the first number of copy i, for `handed` places."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False)
class _Listed(MemoryPlace):
    """Numbers anywhere in a memory: `index[i, k]` is the place of entry k for copy i."""

    index: Index

    @property
    def handed(self) -> bool:
        """Whether the numbers of each copy are one after the other."""
        return bool((np.diff(self.index, axis=1) == 1).all())

    def at(self, copies: int) -> Index:
        """Return where the numbers of each copy are."""
        return self.index

    def begin(self, copies: int, tables: Tables) -> str:
        """Return the place of the first number of copy i: a number, or an entry of a table."""
        first = self.index[:, 0] if self.index.shape[1] else np.zeros(len(self.index), dtype=int)
        return str(int(first[0])) if copies == 1 else f"{tables.places(first)}[i]"


class GivenPlace(_Listed):
    """Read user inputs."""

    memory = "given"


class ResultPlace(_Listed):
    """Read or write user outputs."""

    memory = "result"


class SharedPlace(_Listed):
    """Read shared numbers; programs that do so are not compacted."""

    memory = "shared"


@dataclass(frozen=True, eq=False)
class Constants(MemoryPlace):
    """Read constants: `values[i, k]` is entry k for copy i."""

    values: Array

    def at(self, copies: int) -> Index:
        """Return the numbers of the constants, counted copy by copy."""
        return np.arange(self.values.size).reshape(self.values.shape)


@dataclass(frozen=True)
class _Block(MemoryPlace):
    """`size` numbers of a memory from `start` on; of all copies, or of each from start + i * size on."""

    start: int
    size: int
    apart: ClassVar[bool] = False

    def at(self, copies: int) -> Index:
        """Return where the numbers of each copy are."""
        first = self.start + np.arange(copies) * self.size * self.apart
        return np.asarray(first[:, None] + np.arange(self.size))

    def begin(self, copies: int, tables: Tables) -> str:
        """Return the place of the first number of copy i."""
        return f"{self.start} + i * {self.size}" if self.apart and copies > 1 else str(self.start)


class Shared(_Block):
    """Read or write shared numbers, the same for every copy."""

    memory = "shared"


class Each(_Block):
    """Write or read shared numbers, those of copy i from start + i * size on."""

    memory, apart = "shared", True

    def part(self, first: int) -> Each:
        """Return the numbers of the copies from a number on."""
        return Each(self.start + first * self.size, self.size)


class Own(_Block):
    """Read or write the copies' own numbers, those of copy i from start + i * size of `own` on."""

    memory, apart = "own", True


class Add(_Block):
    """Add the outputs of all copies, in their order, to shared numbers."""

    memory, adds = "shared", True


@dataclass(frozen=True)
class Worst(MemoryPlace):
    """Keep the largest output of all copies and calls as the sample's guard; NaN counts as largest."""

    def at(self, copies: int) -> Index:
        """Return the one number of each copy."""
        return np.zeros((copies, 1), dtype=int)


Source = GivenPlace | SharedPlace | Constants | ResultPlace | Shared | Each | Own
Target = ResultPlace | Shared | Each | Own | Add | Worst


@dataclass(frozen=True)
class Call:
    """One call of a kernel.

    Attributes:
        kernel: Index of the kernel.
        copies: Number of copies, at least 1.
        sources: Sources of its inputs, in order.
        targets: Targets of its outputs, in order.
    """

    kernel: int
    copies: int
    sources: tuple[Source, ...]
    targets: tuple[Target, ...]


@dataclass(frozen=True, eq=False)
class Start:
    """Set shared numbers from `start` on, before the calls that add to them."""

    start: int
    values: Array


@dataclass(frozen=True)
class Program:
    """A compiled model.

    Attributes:
        name: A C identifier: "idm", "ddm", "kinematics".
        inputs: Name and length of each user input, in the order of `given` (q, v, a or tau, ...).
        outputs: Name and length of each user output, in the order of `result`.
        steps: Starts and calls, in order.
        shared: Number of shared numbers.
        own: Number of the copies' own numbers.

    The sample's guard (`Worst`) is at most 1 where the model can be trusted. The general path computes
    samples whose guard is above 1 or NaN.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    kernels: tuple[Kernel, ...]
    steps: tuple[Start | Call, ...]
    shared: int
    own: int

    @property
    def sizes(self) -> tuple[int, int, int, int]:
        """The numbers of given, result, shared and own."""
        given, result = (sum(size for _, size in ends) for ends in (self.inputs, self.outputs))
        return given, result, self.shared, self.own


def stored(parts: Sequence[tuple[str, int]]) -> list[tuple[str, int, int]]:
    """Return name, length and start of parts that are stored one after the other."""
    starts = accumulate((size for _, size in parts), initial=0)
    return [(name, size, at) for (name, size), at in zip(parts, starts, strict=False)]
