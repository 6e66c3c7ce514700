"""Tables of numbers and places in printed drivers, equal ones once."""

from __future__ import annotations

import hashlib

import numpy as np

from ...spatial import Array, Index
from .kernels import literal


class Tables:
    """Collects tables; `text` declares them."""

    def __init__(self, dtype: str = "float64") -> None:
        """Begin without any.

        Args:
            dtype: What numbers are rounded to here, so that the compiler need not.
        """
        self._known: dict[str, str] = {}
        self._dtype = dtype

    @property
    def text(self) -> str:
        """The declarations in C."""
        return "\n".join(f"static const {head.format(name)};" for head, name in self._known.items())

    def places(self, index: Index) -> str:
        """Return the name of a table of places, of any shape."""
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
    """Return the brackets of a flat table; the readers count for themselves."""
    return f"[{max(array.size, 1)}]"


def steps_of_one(index: Index) -> bool:
    """Say whether each row of places counts up by one."""
    return bool((np.diff(index, axis=1) == 1).all())
