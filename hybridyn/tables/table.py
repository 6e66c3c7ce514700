"""An open table: named columns, and rows in blocks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple, Self

from ..description.records import Array
from ..errors import TrajectoryError

#: Rows per block: enough for an efficient batch, few enough for the memory of any robot.
BLOCK_ROWS = 2_000
#: Characters of plain numbers; other forms that float() accepts (1_000, digits of other scripts) are errors.
NUMBERS = b"0123456789eE+-.,; \t"
EMPTY_CELL = "the cell is empty"


class Block(NamedTuple):
    """Some consecutive rows of a table.

    Attributes:
        first_row: Number of the first row in the table (from 1, the header not counted).
        values: Numbers, shape (rows, columns), all finite.
    """

    first_row: int
    values: Array


class Table:
    """An open table: its columns, and its rows as an iterator of blocks; a context manager that closes it.

    Attributes:
        file: Path as the user gave it, for messages.
        columns: Names of the columns, in file order.
        blocks: Iterator over the rows, to be consumed once.
        fraction: Function that returns the fraction of the file read so far, in [0, 1], or None if unknown.
        rows: Approximate number of rows, from the size of the file, or None if unknown.
    """

    def __init__(
        self,
        file: str,
        columns: tuple[str, ...],
        blocks: Iterator[Block],
        fraction: Callable[[], float | None],
        close: Callable[[], object],
        rows: int | None = None,
    ) -> None:
        self.file, self.columns, self.blocks, self.fraction = file, columns, blocks, fraction
        self.rows = rows
        self._close = close

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        self._close()


def check_columns(columns: tuple[str, ...], file: str | None) -> None:
    """Check that every column has a readable and unique name.

    Raises:
        TrajectoryError: A name is empty, a number, unprintable, or not unique.
    """
    seen: set[str] = set()
    for position, name in enumerate(columns, start=1):
        if not name:
            raise TrajectoryError(f"column {position} of the header has no name", file=file)
        if not name.isprintable():
            raise TrajectoryError(f"column {position} has an unprintable name, {name!a}", file=file)
        if name in seen:
            raise TrajectoryError("the header names it twice", file=file, column=name)
        if as_number(name) is not None:
            message = f"the header has a number, {name}, for a name: the first line must name the columns"
            raise TrajectoryError(message, file=file)
        seen.add(name)


def is_plain(text: str) -> bool:
    """Return whether a text has characters of plain numbers and separators only."""
    return not text.encode(errors="surrogatepass").translate(None, NUMBERS)


def as_number(cell: str) -> float | None:
    """Return the number in a cell, or None if there is none."""
    try:
        return float(cell) if is_plain(cell) else None
    except ValueError:
        return None
