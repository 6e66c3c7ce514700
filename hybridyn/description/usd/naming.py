"""Names of links and joints: the last part of a prim's path, or as much of it as makes the name unique."""

from __future__ import annotations

from collections.abc import Iterable

from ..mjcf.naming import unique
from .stage import Prim

#: Attribute that holds the name of a link or joint where it is no name of a prim.
NAME = "hybridyn:name"


def names_of(prims: Iterable[Prim], taken: set[str]) -> dict[str, str]:
    """Return a name for each prim by its path, each only once.

    Args:
        prims: The prims.
        taken: Names that exist; the new ones are added.
    """
    prims = list(prims)
    out: dict[str, str] = {}
    waiting = {prim.path: prim.path.strip("/").split("/") for prim in prims}
    for prim in prims:
        if own := prim.word(NAME, ""):
            out[prim.path] = unique(own, taken)
            taken.add(out[prim.path])
            del waiting[prim.path]
    for path, parts in waiting.items():
        wanted = next(
            (
                name
                for length in range(1, len(parts) + 1)
                if _is_alone(name := "_".join(parts[-length:]), length, waiting)
            ),
            "_".join(parts),
        )
        out[path] = unique(wanted, taken)
        taken.add(out[path])
    return out


def _is_alone(name: str, length: int, waiting: dict[str, list[str]]) -> bool:
    """Return whether only one path ends in a name of so many parts."""
    return sum("_".join(parts[-length:]) == name for parts in waiting.values()) == 1
