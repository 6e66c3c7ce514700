"""Code for single calls: equal legs in the lanes of vectors, and what has no copies on plain numbers.

Vectors would compute what has no copies in all lanes alike, with more memory, and longer divisions and roots.
Both give the same bits. All code of these calls lies in one section, which a call with cold caches fetches.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..program import Call, Program

#: Models whose single calls matter enough to compile what has no copies a second time, on plain numbers.
CALLED_ALONE = ("idm", "ddm")
#: Largest number of statements that are compiled again: they cost about 0.2 ms of the compiler each.
SECOND_STATEMENTS = 20_000
#: First letter of the C names of kernels on plain numbers; that of the others is "k".
PLAIN = "n"


def plain_kernels(program: Program, names: Sequence[str], lengths: Mapping[str, int]) -> dict[str, str]:
    """Return C names of kernels on plain numbers, by those of the others; none where that does not pay.

    Args:
        program: The program; its batches have several lanes.
        names: C name of each kernel.
        lengths: Number of statements of kernels, by name.
    """
    if program.name not in CALLED_ALONE:
        return {}
    calls = [step for step in program.steps if isinstance(step, Call) and step.copies == 1]
    found = {names[call.kernel]: PLAIN + names[call.kernel][1:] for call in calls}
    return found if sum(lengths[name] for name in found) <= SECOND_STATEMENTS else {}


def section(program: Program) -> str:
    """Return the name of the section with the code of a program's single calls."""
    return f"code_of_{program.name}"


def in_sections(programs: Sequence[Program], names: Mapping[str, Sequence[str]]) -> dict[str, str]:
    """Return the section of each kernel that single calls of `CALLED_ALONE` use in lanes, by its C name."""
    return {
        names[program.name][step.kernel]: section(program)
        for program in programs
        if program.name in CALLED_ALONE
        for step in program.steps
        if isinstance(step, Call) and step.copies > 1
    }


def memory(program: Program) -> str:
    """Return the C of the memory of a program's single calls: given, shared and own numbers."""
    given = sum(size for _, size in program.inputs)
    members = f"S given[{max(given, 1)}], shared[{max(program.shared, 1)}]; V own[{max(program.own, 1)}];"
    return f"static struct {{ {members} }} {program.name}_memory ALIGNED;"
