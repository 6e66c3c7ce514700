"""Names for what an MJCF file leaves without one."""

from __future__ import annotations

from collections.abc import Sequence

from ..names import unique


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
        out.append(name or unique(made[number] if made else f"{kind}{number}", taken))
    return out
