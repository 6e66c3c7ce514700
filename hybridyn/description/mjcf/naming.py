"""Names for what an MJCF file leaves without one."""

from __future__ import annotations

from collections.abc import Sequence


def names_of(kind: str, given: Sequence[str], made: Sequence[str] | None = None) -> list[str]:
    """Return a name for every element, each only once.

    Args:
        kind: What the elements are, for names that are made of it and a number.
        given: Names of the file, "" for none.
        made: Names to make where there is none; by default kind and number.
    """
    taken = set(given)
    out = []
    for number, name in enumerate(given):
        name = name or unique(made[number] if made else f"{kind}{number}", taken)
        taken.add(name)
        out.append(name)
    return out


def unique(name: str, taken: set[str]) -> str:
    """Return a name that is not taken: the name itself, else with a number."""
    number, out = 2, name
    while out in taken:
        out, number = f"{name}{number}", number + 1
    return out
