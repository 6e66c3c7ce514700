"""Generate further code for single calls: plain numbers, and vectors half as wide as those of batches.

Vectors compute equal legs at once. Whatever has no copies they compute in all lanes alike, which takes longer
than on plain numbers, and wide vectors take longer than narrow ones. All codes give the same bits. The
fastest one is chosen by measurement when a library is built (`library.choosing`); quick builds have the code
of batches only.
"""

from __future__ import annotations

from ..program import Call, Program
from .across_lanes import across_copies, across_samples
from .drivers import Tables
from .scalars import Scalar, text_of

#: Models whose single calls matter enough to compile their kernels a second time.
CALLED_ALONE = ("idm", "ddm")
#: Time of a statement on vectors over that of one on numbers, in a single call with its moves: at most 1.5
#: (1.0 to 1.5 measured). Where equal legs save more statements, plain numbers are not worth building.
VECTOR_STATEMENT = 1.5
#: Largest number of statements that are compiled again: they cost about 1 ms of the compiler each, so that a
#: program adds at most some 20 s to a build that a humanoid of 12,000 statements makes once.
SECOND_STATEMENTS = 20_000
#: Arguments of a code of single calls.
ARGUMENTS = "const S *given, S *result, S *guard"


def lanes_of_codes(program: Program, statements: list[int], lanes: int) -> list[int]:
    """Return the lanes of each code that single calls may use, those of batches first; 1 is plain numbers.

    Args:
        program: The program.
        statements: Number of statements of each kernel.
        lanes: Number of lanes in batches.
    """
    if lanes == 1 or program.name not in CALLED_ALONE or sum(statements) > SECOND_STATEMENTS:
        return [lanes]
    calls = [(statements[step.kernel], step.copies) for step in program.steps if isinstance(step, Call)]
    numbers = sum(length * copies for length, copies in calls)

    def vectors(wide: int) -> int:
        """Return the number of statements on vectors with some lanes."""
        return sum(length * -(-copies // wide) for length, copies in calls)

    half = lanes // 2
    narrow = [half] if half >= 4 and vectors(half) < numbers else []
    least = min(map(vectors, [lanes, *narrow]))
    return [lanes, *narrow, *([1] if numbers <= VECTOR_STATEMENT * least else [])]


def second_unit(program: Program, names: list[str], bodies: dict[str, str], scalar: Scalar) -> str:
    """Return the C file of another code of a program's single calls, left out of quick builds.

    Args:
        program: The program.
        names: C name of each of its kernels.
        bodies: Arguments and body of each kernel, by its name.
        scalar: Number type and lanes of the code.
    """
    tables = Tables()
    kernels = [f"static void {name}{bodies[name]}" for name in dict.fromkeys(names)]
    if scalar.lanes == 1:
        driver, moves = across_samples(program, names, tables), "#define B S\n" + text_of("rows_scalar.h")
    else:
        driver, moves = across_copies(program, names, scalar.lanes, tables), scalar.moves()
    head = [scalar.prelude(), text_of("driver.h"), moves]
    called = "samples" if scalar.lanes == 1 else "copies"
    parts = [*head, *kernels, tables.text, driver, code(program, scalar.lanes, called)]
    return "\n\n".join(["#ifndef QUICK", *parts, "#endif"]) + "\n"


def code(program: Program, lanes: int, called: str, kind: str = "") -> str:
    """Return the C function `<program>_on<lanes>`, which runs a driver with memory of its own.

    Args:
        program: The program.
        lanes: Number of lanes.
        called: Driver: "samples" or "copies".
        kind: Storage class of the function.
    """
    name = program.name
    return "\n".join(
        [
            f"{kind}void {name}_on{lanes}({ARGUMENTS}) {{",
            f"    static V work[{program.shared + program.own + 1}];",
            f"    {name}_{called}(given, result, work, work + {program.shared}, guard);",
            "}",
        ]
    )


def choice(program: Program, codes: list[int]) -> str:
    """Return the C that runs the chosen one of several codes, and one of them repeatedly to be measured."""
    name = program.name
    names = [f"{name}_on{lanes}" for lanes in codes]
    return "\n".join(
        [
            "#ifdef QUICK",
            f"#define {name}_on {names[0]}",
            "#else",
            *(f"void {name}_on{lanes}({ARGUMENTS});" for lanes in codes[1:]),
            f"static void (*const {name}_codes[])({ARGUMENTS}) = {{{', '.join(names)}}};",
            f"EXPORT int {name}_code;",
            f"#define {name}_on {name}_codes[{name}_code]",
            f"EXPORT S {name}_repeat(int n, const S *given, S *result, Long times) {{",
            "    S guard = 0;",
            f"    for (; times; times--) guard = 0, {name}_codes[n](given, result, &guard);",
            "    return guard;",
            "}",
            "#endif",
        ]
    )
