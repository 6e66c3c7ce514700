"""Names of links and joints: the last part of a prim's path, or as much of it as makes the name unique."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from ..names import unique
from .stage import Prim


def names_of(prims: Iterable[Prim], taken: set[str]) -> dict[str, str]:
    """Return a name for each prim by its path, each only once.

    Args:
        taken: Names that exist; the new ones are added.
    """
    out: dict[str, str] = {}
    waiting = {prim.path: prim.path.strip("/").split("/") for prim in prims}
    length = 0
    while waiting:
        length += 1
        wanted = {path: "_".join(parts[-length:]) for path, parts in waiting.items()}
        counts = Counter(wanted.values())
        for path, name in wanted.items():
            if counts[name] == 1 or length >= len(waiting[path]):
                out[path] = unique(name, taken)
                taken.add(out[path])
                del waiting[path]
    return out
