"""Generate portable C99 from programs: no allocation, no library but <math.h>.

Where many legs are equal, the source has vectors, too, whose lanes hold equal legs: GCC and Clang take them
for processors with AVX, others take the plain numbers, with the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..program import Call, Program, stored
from .c_tables import Tables
from .drivers import HEAD, MOVES, across_copies, across_samples
from .kernels import kernel_graph, kernel_text
from .rules import check, trimmed
from .scalars import FUNCTIONS, LIBRARY, REAL, arithmetic, c_text, moves_of_copies, of_doubles, single
from .sections import CALLED_ALONE, placed, section

#: Names of the arithmetic of plain numbers that become those of vectors; and new names beside the old ones.
PLAIN = (
    "V M W C ALIGNED FMA FMS FNMA LT LE EQ NE NOT AND OR ANY TRUE NUMBER CHOOSE SELECT FMIN FMAX SIGN LANE "
    "ROOM D MD TO BELOW"
)
BESIDE = {"far_away": "far_away_lanes", "SINCOS": "SINCOS_LANES", "TANH": "TANH_LANES", "EXP": "EXP_LANES"}

#: First line of the drivers in lanes: the arguments of those on plain numbers, where V is S.
COPIES = "static void {name}_samples(const S *given, S *result, S *shared, V *own, S *guard) {{"

#: Mark in every exported file; a file without it is never overwritten.
WRITTEN = "Written by hybridyn"


#: Numbers in a vector: doubles in a register of AVX.
LANES = 4

#: Time of a statement on vectors over that of one on numbers, with its moves: at most 1.5 (1.0 to 1.5).
#: Where equal legs save fewer statements, the source has no vectors.
VECTOR_STATEMENT = 1.5

#: Start of the vectors in a workspace: aligned, where they are not plain numbers.
PLAIN_ROOM = "#define ROOM(x) (x)"
ROOM = "#define ROOM(x) ((V *)(((__UINTPTR_TYPE__)(x) + sizeof(V) - 1) / sizeof(V) * sizeof(V)))"


def plain_source(
    programs: list[Program],
    name: str,
    dtype: str = "float64",
    more: str = "",
    inner: Sequence[Program] = (),
) -> str:
    """Return the C source of programs.

    Args:
        name: Prefix of every public identifier.
        dtype: "float64" or "float32".
        more: C that calls their functions.
        inner: Programs that only `more` calls.
    """
    lanes, public = in_lanes(programs), len(programs)
    programs = [trimmed(program) for program in (*programs, *inner)]
    kernels, names = _named_kernels(programs)
    plain, each = _functions(programs, names, kernels, f"{name}_")
    alone = {called: called for (_, of), called in kernels.items() if not of}
    every_driver = _drivers(programs, names, dtype, f"{name}_", alone if lanes else None)
    functions = f"#ifdef EXACT\n{of_doubles()}#else\n{LIBRARY}\n#endif" if dtype == "float64" else LIBRARY
    sections = [
        f'/* {WRITTEN}. What it offers stands in {name}.h. */\n#include <math.h>\n\n#include "{name}.h"',
        single(dtype) + c_text("plain.h").strip(),
        c_text("fetching.h").strip(),
        "\n".join([arithmetic(1), PLAIN_ROOM, functions]),
        plain,
        f"#ifdef VECTORS\n{_vectors(functions)}\n#endif" if lanes else "",
        each,
        every_driver,
        *(_call(program, name, dtype) for program in programs[:public]),
        *(
            f"{work_type(program, name, dtype, lanes=lanes)}\n\nstatic {_call(program, name, dtype)}"
            for program in programs[public:]
        ),
        more,
    ]
    return "\n\n".join(text for text in sections if text) + "\n"


def _named_kernels(programs: Sequence[Program]) -> tuple[dict[tuple[str, bool], str], list[list[str]]]:
    """Return the kernels of programs, equal ones once, and the name of each kernel of each program.

    Returns:
        Names by the kernel's text and whether it computes several copies; lists of names.
    """
    kernels: dict[tuple[str, bool], str] = {}
    names: list[list[str]] = []
    for program in programs:
        check(program)
        legs = {x.kernel for x in program.steps if isinstance(x, Call) and x.copies > 1}
        texts = [(kernel_text(kernel_graph(x)), k in legs) for k, x in enumerate(program.kernels)]
        for kernel, text in zip(program.kernels, texts, strict=True):
            kernels.setdefault(text, kernel.name)
        names.append([kernels[text] for text in texts])
    return kernels, names


def _functions(
    programs: Sequence[Program], names: list[list[str]], kernels: dict[tuple[str, bool], str], prefix: str
) -> list[str]:
    """Return the C functions of kernels: of those that compute one copy, and of the others."""
    places = {
        called: placed(program, prefix)
        for program, its in zip(programs, names, strict=True)
        for called in its
        if program.name in CALLED_ALONE
    }
    return [
        "\n\n".join(
            f"{places.get(x, '')}static void {x}{text}" for (text, of), x in kernels.items() if of is legs
        )
        for legs in (False, True)
    ]


def _drivers(
    programs: Sequence[Program],
    names: list[list[str]],
    dtype: str,
    prefix: str,
    in_lanes: Mapping[str, str] | None,
) -> str:
    """Return the functions that call the kernels of programs, and the tables that they read.

    Args:
        names: Names of each program's kernels.
        in_lanes: Names of the kernels that run in lanes by themselves; None if no program has lanes.
    """
    tables, tables_in_lanes = Tables(dtype), Tables(dtype)
    drivers, in_vectors = [], []
    for program, called in zip(programs, names, strict=True):
        head = placed(program, prefix)
        drivers.append(across_samples(program, called, tables, head + HEAD))
        if in_lanes is not None:
            each = across_copies(program, called, LANES, tables_in_lanes, head + COPIES, in_lanes)
            in_vectors.append(each)
    text = "\n\n".join([MOVES, tables.text, *drivers])
    if in_lanes is None:
        return text
    vectors = "\n\n".join([tables_in_lanes.text, *in_vectors])
    return f"#ifdef VECTORS\n{vectors}\n#else\n{text}\n#endif"


def prototype(program: Program, name: str, dtype: str = "float64") -> str:
    """Return the declaration of a program's function, without the semicolon."""
    real = REAL[dtype]
    arguments = [f"const {real} {n}[{size}]" for n, size in program.inputs]
    arguments += [f"{real} {n}[{size}]" for n, size in program.outputs]
    return f"{real} {name}_{program.name}({', '.join(arguments)}, {name}_{program.name}_work *work)"


def work_type(program: Program, name: str, dtype: str = "float64", *, lanes: bool = False) -> str:
    """Return the C type of the workspace of a program's function; `lanes` as from `in_lanes`."""
    room = f"{REAL[dtype]} numbers[{work_size(program, lanes=lanes)}]"
    return f"typedef struct {{\n    {room};\n}} {name}_{program.name}_work;"


def work_size(program: Program, *, lanes: bool) -> int:
    """Return how many numbers the workspace of a program's function has; `lanes` as from `in_lanes`."""
    given, result, shared, own = program.sizes
    return given + result + shared + (LANES * (own + 1) if lanes else own)  # from an aligned place on


def in_lanes(programs: list[Program]) -> bool:
    """Return whether the source of programs has vectors: whether equal legs save enough statements.

    Those of the models count, or of all programs where there are no models.
    """
    models = [program for program in programs if program.name in CALLED_ALONE] or programs
    counts = [
        (program.kernels[step.kernel].function.n_instructions(), step.copies)
        for program in models
        for step in program.steps
        if isinstance(step, Call)
    ]
    vectors = sum(length * -(-copies // LANES) for length, copies in counts)
    return sum(length * copies for length, copies in counts) > VECTOR_STATEMENT * vectors


def _vectors(functions: str) -> str:
    """Return the C source of the arithmetic of kernels in lanes, after that on plain numbers."""
    parts = ["/* From here on, the names of arithmetic are those of vectors. */"]
    parts += [f"#undef {word}" for word in (*PLAIN.split(), *FUNCTIONS)]
    parts += [f"#define {word} {other}" for word, other in BESIDE.items()]
    return "\n".join([*parts, arithmetic(LANES), ROOM, moves_of_copies(LANES), functions])


def _call(program: Program, name: str, dtype: str) -> str:
    """Return the public C function of a program."""
    given, result, shared, _ = program.sizes
    each = "    for (k = 0; k < {}; k++) {};"
    lines = [
        f"{placed(program, f'{name}_')}{prototype(program, name, dtype)} {{",
        f"    S guard = 0, *given = work->numbers, *result = given + {given};",
        f"    S *shared = result + {result};",
        f"    V *own = ROOM(shared + {shared});",
        "    int k;",
        *[f"    FETCH({section(program, f'{name}_')}, work, work + 1);"] * (program.name in CALLED_ALONE),
        *(each.format(n, f"given[{at} + k] = {word}[k]") for word, n, at in stored(program.inputs)),
        f"{each.format(given, 'guard += given[k] * (S)0')} /* not finite: NaN */",
        f"    {program.name}_samples(given, result, shared, own, &guard);",
        f"{each.format(result, 'guard += result[k] * (S)0')} /* not finite: NaN */",
        *(each.format(n, f"{word}[k] = result[{at} + k]") for word, n, at in stored(program.outputs)),
    ]
    return "\n".join([*lines, "    return guard;", "}"])
