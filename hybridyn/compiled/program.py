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

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import casadi as ca

    from ..spatial import Array, Index


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


@dataclass(frozen=True, eq=False)
class Given:
    """Read user inputs: `index[i, k]` is the position in `given` of entry k for copy i."""

    index: Index


@dataclass(frozen=True, eq=False)
class Constants:
    """Read constants: `values[i, k]` is entry k for copy i."""

    values: Array


@dataclass(frozen=True, eq=False)
class Result:
    """Read or write user outputs: `index[i, k]` is the position in `result` of entry k for copy i."""

    index: Index


@dataclass(frozen=True)
class Shared:
    """Read or write `size` shared numbers from `start` on, the same for every copy."""

    start: int
    size: int


@dataclass(frozen=True)
class Each:
    """Write or read shared numbers, those of copy i from start + i * size on."""

    start: int
    size: int


@dataclass(frozen=True)
class Own:
    """Read or write the copies' own numbers, those of copy i from start + i * size of `own` on."""

    start: int
    size: int


@dataclass(frozen=True)
class Turned:
    """Read own numbers by columns: copy i reads entry `first` + i of `rows` copies' `size` numbers each."""

    start: int
    size: int
    rows: int
    first: int = 0

    def index(self, copy: int) -> Index:
        """Return where the numbers of a copy are, as for one copy after the other, shape (rows,)."""
        return self.start + self.first + copy + np.arange(self.rows) * self.size


@dataclass(frozen=True)
class Add:
    """Add the outputs of all copies, in their order, to shared numbers from `start` on."""

    start: int
    size: int


@dataclass(frozen=True)
class Worst:
    """Keep the largest output of all copies and calls as the sample's guard; NaN counts as largest."""


Source = Given | Constants | Result | Shared | Each | Own | Turned
Target = Result | Shared | Each | Own | Add | Worst


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
    notes: tuple[str, ...] = field(default=())
