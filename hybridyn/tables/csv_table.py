"""Tables of numbers with named columns, read in blocks.

A table is a CSV file (UTF-8; separator comma, semicolon or tab; decimal point; quotes allowed; a byte order
mark, CRLF line ends and lines that start with `#` are accepted) or a Parquet file (`parquet.py`). The header
is checked before any number; every cell must be a finite number; memory stays that of one block however long
the table is.
"""

from __future__ import annotations

import csv
import io
import itertools
import os
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple, Self, TextIO

import numpy as np

from ..description.records import Array
from ..errors import TrajectoryError

BLOCK_ROWS = 2_000  # rows per block: large enough to amortise a batch, small enough for any robot's memory
LINE_LIMIT = 16_000_000  # characters in a line: a file without line ends must not fill the memory

_NUMBERS = re.compile(
    r"[0-9eE+\-.,; \t]*"
)  # what float() takes beyond this (1_000, other scripts) is refused
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
    """An open table: its columns, and its rows as an iterator of blocks. Close it, or use it in `with`.

    Attributes:
        file: Path as the user gave it, for messages.
        columns: Names of the columns, in file order.
        blocks: Iterator over the rows, to be consumed once.
        fraction: Call it to know how much of the file has been read, in [0, 1]; None where that is unknown.
        rows: About how many rows there are, by the size of the file; None where that is unknown.
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
        """Close the file; harmless when it is closed already."""
        self._close()


def open_table(path: str | Path, *, block_rows: int = BLOCK_ROWS) -> Table:
    """Open a table and check its header.

    Args:
        path: A `.csv` (or any other text) file, a `.parquet` file, or "-" for CSV on standard input.
        block_rows: Rows per block.

    Returns:
        The table, its first block not read yet.

    Raises:
        TrajectoryError: The file cannot be read or its header is wrong.
    """
    file = str(path)
    try:
        if file.lower().endswith(".parquet"):
            from .parquet import open_parquet  # polars is an extra

            return open_parquet(file, block_rows)
        return _open_csv(file, block_rows)
    except OSError as error:
        raise TrajectoryError(f"cannot be read: {error.strerror or error}", file=file) from error


def _open_csv(file: str, block_rows: int) -> Table:
    if file == "-":
        text: TextIO = io.TextIOWrapper(sys.stdin.buffer, encoding="utf-8-sig")
        close: Callable[[], object] = text.detach  # type: ignore[attr-defined]
        size = 0
    else:
        text = open(file, encoding="utf-8-sig")  # noqa: SIM115 (closed by Table)
        close = text.close
        size = os.fstat(text.fileno()).st_size

    def fraction() -> float | None:
        return min(text.buffer.tell() / size, 1.0) if size else None

    try:
        lines = _lines(text, file)
        separator, columns = _header(next(lines, ""), file)
        rows = None
        if size:  # a pipe is not waited for
            first = next(lines, None)
            rows = size // (len(first) + 1) if first else 0
            lines = itertools.chain([first] if first else [], lines)
        blocks = _csv_blocks(lines, file, columns, separator, block_rows)
        return Table(file, columns, blocks, fraction, close, rows)
    except BaseException:
        close()
        raise


def _lines(text: TextIO, file: str) -> Iterator[str]:
    """Yield the header and the rows: no line ends, no comments, no blank lines at the end."""
    count = -1  # rows so far; the header is row 0
    blank = False
    while True:
        try:
            line = text.readline(LINE_LIMIT)
        except UnicodeDecodeError as error:
            raise TrajectoryError("is not UTF-8 text, so it is not a CSV table", file=file) from error
        if not line:
            return
        if len(line) >= LINE_LIMIT:
            raise TrajectoryError(f"a line is longer than {LINE_LIMIT:,} characters", file=file)
        line = line.rstrip("\n")
        if line.startswith("#"):
            continue
        if not line.strip():
            blank = True
            continue
        count += 1
        if blank and count > 0:
            raise TrajectoryError("there is an empty line before this row", file=file, row=count)
        blank = False
        yield line


def _header(line: str, file: str) -> tuple[str, tuple[str, ...]]:
    """Split the header into the separator and the names of the columns."""
    if not line:
        raise TrajectoryError("the table is empty: its first line must name the columns", file=file)
    separator = next((mark for mark in ";\t" if mark in line), ",")
    columns = tuple(name.strip() for name in _cells(line, separator))
    check_columns(columns, file)
    return separator, columns


def check_columns(columns: tuple[str, ...], file: str | None) -> None:
    """Check that every column has one readable name of its own.

    Args:
        columns: Names of the columns.
        file: Path of the table, for messages.

    Raises:
        TrajectoryError: A name is empty, a number, unprintable, or stands twice.
    """
    seen: set[str] = set()
    for position, name in enumerate(columns, start=1):
        if not name:
            raise TrajectoryError(f"column {position} of the header has no name", file=file)
        if not name.isprintable():
            raise TrajectoryError(f"column {position} has an unprintable name, {name!a}", file=file)
        if name in seen:
            raise TrajectoryError("the header names it twice", file=file, column=name)
        if _as_number(name) is not None:
            message = f"the header has a number, {name}, for a name: the first line must name the columns"
            raise TrajectoryError(message, file=file)
        seen.add(name)


def _csv_blocks(
    lines: Iterator[str], file: str, columns: tuple[str, ...], separator: str, block_rows: int
) -> Iterator[Block]:
    first_row = 1
    while chunk := list(itertools.islice(lines, block_rows)):
        values = _parse_fast(chunk, len(columns), separator)
        if values is None:
            values = _parse_slow(chunk, first_row, file, columns, separator)
        yield Block(first_row, values)
        first_row += len(chunk)
    if first_row == 1:
        raise TrajectoryError("the table has a header but no rows", file=file)


def _parse_fast(lines: list[str], width: int, separator: str) -> Array | None:
    """Parse rows that are plain numbers, or return None where anything is unusual."""
    if not all(_NUMBERS.fullmatch(line) for line in lines):
        return None
    rows = [line.split(separator) for line in lines]
    if any(len(row) != width for row in rows):
        return None
    try:
        values = np.array([list(map(float, row)) for row in rows])
    except ValueError:
        return None
    return values if np.isfinite(values).all() else None


def _parse_slow(
    lines: list[str], first_row: int, file: str, columns: tuple[str, ...], separator: str
) -> Array:
    """Parse rows cell by cell, with quotes, and name the first cell that is wrong."""
    values = np.empty((len(lines), len(columns)))
    for index, line in enumerate(lines):
        row = first_row + index
        cells = _cells(line, separator)
        if len(cells) != len(columns):
            message = f"has {len(cells)} cells, the header names {len(columns)} columns"
            raise TrajectoryError(message, file=file, row=row)
        for column, cell in enumerate(cells):
            number = _as_number(cell)
            if number is None or not np.isfinite(number):
                raise TrajectoryError(_fault(cell), file=file, row=row, column=columns[column])
            values[index, column] = number
    return values


def _cells(line: str, separator: str) -> list[str]:
    if '"' not in line:
        return line.split(separator)
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except csv.Error:
        return line.split(separator)


def _as_number(cell: str) -> float | None:
    try:
        return float(cell) if _NUMBERS.fullmatch(cell) else None
    except ValueError:
        return None


def _fault(cell: str) -> str:
    """Say what is wrong with a cell that is no finite number."""
    cell = cell.strip()
    if not cell:
        return EMPTY_CELL
    shown = ascii(cell[:40] + ("..." if len(cell) > 40 else ""))
    if re.fullmatch(r"[+-]?\d+,\d+", cell):
        return f"{shown} has a decimal comma; write a decimal point"
    if _as_number(cell) is not None or re.fullmatch(r"[+-]?(nan|inf|infinity)", cell, re.IGNORECASE):
        return f"{shown} is not a finite number"
    return f"{shown} is not a number"
