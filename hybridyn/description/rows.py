"""Numbers that elements of robot files state, as rows of tables: words, defaults, bounds, units.

A format has a table for each of its elements, and says how an element states a number: by an attribute, by a
child, by a typed value. What is the same in all formats is here.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Protocol

from ..errors import ModelError


class Row(NamedTuple):
    """A number that an element may state.

    Attributes:
        default: The number where none is stated [SI].
        least: Smallest number that has a meaning.
        endless: Size from which a limit is none; 0 for a number that is no limit, and has to be finite.
        names: The names that files have for it, and the unit of each ("" is SI); the first that is stated
            counts. None stands for the word itself.
    """

    default: float = 0.0
    least: float = -math.inf
    endless: float = 0.0
    names: Mapping[str, str] | None = None

    def about(self, axis: str) -> Row:
        """Return the row of an axis, which "{}" in names stands for."""
        named = {name.format(axis): unit for name, unit in (self.names or {}).items()}
        return self._replace(names=named or None)


#: A table of an element.
Rows = Mapping[str, Row]


class Stating(Protocol):
    """An element of a file."""

    def stated(self, name: str, infinite: bool) -> float | None:
        """Return the number that the element states under a name, None where it states none.

        Args:
            name: The name.
            infinite: Whether it may be infinite.

        Raises:
            ModelError: It is no such number.
        """

    def error(self, message: str) -> ModelError:
        """Return (not raise) an error that says where the element is."""


def names_in(rows: Rows) -> list[str]:
    """Return all names of a table."""
    return [name for word, row in rows.items() for name in (row.names or (word,))]


def every_in(
    rows: Rows, element: Stating, units: Mapping[str, float] | None = None, of: str = ""
) -> Iterator[tuple[str, str, float]]:
    """Yield every number of a table that an element states: its word, the name there, and the number [SI].

    Args:
        rows: The table.
        element: The element.
        units: Units of the file [SI] by name.
        of: What follows in messages, such as " of joint 'elbow'".

    Raises:
        ModelError: What is stated is no number, or is below its bound.
    """
    for word, row in rows.items():
        for name, unit in (row.names or {word: ""}).items():
            value = element.stated(name, row.endless > 0)
            if value is None:
                continue
            if value < row.least:
                least = "negative" if row.least == 0 else f"below {row.least:g}:"
                raise element.error(f"{least} {name} {value:g}{of}")
            if row.endless and abs(value) >= row.endless:
                value = math.copysign(math.inf, value)
            yield word, name, value * units[unit] if units and unit else value


def stated_in(
    rows: Rows, element: Stating, of: str = "", drop: Callable[[str], object] | None = None
) -> dict[str, float]:
    """Return the numbers of a table that an element states, by their words; the first name counts.

    Args:
        rows: The table, without units.
        element: The element.
        of: As in `every_in`.
        drop: Takes what is told of a number that does not count, and is another one.

    Raises:
        ModelError: As in `every_in`.
    """
    out: dict[str, float] = {}
    for word, name, value in every_in(rows, element, of=of):
        if out.setdefault(word, value) != value and drop:
            drop(f"{name} {value:g}{of}, which is {out[word]:g} by another name")
    return out


def numbers_in(rows: Rows, element: Stating | None, of: str = "") -> dict[str, float]:
    """Return all numbers of a table, with the defaults of those that an element, or none, does not state.

    Raises:
        ModelError: As in `every_in`.
    """
    defaults = {word: row.default for word, row in rows.items()}
    return defaults | ({} if element is None else stated_in(rows, element, of))


def to_state(rows: Rows, values: Mapping[str, float]) -> dict[str, float]:
    """Return which numbers an element has to state, by their words: those that are not its defaults."""
    return {
        word: values[word] for word, row in rows.items() if word in values and values[word] != row.default
    }
