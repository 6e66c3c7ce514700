"""Programs as C functions of one sample, on plain numbers: for code of others that calls them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from ..program import Program, stored
from .c_tables import Tables
from .drivers import HEAD, MOVES, across_samples
from .kernels import kernel_graph, kernel_text
from .rules import check, trimmed
from .scalars import GUARD_LIMIT, LIBRARY, REAL, arithmetic

#: Run a program for one sample: its guard, NaN where a number that is not finite comes in or out.
RUN = """static S {name}_run(const S *given, S *result, S * = 0) {{
    S shared[{shared}], own[{own}], guard = 0;
    for (int k = 0; k < {given}; k++) guard += given[k] * (S)0;
    {name}_samples(given, result, shared, own, &guard);
    for (int k = 0; k < {result}; k++) guard += result[k] * (S)0;
    return guard;
}}
static int {name}_single_at(const S *const *in, S *out) {{
    S given[{given}];
    {gathered}
    return !({name}_run(given, out) <= {limit});
}}"""


class SampleCode(NamedTuple):
    """C of programs that run for one sample.

    Attributes:
        head: The type S, and the macros of its arithmetic.
        functions: For each program `NAME_run(given, result, room)`, which returns the guard, and
            `NAME_single_at(inputs, result)`, which returns 0 where it can be trusted; all are static.
    """

    head: str
    functions: str


def sample_code(programs: Mapping[str, Program], dtype: str, before: str) -> SampleCode:
    """Return the C of programs that run for one sample, also as C++.

    Args:
        programs: The programs by the names of their functions.
        dtype: "float64" or "float32".
        before: Macros that the arithmetic needs: `INLINE`, and `FAST_FMA` where sums of products are fused.
    """
    scalar = f"#define SCALAR(name) name{'##f' if dtype == 'float32' else ''}"
    head = [f"typedef {REAL[dtype]} S;", scalar, before, arithmetic(1)]
    kernels: dict[str, str] = {}
    drivers: list[str] = []
    for called, program in programs.items():
        program = trimmed(program)
        check(program)
        texts = [kernel_text(kernel_graph(kernel)) for kernel in program.kernels]
        for text in texts:
            kernels.setdefault(text, f"kernel_{len(kernels)}")
        drivers.append(_driver(called, program, [kernels[text] for text in texts], dtype))
    code = "\n".join([*(f"static void {name}{text}" for text, name in kernels.items()), *drivers])
    return SampleCode("\n".join(head), "\n".join([MOVES, LIBRARY, code]))


def _driver(name: str, program: Program, kernels: list[str], dtype: str) -> str:
    """Return the C of a program that calls its kernels, and runs for one sample."""
    tables = Tables(dtype)
    head = HEAD.format(name=name)
    first, rest = across_samples(program, kernels, tables, head=head).split("\n", 1)
    gathered = [
        f"for (int k = 0; k < {size}; k++) given[{at} + k] = in[{n}][k];"
        for n, (_, size, at) in enumerate(stored(program.inputs))
    ]
    given, result, shared, own = (max(size, 1) for size in program.sizes)  # C has no empty arrays
    run = RUN.format(
        name=name, shared=shared, own=own, given=given, result=result,
        gathered="\n    ".join(gathered), limit=GUARD_LIMIT,
    )  # fmt: skip
    return "\n".join([first, tables.text, rest, run])
