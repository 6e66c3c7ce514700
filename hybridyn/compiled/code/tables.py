"""Tables of numbers and indices in generated drivers; equal tables are stored once."""

from __future__ import annotations

import hashlib

from ...spatial import Array, Index
from .kernels import literal


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
        return self._named(
            "int {}" + _shape(index) + " = {{" + ", ".join(map(str, index.ravel().tolist())) + "}}"
        )

    def numbers(self, values: Array) -> str:
        """Return the name of a table of numbers, of any shape."""
        body = ", ".join(map(literal, values.astype(self._dtype).ravel().tolist()))
        return self._named("S {} " + _shape(values) + " ALIGNED = {{" + body + "}}")

    def _named(self, head: str) -> str:
        if head not in self._known:
            self._known[head] = f"d{hashlib.sha256(head.encode()).hexdigest()[:12]}"
        return self._known[head]


def _shape(array: Array | Index) -> str:
    """Return the C dimension of a flattened table."""
    return f"[{max(array.size, 1)}]"
