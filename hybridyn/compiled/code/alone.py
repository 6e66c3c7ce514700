"""Choose the code of single calls: lanes that hold equal legs, or plain numbers.

Lanes compute equal legs at once. Whatever has no copies they compute in all lanes alike, which takes longer
than on plain numbers. The choice follows from the program alone, and both give the same bits.
"""

from __future__ import annotations

from ..program import Call, Program
from .across_samples import across_samples
from .kernels import kernel_graph, kernel_text
from .scalars import Scalar, text_of
from .tables import Tables

#: Models whose single calls matter enough to compile their kernels a second time, on plain numbers.
CALLED_ALONE = ("idm", "ddm")
#: Time of a statement on vectors over that of one on numbers, in a single call with its moves: 1.1 to 1.6.
VECTOR_STATEMENT = 1.3
#: Largest number of statements of a program that are compiled a second time.
SECOND_STATEMENTS = 4000

HEAD = "void {name}_one(const V *given, V *result, V *shared, V *own, V *guard)"


def on_numbers(program: Program, statements: list[int], lanes: int) -> bool:
    """Return whether single calls of a program are computed on plain numbers.

    Args:
        program: The program.
        statements: Number of statements of each kernel.
        lanes: Number of lanes otherwise.
    """
    if lanes == 1 or program.name not in CALLED_ALONE or sum(statements) > SECOND_STATEMENTS:
        return False
    calls = [(statements[step.kernel], step.copies) for step in program.steps if isinstance(step, Call)]
    numbers = sum(length * copies for length, copies in calls)
    return numbers <= VECTOR_STATEMENT * sum(length * -(-copies // lanes) for length, copies in calls)


def numbers_unit(program: Program, names: list[str], bodies: dict[str, str], dtype: str) -> str:
    """Return the C file of a program that single calls compute on plain numbers.

    Args:
        program: The program.
        names: C name of each of its kernels.
        bodies: Arguments and body of each kernel, by its name.
        dtype: Number type.
    """
    tables = Tables()
    kernels = [f"static void {name}{bodies[name]}" for name in dict.fromkeys(names)]
    single = across_samples(program, names, tables, HEAD)
    head = [Scalar(dtype, 1).prelude(), "#define B S", text_of("driver.h"), text_of("rows_scalar.h")]
    return "\n\n".join([*head, *kernels, tables.text, single]) + "\n"


def declaration(name: str) -> str:
    """Return the declaration of a function of `numbers_unit` for files whose vectors have lanes."""
    return HEAD.format(name=name).replace("V *", "S *") + ";"


def describe_single(program: Program, lanes: int) -> str:
    """Return a line that names the code of single calls.

    Args:
        program: A program with no unused calls.
        lanes: Number of lanes on this machine.
    """
    statements = [kernel_text(kernel_graph(kernel)).count("\n") for kernel in program.kernels]
    chosen = "plain numbers" if on_numbers(program, statements, lanes) else f"{lanes} lanes for equal legs"
    return f"single calls on this machine: {chosen}"
