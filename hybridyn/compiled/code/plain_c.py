"""Generate portable C99 from programs: no allocation, no library but <math.h>.

Where many legs are equal, the source has vectors, too, whose lanes hold equal legs: GCC and Clang take them
for processors with AVX, others take the plain numbers, with the same bits.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..program import Call, Program, stored
from .across_lanes import HEAD, across_copies, across_samples
from .alone import CALLED_ALONE
from .drivers import Tables, moves
from .kernels import kernel_graph, kernel_text
from .rules import check, trimmed
from .scalars import OF_ONE, OF_TWO, REAL, functions, moves_of_copies, own_sines, text_of

if TYPE_CHECKING:
    import casadi as ca

#: Functions of kernels that have the same name in the C library.
FUNCTIONS = ("SQRT", "FABS", *OF_ONE, *OF_TWO)

#: Names of the arithmetic of plain numbers that become those of vectors; and new names beside the old ones.
PLAIN = (
    "C ALIGNED FMA FMS FNMA FNMS NOT AND OR TRUE NUMBER CHOOSE FMIN FMAX SIGN LANE ROOM D MD CD LANES FMA_D "
    "SELECT_D BEYOND ANY_D"
)
BESIDE = {"V": "Vector", "M": "Mask", "far_away": "far_away_lanes", "SINCOS_D": "SINCOS_LANES"}

#: First line of the drivers in lanes: the arguments of those on plain numbers, where V is S.
COPIES = "static void {name}_samples(const S *given, S *result, S *shared, V *own, S *guard) {{"

#: Functions that drivers and kernels call; only those in use are printed.
MOVES = {"worst": "static V worst(V a, V b) { return b <= a || a != a ? a : b; }", **moves("static")}


#: Mark in every exported file; a file without it is never overwritten.
WRITTEN = "Written by hybridyn"


#: Numbers in a vector: doubles in a register of AVX.
LANES = 4

#: Time of a statement on vectors over that of one on numbers, with its moves: at most 1.5 (1.0 to 1.5).
#: Where equal legs save fewer statements, the source has no vectors.
VECTOR_STATEMENT = 1.5

#: Sine and cosine of the C library, of a number and of each lane.
SINES = """static void SINCOS(V x, V *s, V *c) {
    *s = FUNCTION(sin)(x);
    *c = FUNCTION(cos)(x);
}"""
SINES_OF_LANES = """SELDOM void SINCOS(V x, V *s, V *c) {
    for (int i = 0; i < W; i++) {
        (*s)[i] = FUNCTION(sin)(x[i]);
        (*c)[i] = FUNCTION(cos)(x[i]);
    }
}"""


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
    lanes = in_lanes(programs)
    programs, (hidden, calling) = [trimmed(program) for program in programs], more
    every = [*programs, *map(trimmed, hidden)]
    kernels: dict[tuple[str, bool], str] = {}
    names: list[list[str]] = []
    for program in every:
        check(program)
        legs = {x.kernel for x in program.steps if isinstance(x, Call) and x.copies > 1}
        texts = [(kernel_text(kernel_graph(x)), k in legs) for k, x in enumerate(program.kernels)]
        for kernel, text in zip(program.kernels, texts, strict=True):
            kernels.setdefault(text, kernel.name)
        names.append([kernels[text] for text in texts])
    places = {
        called: _place(program, name)
        for program, its in zip(every, names, strict=True)
        if program.name in CALLED_ALONE
        for called in its
    }
    plain, each = (
        "\n\n".join(
            f"{places.get(x, '')}static void {x}{text}" for (text, of), x in kernels.items() if of is legs
        )
        for legs in (False, True)
    )
    alone = {called: called for (_, of), called in kernels.items() if not of}
    own = [_place(program, name) for program in every]
    drivers = _drivers(every, names, dtype, own)
    vectors = ""
    if lanes:
        in_vectors = _drivers_in_lanes(every, names, dtype, own, alone)
        vectors = f"#ifdef VECTORS\n{_vectors(plain + each, dtype)}\n#endif"
        drivers = f"#ifdef VECTORS\n{in_vectors}\n#else\n{drivers}\n#endif"
    single = "#define SINGLE\n" if dtype == "float32" else ""
    parts = [
        f'/* {WRITTEN}. What it offers stands in {name}.h. */\n#include <math.h>\n\n#include "{name}.h"',
        single + text_of("plain.h").strip(),
        text_of("fetching.h").strip(),
        _arithmetic(plain + each, dtype),
        plain,
        vectors,
        each,
        drivers,
        *(_call(program, name, dtype) for program in programs),
        calling,
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _section(program: Program, name: str) -> str:
    """Return the name of the section with the code of a program's single calls."""
    return f"{name}_{program.name}_code"


def _place(program: Program, name: str) -> str:
    """Return the attribute of the functions of a program whose code a call fetches."""
    return f"IN_SECTION({_section(program, name)}) " if program.name in CALLED_ALONE else ""


def prototype(program: Program, name: str, dtype: str = "float64") -> str:
    """Return the declaration of a program's function, without the semicolon."""
    real = REAL[dtype]
    arguments = [f"const {real} {n}[{size}]" for n, size in program.inputs]
    arguments += [f"{real} {n}[{size}]" for n, size in program.outputs]
    return f"{real} {name}_{program.name}({', '.join(arguments)}, {name}_{program.name}_work *work)"


def work_type(program: Program, name: str, dtype: str = "float64", *, lanes: bool = False) -> str:
    """Return the C type of the workspace of a program's function; `lanes` as from `in_lanes`."""
    given, result, shared, own = _sizes(program)
    vectors = LANES * (own + 1) if lanes else own  # from an aligned place on
    room = f"{REAL[dtype]} numbers[{given + result + shared + vectors}]"
    return f"typedef struct {{\n    {room};\n}} {name}_{program.name}_work;"


def in_lanes(programs: list[Program]) -> bool:
    """Return whether the source of programs has vectors: whether equal legs save enough statements."""
    counts = [(f.n_instructions(), copies) for f, copies in _calls(programs)]
    vectors = sum(length * -(-copies // LANES) for length, copies in counts)
    return sum(length * copies for length, copies in counts) > VECTOR_STATEMENT * vectors


def _calls(programs: list[Program]) -> list[tuple[ca.Function, int]]:
    """Return function and copies of the calls of the models, or of all programs where there are none."""
    models = [program for program in programs if program.name in CALLED_ALONE] or programs
    return [
        (program.kernels[step.kernel].function, step.copies)
        for program in models
        for step in program.steps
        if isinstance(step, Call)
    ]


def _functions(code: str) -> list[str]:
    """Return the functions of the C library that kernels call."""
    return [word for word in FUNCTIONS if re.search(rf"\b{word}\(", code)]


def _arithmetic(code: str, dtype: str) -> str:
    """Return the C source of the arithmetic of kernels on plain numbers."""
    parts = [text_of("plain_scalar.h"), *(f"#define {x} FUNCTION({x.lower()})" for x in _functions(code))]
    if "SINCOS(" in code:
        own = dtype == "float64"
        parts.append(f"#ifdef EXACT\n{own_sines(1)}#else\n{SINES}\n#endif" if own else SINES)
    return "\n".join(part.strip() for part in parts)


def _vectors(code: str, dtype: str) -> str:
    """Return the C source of the arithmetic of kernels in lanes, after that on plain numbers."""
    vector = text_of("vector.h").replace("/* intrinsics.h */\n\n", "")
    parts = ["/* From here on, the names of arithmetic are those of vectors. */"]
    parts += [f"#undef {word}" for word in PLAIN.split()]
    parts += [f"#define {word} {other}" for word, other in BESIDE.items()]
    parts += [*(f"#undef {word}" for word in _functions(code)), f"#define W {LANES}"]
    parts += [text_of("plain_vector.h"), vector, functions(), moves_of_copies(LANES)]
    if "SINCOS(" in code:
        own = dtype == "float64"
        parts.append(own_sines(LANES) if own else f"#define SINCOS SINCOS_LANES\n{SINES_OF_LANES}")
    return "\n".join(part.strip() for part in parts)


def _drivers(programs: list[Program], names: list[list[str]], dtype: str, places: list[str]) -> str:
    """Return the tables and drivers of programs on plain numbers, and what they call."""
    tables = Tables(dtype)
    drivers = [
        across_samples(program, called, tables, place + HEAD)
        for program, called, place in zip(programs, names, places, strict=True)
    ]
    code = "\n\n".join(drivers)
    moves = [text for word, text in MOVES.items() if re.search(rf"\b{word}\(", code)]
    return "\n\n".join(part for part in (*moves, tables.text, code) if part)


def _drivers_in_lanes(
    programs: list[Program], names: list[list[str]], dtype: str, places: list[str], alone: dict[str, str]
) -> str:
    """Return the tables and drivers of programs in lanes; the kernels `alone` are on plain numbers."""
    tables = Tables(dtype)
    drivers = [
        across_copies(program, called, LANES, tables, place + COPIES, alone)
        for program, called, place in zip(programs, names, places, strict=True)
    ]
    return "\n\n".join([tables.text, *drivers])


def _sizes(program: Program) -> tuple[int, int, int, int]:
    """Return the sizes of given, result, shared and own; shared and own are at least 1."""
    given, result = (sum(size for _, size in x) for x in (program.inputs, program.outputs))
    return given, result, max(program.shared, 1), max(program.own, 1)


def _call(program: Program, name: str, dtype: str) -> str:
    """Return the public C function of a program."""
    given, result, shared, _ = _sizes(program)
    each = "    for (k = 0; k < {}; k++) {};"
    lines = [
        f"{_place(program, name)}{prototype(program, name, dtype)} {{",
        f"    S guard = 0, *given = work->numbers, *result = given + {given};",
        f"    S *shared = result + {result};",
        f"    V *own = ROOM(shared + {shared});",
        "    int k;",
        *[f"    FETCH({_section(program, name)}, work, work + 1);"] * (program.name in CALLED_ALONE),
        *(each.format(n, f"given[{at} + k] = {word}[k]") for word, n, at in stored(program.inputs)),
        f"{each.format(given, 'guard += given[k] * (S)0')} /* not finite: NaN */",
        f"    {program.name}_samples(given, result, shared, own, &guard);",
        f"{each.format(result, 'guard += result[k] * (S)0')} /* not finite: NaN */",
        *(each.format(n, f"{word}[k] = result[{at} + k]") for word, n, at in stored(program.outputs)),
    ]
    return "\n".join([*lines, "    return guard;", "}"])


#: Most Newton steps of `<name>_close` in one call: four suffice from the last tick's posture.
NEWTON_STEPS = 8


class ControlStep:
    """The function `<name>_idm_from_motors`.

    Attributes:
        form: Its name, arguments and workspace, a program without calls.
        inverse: The inverse model that it calls after `<name>_close`.
    """

    def __init__(self, close: Program, inverse: Program) -> None:
        """Join both programs; the guard of `inverse` need not compare the loops."""
        kernels = tuple(replace(x, name=f"closed_{i}") for i, x in enumerate(inverse.kernels))
        self._close, self.inverse = close, replace(inverse, name="idm_of_closed", kernels=kernels)
        outputs = (*close.outputs, *inverse.outputs)
        near = close.inputs[0][1]
        own = near + max(_room(close), _room(inverse))
        self.form = Program("idm_from_motors", close.inputs, outputs, (), (), 1, own)

    def text(self, name: str, dtype: str) -> str:
        """Return the public C function; `idm_of_closed_samples` is the driver of the inverse model."""
        real, close = REAL[dtype], self._close
        near = close.inputs[0][1]
        inputs = ", ".join(n for n, _ in close.inputs[1:])
        states = [n for n, _ in close.outputs]
        read = [*zip(states, (size for _, size in self.inverse.inputs), strict=False)]
        read += [(n, size) for n, size in self.inverse.inputs[len(states) :]]
        given, result = (sum(size for _, size in x) for x in (self.inverse.inputs, self.inverse.outputs))
        lines = [
            f"{prototype(self.form, name, dtype)} {{",
            f"    {real} *from = work->numbers, *given = from + {near}, *result = given + {given};",
            f"    {real} *shared = result + {result};",
            f"    V *own = ROOM(shared + {max(self.inverse.shared, 1)});",
            f"    {real} guard = 0;",
            "    int k, n;",
            f"    for (k = 0; k < {near}; k++) from[k] = near[k];",
            f"    for (n = 0; n < {NEWTON_STEPS}; n++) {{",
            f"        guard = {name}_close(from, {inputs}, {', '.join(states)}, ({name}_close_work *)given);",
            "        if (guard <= 1) break;",
            f"        for (k = 0; k < {near}; k++) from[k] = q[k];",
            "    }",
            "    if (!(guard <= 1)) return guard;",
        ]
        lines += [
            f"    for (k = 0; k < {size}; k++) given[{at} + k] = {n}[k];" for n, size, at in stored(read)
        ]
        lines.append("    idm_of_closed_samples(given, result, shared, own, &guard);")
        lines.append(f"    for (k = 0; k < {result}; k++) guard += result[k] * 0; /* not finite: NaN */")
        lines += [f"    for (k = 0; k < {size}; k++) {n}[k] = result[k];" for n, size in self.inverse.outputs]
        return "\n".join([*lines, "    return guard;", "}"])


def _room(program: Program) -> int:
    """Return the size of a program's workspace."""
    sizes = (size for x in (program.inputs, program.outputs) for _, size in x)
    return sum(sizes) + max(program.shared, 1) + max(program.own, 1)
