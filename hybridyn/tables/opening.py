"""Open a table, CSV or Parquet, and read it in blocks.

CSV is UTF-8 text with comma, semicolon or tab as separator, and with a decimal point. Quotes, a byte order
mark, CRLF line ends, blank lines and lines that start with `#` are accepted. Parquet is read with polars (the
extra `io`). The header is checked before any number. Every cell must be a finite number. Memory holds one
block at a time (of Parquet one part), however long the table is.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, TextIO

import numpy as np
import orjson

from ..description.names import did_you_mean
from ..description.records import Array
from ..errors import TrajectoryError, required

#: Rows per block: enough for an efficient batch, few enough for the memory of any robot.
BLOCK_ROWS = 2_000
#: Rows of a Parquet file that are decoded together: its pages are not our blocks.
PART_ROWS = 50_000
#: Rows whose length tells how many the file holds.
FIRST_ROWS = 100
#: Characters of plain numbers; other forms that float() accepts (1_000, digits of other scripts) are errors.
NUMBERS = b"0123456789eE+-.,; \t"


class Block(NamedTuple):
    """Some consecutive rows of a table.

    Attributes:
        first_row: Number of the first row in the table (from 1, the header not counted).
        values: Numbers, shape (rows, columns), all finite.
    """

    first_row: int
    values: Array


@dataclass
class Table:
    """An open table.

    Attributes:
        file: Path as the user gave it, for messages.
        columns: Names of the columns, in file order.
        rows: Approximate number of rows, from the size of the file, or None if unknown.
        blocks: Iterator over the rows, to be consumed once.
    """

    file: str
    columns: tuple[str, ...]
    rows: int | None
    blocks: Iterator[Block]


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


@contextlib.contextmanager
def open_table(path: str | Path, *, block_rows: int = BLOCK_ROWS) -> Iterator[Table]:
    """Open a table and check its header.

    Args:
        path: A `.csv` (or any other text) file, a `.parquet` file, or "-" for CSV on standard input.
        block_rows: Rows per block.

    Yields:
        The table; no block is read yet. The file is closed when the context ends.

    Raises:
        HybridynError: The file cannot be read, or its header is wrong; polars is missing.
    """
    file = str(path)
    if Path(file).exists() and not Path(file).is_file():  # opening a pipe would wait
        raise TrajectoryError("cannot be read: it is not a regular file", file=file)
    with contextlib.ExitStack() as opened:
        try:
            parquet = file.lower().endswith(".parquet")
            columns, rows, parts = _parquet(file, block_rows) if parquet else _csv(file, block_rows, opened)
        except OSError as error:
            raise TrajectoryError(f"cannot be read: {error.strerror or error}", file=file) from error
        counts = Counter(columns)
        for position, name in enumerate(columns):
            if not name or not name.isprintable():
                message = f"column {position + 1} of the header has no name that can be printed: {name!a}"
                raise TrajectoryError(message, file=file)
            if counts[name] > 1:
                raise TrajectoryError("the header names it twice", file=file, column=name)
            if as_number(name) is not None:
                message = f"the header has a number, {name}, for a name: the first line must name the columns"
                raise TrajectoryError(message, file=file)
        yield Table(file, columns, rows, _blocks(file, columns, parts))


def _blocks(file: str, columns: tuple[str, ...], parts: Iterable[Array]) -> Iterator[Block]:
    """Yield consecutive rows as blocks, after checking that they are finite numbers and not none at all."""
    row = 1
    for values in parts:
        if not np.isfinite(values).all():
            i, j = np.argwhere(~np.isfinite(values))[0]
            message = f"the cell is empty or not a finite number: {values[i, j]}"
            raise TrajectoryError(message, file=file, row=row + int(i), column=columns[j])
        yield Block(row, values)
        row += len(values)
    if row == 1:
        raise TrajectoryError("the table has a header but no rows", file=file)


def _parquet(file: str, block_rows: int) -> tuple[tuple[str, ...], int, Iterator[Array]]:
    """Return the columns of a Parquet file, the number of its rows, and these in parts."""
    polars = required("polars", "io", f"{file}: Parquet")

    def collected(query: Any) -> Any:
        """Read what a query asks for."""
        try:
            return query.collect()
        except (polars.exceptions.PolarsError, polars.exceptions.PanicException) as error:
            raise TrajectoryError(f"cannot be read: {error}", file=file) from error

    def parts() -> Iterator[Array]:
        """Yield the rows of blocks."""
        size = block_rows * max(1, PART_ROWS // block_rows)
        for start in range(0, rows, size):
            values = collected(frame.slice(start, size).cast(polars.Float64)).to_numpy()
            for first in range(0, len(values), block_rows):
                yield np.ascontiguousarray(values[first : first + block_rows])

    frame = polars.scan_parquet(file, glob=False)
    schema = collected(frame.head(0)).schema
    for name, kind in schema.items():
        if not kind.is_numeric():
            raise TrajectoryError(f"holds {kind}, numbers are needed", file=file, column=name)
    rows = int(collected(frame.select(polars.len())).item())
    return tuple(schema), rows, parts()


def _csv(
    file: str, block_rows: int, opened: contextlib.ExitStack
) -> tuple[tuple[str, ...], int | None, Iterator[Array]]:
    """Return the columns of a CSV file, the number of its rows if it is known, and these in parts."""
    if file == "-":
        text = io.TextIOWrapper(sys.stdin.buffer, encoding="utf-8-sig")
        opened.callback(text.detach)
        size = 0
    else:
        text = opened.enter_context(open(file, encoding="utf-8-sig"))  # noqa: SIM115 (closed above)
        size = os.fstat(text.fileno()).st_size
    lines = _lines(text, file)
    header = next(lines, "")
    if not header:
        raise TrajectoryError("the table is empty: its first line must name the columns", file=file)
    separator = next((mark for mark in ";\t" if mark in header), ",")
    columns = tuple(name.strip().strip('"') for name in header.split(separator))
    if len(columns) == 1 < len(header.split()):
        message = "has spaces between its columns: write commas, under a first line that names the columns"
        raise TrajectoryError(message, file=file)
    first = [*itertools.islice(lines, FIRST_ROWS if size else 0)]  # do not wait for the rows of a pipe
    rows = size * len(first) // sum(len(line) + 1 for line in first) if first else None
    return columns, rows, _csv_parts(itertools.chain(first, lines), file, columns, separator, block_rows)


def _lines(text: TextIO, file: str) -> Iterator[str]:
    """Yield the header and the rows without line ends, without comments and blank lines."""
    try:
        for line in text:
            if line.strip() and not line.startswith("#"):
                yield line.rstrip("\n")
    except UnicodeDecodeError as error:
        raise TrajectoryError("is not UTF-8 text, so it is not a CSV table", file=file) from error


def _csv_parts(
    lines: Iterator[str], file: str, columns: tuple[str, ...], separator: str, block_rows: int
) -> Iterator[Array]:
    first_row = 1
    while chunk := [*itertools.islice(lines, block_rows)]:
        values = _numbers(chunk, len(columns), separator)
        if values is None:
            raise next(_faults(chunk, first_row, file, columns, separator))
        yield values
        first_row += len(chunk)


def _numbers(lines: list[str], width: int, separator: str) -> Array | None:
    """Return the numbers of rows, or None where a cell holds none."""
    text = separator.join(lines).replace('"', "")
    if not is_plain(text) or any(line.count(separator) != width - 1 for line in lines):
        return None
    numbers: list[float] | None = None
    if separator == "," and "-0," not in f"{text},":  # JSON reads -0 as an integer, without its sign
        with contextlib.suppress(orjson.JSONDecodeError):  # faster than float, where the cells are JSON
            numbers = orjson.loads(f"[{text}]")
    try:
        found = map(float, text.split(separator)) if numbers is None else numbers
        return np.fromiter(found, float, len(lines) * width).reshape(len(lines), width)
    except ValueError:
        return None


def _faults(
    lines: list[str], first_row: int, file: str, columns: tuple[str, ...], separator: str
) -> Iterator[TrajectoryError]:
    """Yield the errors of rows with a wrong number of cells, or with a cell that is no number."""
    for row, line in enumerate(lines, start=first_row):
        cells = line.replace('"', "").split(separator)
        if len(cells) != len(columns):
            message = f"has {len(cells)} cells, the header names {len(columns)} columns"
            yield TrajectoryError(message, file=file, row=row)
        for name, cell in zip(columns, map(str.strip, cells), strict=False):
            if as_number(cell) is None:
                shown = f"{cell[:40]!a} is not a finite number" if cell else "the cell is empty"
                comma = "; write a decimal point" if re.fullmatch(r"[+-]?\d+,\d+", cell) else ""
                yield TrajectoryError(shown + comma, file=file, row=row, column=name)


def is_plain(text: str) -> bool:
    """Return whether a text has characters of plain numbers and separators only."""
    return not text.encode(errors="surrogatepass").translate(None, NUMBERS)


def as_number(cell: str) -> float | None:
    """Return the number in a cell, or None if there is none."""
    try:
        return float(cell) if is_plain(cell) else None
    except ValueError:
        return None
