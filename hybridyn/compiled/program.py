"""What a written-out model consists of: kernels of straight-line arithmetic, and the order of their calls.

A `Program` turns one sample's inputs into its outputs. It is a list of calls of kernels, each a CasADi
function of scalars. A kernel of legs is called once for several equal legs ("copies"): their own numbers
differ, the code does not. How copies and samples are spread over the lanes of a vector unit is the printer's
business:

    batch    every lane is a sample; copies are called one after the other
    single   every lane is a copy; what is not a copy's own is the same in all lanes

so both run the same machine code, and a sample's result has the same bits in both.

Numbers live in four places:

    given    the user's inputs, one after the other (`Program.inputs`): read only
    result   the user's outputs (`Program.outputs`): written once, and readable afterwards
    shared   one number per sample, `Program.shared` of them
    own      one number per sample and copy, `Program.own` of them: what legs leave for a later kernel
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import casadi as ca

    from ..spatial import Array, Index


@dataclass(frozen=True)
class Kernel:
    """A function of scalars.

    Attributes:
        name: A C identifier, unique in the program.
        function: CasADi SX function; every input and output is a dense column (of any length, also 0).
        part: What it is for, in operation counts: "kinematics", "legs", "module", "acceleration", ...
    """

    name: str
    function: ca.Function
    part: str


@dataclass(frozen=True)
class Given:
    """Reads user inputs: `index[i, k]` is the number in `given` of entry k for copy i."""

    index: Index


@dataclass(frozen=True)
class Constants:
    """Reads constants: `values[i, k]` for copy i."""

    values: Array


@dataclass(frozen=True)
class Result:
    """Reads or writes user outputs: `index[i, k]` is the number in `result` of entry k for copy i."""

    index: Index


@dataclass(frozen=True)
class Shared:
    """Reads or writes `size` shared numbers from `start` on, the same for every copy."""

    start: int
    size: int


@dataclass(frozen=True)
class Each:
    """Writes or reads shared numbers, copy i at start + i * size."""

    start: int
    size: int


@dataclass(frozen=True)
class Own:
    """Reads or writes the copies' own numbers, copy i at start + i * size of `own`."""

    start: int
    size: int


@dataclass(frozen=True)
class Add:
    """Adds every copy's output to shared numbers from `start` on: first copy first."""

    start: int
    size: int


@dataclass(frozen=True)
class Worst:
    """Keeps the largest output of all copies and calls as the sample's guard; NaN counts as worst."""


Source = Given | Constants | Result | Shared | Each | Own
Target = Result | Shared | Each | Own | Add | Worst


@dataclass(frozen=True)
class Call:
    """One call of a kernel.

    Attributes:
        kernel: Number of the kernel.
        copies: Number of copies, at least 1.
        sources: Where its inputs come from, in order.
        targets: Where its outputs go, in order.
    """

    kernel: int
    copies: int
    sources: tuple[Source, ...]
    targets: tuple[Target, ...]


@dataclass(frozen=True)
class Start:
    """Shared numbers set before the calls after it, from `start` on: where sums begin."""

    start: int
    values: Array


@dataclass(frozen=True)
class Program:
    """A written-out model.

    Attributes:
        name: A C identifier: "idm", "ddm", "kinematics".
        inputs: Name and length of each user input, in the order of `given` (q, v, a or tau, ...).
        outputs: Name and length of each user output, in the order of `result`.
        kernels: The kernels.
        steps: Starts and calls, in order.
        shared: Number of shared numbers.
        own: Number of the copies' own numbers.

    The sample's guard (`Worst`) is at most 1 where the written-out model may be trusted; samples above 1 (or
    NaN) are for the general path.
    """

    name: str
    inputs: tuple[tuple[str, int], ...]
    outputs: tuple[tuple[str, int], ...]
    kernels: tuple[Kernel, ...]
    steps: tuple[Start | Call, ...]
    shared: int
    own: int
    notes: tuple[str, ...] = field(default=())
