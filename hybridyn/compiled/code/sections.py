"""Sections of a library's code: what a single call of a model fetches."""

from __future__ import annotations

from ..program import Program

#: Models whose single calls matter: what has no copies is compiled for plain numbers, too, and all code of a
#: call lies in one section, which a call with cold caches fetches.
CALLED_ALONE = ("idm", "ddm")


def section(program: Program, prefix: str = "") -> str:
    """Return the name of the section with the code of a program's single calls."""
    return f"{prefix}code_of_{program.name}"


def placed(program: Program, prefix: str = "") -> str:
    """Return what puts a function into that section; nothing for models that are not `CALLED_ALONE`."""
    return f"IN_SECTION({section(program, prefix)}) " if program.name in CALLED_ALONE else ""
