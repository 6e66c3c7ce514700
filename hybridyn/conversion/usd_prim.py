"""Prims of USD as text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ..description.names import unique
from ..description.records import Array
from .as_text import numeral, quaternion_of


class UsdPrim:
    """A prim.

    Args:
        kind: Its type, "" for none.
        name: Its name, valid as an identifier.
        path: Its path.
    """

    def __init__(self, kind: str, name: str, path: str) -> None:
        self.kind, self.name, self.path = kind, name, path
        self.schemas: dict[str, None] = {}
        self._lines: list[str] = []
        self.children: list[UsdPrim] = []
        self._taken: set[str] = set()

    def child(self, kind: str, name: str) -> UsdPrim:
        """Add a prim below, whose name gets a number where another one has it."""
        name = unique(name, self._taken)
        out = UsdPrim(kind, name, f"{self.path}/{name}")
        self.children.append(out)
        return out

    def apply(self, schema: str) -> None:
        """Apply a schema, once."""
        self.schemas[schema] = None

    def line(self, text: str) -> None:
        """Add an attribute or relationship as text."""
        self._lines.append(text)

    def numbers(self, kind: str, name: str, values: float | Sequence[float] | Array) -> None:
        """Add an attribute of numbers."""
        self.line(f"{kind} {name} = {_tuple(np.ravel(values))}")

    def place(self, placement: Array) -> None:
        """Add the transform of the prim in its parent."""
        if not np.array_equal(placement, np.eye(4)):
            self.line(f"double3 xformOp:translate = {_tuple(placement[:3, 3])}")
            self.line(f"quatd xformOp:orient = {_tuple(quaternion_of(placement[:3, :3]))}")
            self.line('uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]')

    def lines(self, indent: str = "") -> Iterable[str]:
        """Yield the lines of the prim and of those below."""
        kind = f"{self.kind} " if self.kind else ""
        applied = ", ".join(f'"{schema}"' for schema in self.schemas)
        yield f'{indent}def {kind}"{self.name}"' + (
            f" (\n{indent}    prepend apiSchemas = [{applied}]\n{indent})" if applied else ""
        )
        yield indent + "{"
        for line in self._lines:
            yield f"{indent}    {line}"
        for child in self.children:
            yield ""
            yield from child.lines(indent + "    ")
        yield indent + "}"


def _tuple(numbers: Iterable[float]) -> str:
    parts = [numeral(number) for number in numbers]
    return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"
