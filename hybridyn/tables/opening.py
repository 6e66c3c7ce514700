"""Open a table, CSV or Parquet, and read CSV in blocks.

CSV is UTF-8 text with comma, semicolon or tab as separator, and with a decimal point. Quotes, a byte order
mark, CRLF line ends and lines that start with `#` are accepted. The header is checked before any number.
Every cell must be a finite number. Memory holds one block at a time, however long the table is.
"""

from __future__ import annotations

import contextlib
import csv
import io
import itertools
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
import orjson

from ..description.names import did_you_mean
from ..description.records import Array
from ..errors import TrajectoryError
from .table import BLOCK_ROWS, EMPTY_CELL, Block, Table, as_number, check_columns, is_plain

#: Maximum number of characters in a line, so that a file without line ends does not fill the memory.
LINE_LIMIT = 16_000_000


def read_columns(path: str | Path, columns: Sequence[str]) -> Array:
    """Read some columns of a whole table, shape (rows, columns).

    Raises:
        TrajectoryError: A column is missing, or as `open_table`.
    """
    with open_table(path) as table:
        for name in columns:
            if name not in table.columns:
                hint = did_you_mean(name, table.columns)
                raise TrajectoryError(f"is missing{hint}", file=table.file, column=name)
        at = [table.columns.index(name) for name in columns]
        return np.concatenate([block.values[:, at] for block in table.blocks])


def open_table(path: str | Path, *, block_rows: int = BLOCK_ROWS) -> Table:
    """Open a table and check its header.

    Args:
        path: A `.csv` (or any other text) file, a `.parquet` file, or "-" for CSV on standard input.
        block_rows: Rows per block.

    Returns:
        The table; no block is read yet.

    Raises:
        TrajectoryError: The file cannot be read, is a pipe or a device, or its header is wrong.
    """
    file = str(path)
    if file != "-" and os.path.exists(file) and not os.path.isfile(file) and not os.path.isdir(file):
        # reading a pipe would block, and its data can be read only once
        raise TrajectoryError(
            "is not a regular file; give what comes out of a pipe or a device on standard input, as '-'",
            file=file,
        )
    try:
        if file.lower().endswith(".parquet"):
            os.stat(file)  # a file that is missing is said before polars is asked for
            from .parquet import open_parquet  # polars is an extra

            return open_parquet(file, block_rows)
        return open_csv(file, block_rows)
    except OSError as error:
        raise TrajectoryError(f"cannot be read: {error.strerror or error}", file=file) from error


def open_csv(file: str, block_rows: int) -> Table:
    """Open a CSV table and check its header.

    Args:
        file: Path of the file, or "-" for standard input.
        block_rows: Rows per block.

    Raises:
        TrajectoryError: The file is not UTF-8 text, or its header is wrong.
        OSError: The file cannot be read.
    """
    if file == "-":
        text: TextIO = io.TextIOWrapper(sys.stdin.buffer, encoding="utf-8-sig")
        close: Callable[[], object] = text.detach  # type: ignore[attr-defined]
        size = 0
    else:
        text = open(file, encoding="utf-8-sig")  # noqa: SIM115 (closed by Table)
        close = text.close
        size = os.fstat(text.fileno()).st_size

    def fraction() -> float | None:
        """Return the part of the file that has been read, None where its size is unknown."""
        return min(text.buffer.tell() / size, 1.0) if size else None

    try:
        lines = _lines(text, file)
        separator, columns = _header(next(lines, ""), file)
        rows = None
        if size:  # do not wait for the rows of a pipe
            first = next(lines, None)
            rows = size // (len(first) + 1) if first else 0
            lines = itertools.chain([first] if first else [], lines)
        blocks = _csv_blocks(lines, file, columns, separator, block_rows)
        return Table(file, columns, blocks, fraction, close, rows)
    except BaseException:
        close()
        raise


def _lines(text: TextIO, file: str) -> Iterator[str]:
    """Yield the header and the rows without line ends, comments and blank lines at the end."""
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
    words = line.split()
    if len(columns) == 1 < len(words):
        numbers = all(as_number(word) is not None for word in words)
        if numbers or sum("/" in word or word == "time" for word in words) > 1:
            also = ", under a first line that names the columns" if numbers else ""
            raise TrajectoryError(f"has spaces between its columns: write commas{also}", file=file)
    check_columns(columns, file)
    return separator, columns


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
    """Parse rows of plain numbers; return None where a row needs `_parse_slow`."""
    text = separator.join(lines)
    if not is_plain(text) or any(line.count(separator) != width - 1 for line in lines):
        return None
    try:
        values = np.fromiter(_numbers(text, separator), float, len(lines) * width)
    except ValueError:
        return None
    return values.reshape(len(lines), width) if np.isfinite(values).all() else None


def _numbers(text: str, separator: str) -> Iterable[float]:
    """Return the numbers of cells, read as JSON if they are written so: faster than by `float`."""
    if separator == "," and "-0," not in f"{text},":  # JSON reads -0 as an integer, without its sign
        with contextlib.suppress(orjson.JSONDecodeError):
            numbers: list[float] = orjson.loads(f"[{text}]")
            return numbers
    return map(float, text.split(separator))


def _parse_slow(
    lines: list[str], first_row: int, file: str, columns: tuple[str, ...], separator: str
) -> Array:
    """Parse rows cell by cell, with quotes; the error names the first wrong cell."""
    values = np.empty((len(lines), len(columns)))
    for index, line in enumerate(lines):
        row = first_row + index
        cells = _cells(line, separator)
        if len(cells) != len(columns):
            message = f"has {len(cells)} cells, the header names {len(columns)} columns"
            raise TrajectoryError(message, file=file, row=row)
        for column, cell in enumerate(cells):
            number = as_number(cell)
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


def _fault(cell: str) -> str:
    """Return the message for a cell that is not a finite number."""
    cell = cell.strip()
    if not cell:
        return EMPTY_CELL
    shown = ascii(cell[:40] + ("..." if len(cell) > 40 else ""))
    if re.fullmatch(r"[+-]?\d+,\d+", cell):
        return f"{shown} has a decimal comma; write a decimal point"
    if as_number(cell) is not None or re.fullmatch(r"[+-]?(nan|inf|infinity)", cell, re.IGNORECASE):
        return f"{shown} is not a finite number"
    return f"{shown} is not a number"
