"""What the expressions of xacro files may not do, and how large their values may become."""

from __future__ import annotations

import ast
import re
from typing import Any

#: Longest text or list that an expression may produce.
LARGEST = 1_000_000

#: Most bits of an integer; the largest float has 1024.
MOST_BITS = 65_536

_WIDE_FIELD = re.compile(r"%[^a-zA-Z%]*(\d{5}|\*)")


class RefusedError(Exception):
    """The xacro file uses something that is not allowed."""


def bounded(value: Any) -> Any:
    """Return a value unchanged; raise RefusedError if it is too large."""
    if isinstance(value, str | list | tuple) and len(value) > LARGEST:
        raise RefusedError(f"a text or list is too large: it has more than {LARGEST:,} elements")
    return value


def refuse_growth(kind: ast.operator, left: Any, right: Any) -> None:
    """Raise RefusedError if the result of an operator would be too large, before it is computed."""
    if isinstance(kind, ast.Mod):
        if isinstance(left, str) and _WIDE_FIELD.search(left):
            raise RefusedError("a field of '%' is too wide")
        return
    bits = 0
    if isinstance(left, int) and isinstance(right, int):
        if isinstance(kind, ast.Pow):
            bits = left.bit_length() * max(right, 0)
        elif isinstance(kind, ast.LShift):
            bits = left.bit_length() + right
        elif isinstance(kind, ast.Mult):
            bits = left.bit_length() + right.bit_length()
    if bits > MOST_BITS:
        raise RefusedError(f"a whole number is too large: it has more than {MOST_BITS:,} bits")
    if isinstance(kind, ast.Mult):
        many, times = (right, left) if isinstance(left, int) else (left, right)
        if isinstance(many, str | list | tuple) and isinstance(times, int) and len(many) * times > LARGEST:
            raise RefusedError(f"a text or list is too large: it has more than {LARGEST:,} elements")


def refuse_dunder(name: str) -> None:
    """Raise RefusedError for a name with two leading underscores, such as those of Python's internals."""
    if name.startswith("__"):
        raise RefusedError(f"name '{name}' is not allowed in an expression")
