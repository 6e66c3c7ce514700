"""Generate portable C99 from programs: scalar code, no allocation, no library but <math.h>."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..program import Program
from .across_samples import across_samples
from .kernels import kernel_graph, kernel_text
from .rules import check, trimmed
from .scalars import text_of
from .tables import Tables

#: Functions of kernels that have the same name in the C library.
FUNCTIONS = (
    "SQRT", "FABS", "TAN", "ASIN", "ACOS", "ATAN", "SINH", "COSH", "TANH", "ASINH", "ACOSH", "ATANH", "EXP",
    "EXPM1", "LOG", "LOG1P", "FLOOR", "CEIL", "ERF", "ATAN2", "FMOD", "REMAINDER", "HYPOT", "COPYSIGN", "POW",
)  # fmt: skip

#: Functions that drivers and kernels call; only those in use are printed.
MOVES = {
    "worst": "static V worst(V a, V b) { return b <= a || a != a ? a : b; }",
    **{
        name: f"static void {name}({given}, int n) {{\n    int k;\n    for (k = 0; k < n; k++) {move};\n}}"
        for name, given, move in (
            ("set_all", "V *to, const S *from", "to[k] = from[k]"),
            ("copy", "V *to, const V *from", "to[k] = from[k]"),
            ("gather", "V *to, const V *from, const int *at", "to[k] = from[at[k]]"),
            ("scatter", "V *to, const int *at, const V *from", "to[at[k]] = from[k]"),
            ("add", "V *to, const V *from", "to[k] += from[k]"),
        )
    },
    "SINCOS": "static void SINCOS(V x, V *s, V *c) {\n"
    "    *s = FUNCTION(sin)(x);\n    *c = FUNCTION(cos)(x);\n}",
}


#: C types of numbers.
REAL = {"float64": "double", "float32": "float"}

#: Mark in every exported file; a file without it is never overwritten.
WRITTEN = "Written by hybridyn"


def plain_source(
    programs: list[Program],
    name: str,
    dtype: str = "float64",
    more: tuple[Sequence[Program], str] = ((), ""),
) -> str:
    """Return the C source of programs.

    Args:
        name: Prefix of every public identifier.
        dtype: "float64" or "float32".
        more: Programs without a public function, and C that calls them.
    """
    kernels: dict[str, str] = {}
    drivers: list[str] = []
    tables = Tables(dtype)
    hidden, calling = more
    public = {program.name for program in programs}
    for program in map(trimmed, (*programs, *hidden)):
        check(program)
        names = []
        for kernel in program.kernels:
            text = kernel_text(kernel_graph(kernel))
            if text not in kernels:
                kernels[text] = kernel.name
            names.append(kernels[text])
        drivers.append(across_samples(program, names, tables))
        drivers += [_call(program, name, dtype)] if program.name in public else []
    drivers += [calling] if calling else []
    bodies = [f"static void {called}{text}" for text, called in kernels.items()]
    code = "\n\n".join([*bodies, tables.text, *drivers])
    moves = [text for word, text in MOVES.items() if re.search(rf"\b{word}\(", code)]
    functions = [
        f"#define {word} FUNCTION({word.lower()})" for word in FUNCTIONS if re.search(rf"\b{word}\(", code)
    ]
    single = "#define SINGLE\n" if dtype == "float32" else ""
    parts = [
        f'/* {WRITTEN}. What it offers stands in {name}.h. */\n#include <math.h>\n\n#include "{name}.h"',
        single + text_of("plain.h").strip(),
        "\n".join(functions),
        *moves,
        code,
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def prototype(program: Program, name: str, dtype: str = "float64") -> str:
    """Return the declaration of a program's function, without the semicolon."""
    real = REAL[dtype]
    arguments = [f"const {real} {n}[{size}]" for n, size in program.inputs]
    arguments += [f"{real} {n}[{size}]" for n, size in program.outputs]
    return f"{real} {name}_{program.name}({', '.join(arguments)}, {name}_{program.name}_work *work)"


def work_type(program: Program, name: str, dtype: str = "float64") -> str:
    """Return the C type of the workspace of a program's function."""
    room = f"{REAL[dtype]} numbers[{sum(_sizes(program))}]"
    return f"typedef struct {{\n    {room};\n}} {name}_{program.name}_work;"


def _sizes(program: Program) -> tuple[int, int, int, int]:
    """Return the sizes of given, result, shared and own; shared and own are at least 1."""
    given, result = (sum(size for _, size in x) for x in (program.inputs, program.outputs))
    return given, result, max(program.shared, 1), max(program.own, 1)


def _call(program: Program, name: str, dtype: str) -> str:
    """Return the public C function of a program."""
    given, result, shared, _ = _sizes(program)
    lines = [
        f"{prototype(program, name, dtype)} {{",
        f"    V *given = work->numbers, *result = given + {given}, *shared = result + {result};",
        f"    V guard = C(0), *own = shared + {shared};",
        "    int k;",
    ]
    at = 0
    for word, size in program.inputs:
        lines.append(f"    for (k = 0; k < {size}; k++) given[{at} + k] = {word}[k];")
        at += size
    lines.append(f"    for (k = 0; k < {given}; k++) guard += given[k] * C(0); /* not finite: NaN */")
    lines.append(f"    {program.name}_samples(given, result, shared, own, &guard);")
    lines.append(f"    for (k = 0; k < {result}; k++) guard += result[k] * C(0); /* not finite: NaN */")
    at = 0
    for word, size in program.outputs:
        lines.append(f"    for (k = 0; k < {size}; k++) {word}[k] = result[{at} + k];")
        at += size
    return "\n".join([*lines, "    return guard;", "}"])
