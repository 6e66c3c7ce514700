"""Collect the tables of numbers and indices that a library's C code reads."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from ...spatial import Array, Index


def literal(value: float) -> str:
    """Return a finite number or an infinity as an exact C literal."""
    return repr(float(value)).replace("inf", "HUGE_VAL")


class Tables:
    """Collect tables; `text` declares them in C."""

    def __init__(self, dtype: str = "float64") -> None:
        """Start with no tables. `dtype`: type that numbers are rounded to before they are printed."""
        self._known: dict[str, str] = {}
        self._dtype = dtype

    @property
    def text(self) -> str:
        """The C declarations."""
        return "\n".join(f"static const {head.format(name)};" for head, name in self._known.items())

    def places(self, index: Index) -> str:
        """Return the name of a table of indices, of any shape."""
        return self._named("int {}", "", map(str, index.ravel().tolist()), index.size)

    def numbers(self, values: Array) -> str:
        """Return the name of a table of numbers, of any shape."""
        entries = map(literal, values.astype(self._dtype).ravel().tolist())
        return self._named("S {} ", " ALIGNED", entries, values.size)

    def _named(self, head: str, tail: str, entries: Iterable[str], size: int) -> str:
        """Return the name of a table."""
        text = f"{head}[{max(size, 1)}]{tail} = {{{{{', '.join(entries)}}}}}"
        return self._known.setdefault(text, f"d{hashlib.sha256(text.encode()).hexdigest()[:12]}")
