"""Open a table, CSV or Parquet, and read it in blocks.

CSV is UTF-8 text with comma, semicolon or tab as separator, and with a decimal point. Quotes, a byte order
mark, CRLF line ends, blank lines and lines that start with `#` are accepted. Parquet is read with polars (the
extra `io`). The header is checked before any number. Every cell must be a finite number, unless the caller
chooses columns: then all others are left alone, and a cell may be empty. Memory holds one block at a time (of
Parquet one part), however long the table is.
"""

from __future__ import annotations

import contextlib
import io
import itertools
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Array
from ..errors import TrajectoryError, required
from .bag_folder import is_bag
from .csv_rows import CsvForm, as_number, lines_of, parts_of

#: Rows per block: enough for an efficient batch, few enough for the memory of any robot.
BLOCK_ROWS = 2_000
#: Rows of a Parquet file that are decoded together: its pages are not our blocks.
PART_ROWS = 50_000
#: Rows whose length tells how many the file holds.
FIRST_ROWS = 100

#: Chooses columns of a header.
Choose = Callable[[tuple[str, ...]], Sequence[str]]


class Block(NamedTuple):
    """Some consecutive rows of a table.

    Attributes:
        first_row: Number of the first row in the table (from 1, the header not counted).
        values: Numbers, shape (rows, columns), all finite; NaN in empty cells where columns were chosen.
    """

    first_row: int
    values: Array


class Table(NamedTuple):
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
def open_table(
    path: str | Path, *, block_rows: int = BLOCK_ROWS, choose: Choose | None = None
) -> Iterator[Table]:
    """Open a table and check its header.

    Args:
        path: A `.csv` (or any other text) file, a `.parquet` file, a bag of ROS 2 (`bags.py`), or "-" for CSV
            on standard input.
        block_rows: Rows per block.
        choose: Chooses the columns that are read, from all; the others may hold anything, and empty cells
            and "nan" are NaN.

    Yields:
        The table; no block is read yet. The file is closed when the context ends.

    Raises:
        HybridynError: The file cannot be read, or its header is wrong; polars is missing.
    """
    file = str(path)
    if Path(file).exists() and not (Path(file).is_file() or is_bag(file)):  # opening a pipe would wait
        raise TrajectoryError("cannot be read: it is not a regular file", file=file)
    with contextlib.ExitStack() as opened:
        try:
            if is_bag(file):
                columns, parts, rows = _bag(file, block_rows, choose)
            elif file.lower().endswith(".parquet"):
                columns, parts, rows = _parquet(file, block_rows, choose)
            else:
                columns, parts, rows = _csv(file, block_rows, opened, choose)
        except OSError as error:
            raise TrajectoryError(f"cannot be read: {error.strerror or error}", file=file) from error
        yield Table(file, columns, rows, _blocks(file, columns, parts, choose is not None))


def _chosen(file: str, columns: tuple[str, ...], choose: Choose | None) -> tuple[str, ...]:
    """Return the columns that are read, after a check of their names."""
    for name in columns:
        if as_number(name) is not None:
            message = f"the header has a number, {name}, for a name: the first line must name the columns"
            raise TrajectoryError(message, file=file)
    chosen, counts = columns if choose is None else tuple(choose(columns)), Counter(columns)
    for name in chosen:
        if not name or not name.isprintable():
            message = (
                f"column {columns.index(name) + 1} of the header has no name that can be printed: {name!a}"
            )
            raise TrajectoryError(message, file=file)
        if counts[name] > 1:
            raise TrajectoryError("the header names it twice", file=file, column=name)
    return chosen


def _blocks(file: str, columns: tuple[str, ...], parts: Iterable[Array], gaps: bool) -> Iterator[Block]:
    """Yield consecutive rows as blocks, after checking that they are finite numbers and not none at all.

    Args:
        gaps: Whether numbers may be missing, as NaN.
    """
    row = 1
    for values in parts:
        wrong = np.isinf(values) if gaps else ~np.isfinite(values)
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            message = f"the cell is empty or not a finite number: {values[i, j]}"
            raise TrajectoryError(message, file=file, row=row + int(i), column=columns[j])
        yield Block(row, values)
        row += len(values)
    if row == 1:
        raise TrajectoryError("the table has a header but no rows", file=file)


def _bag(file: str, block_rows: int, choose: Choose | None) -> tuple[tuple[str, ...], Iterator[Array], None]:
    """Return the chosen columns of a bag, without efforts by default, and its rows in parts."""
    from .bags import bag_columns, bag_parts  # few tables are bags

    motion = choose or (lambda every: [name for name in every if not name.endswith("/effort")])
    columns = _chosen(file, bag_columns(file), motion)
    return columns, bag_parts(file, columns, block_rows), None


def _parquet(
    file: str, block_rows: int, choose: Choose | None
) -> tuple[tuple[str, ...], Iterator[Array], int | None]:
    """Return the chosen columns of a Parquet file, its rows in parts, and their number."""
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
    chosen = _chosen(file, tuple(schema), choose)
    for name in chosen:
        if not schema[name].is_numeric():
            raise TrajectoryError(f"holds {schema[name]}, numbers are needed", file=file, column=name)
    rows = int(collected(frame.select(polars.len())).item())
    frame = frame.select(chosen)
    return chosen, parts(), rows


def _csv(
    file: str, block_rows: int, opened: contextlib.ExitStack, choose: Choose | None
) -> tuple[tuple[str, ...], Iterator[Array], int | None]:
    """Return the chosen columns of a CSV file, its rows in parts, and their number if it is known."""
    if file == "-":
        text = io.TextIOWrapper(sys.stdin.buffer, encoding="utf-8-sig")
        opened.callback(text.detach)
        size = 0
    else:
        text = opened.enter_context(open(file, encoding="utf-8-sig"))  # noqa: SIM115 (closed above)
        size = os.fstat(text.fileno()).st_size
    lines = lines_of(text, file)
    header = next(lines, "")
    if not header:
        raise TrajectoryError("the table is empty: its first line must name the columns", file=file)
    separator = next((mark for mark in ";\t" if mark in header), ",")
    columns = tuple(name.strip().strip('"') for name in header.split(separator))
    if len(columns) == 1 < len(header.split()):
        message = "has spaces between its columns: write commas, under a first line that names the columns"
        raise TrajectoryError(message, file=file)
    chosen = _chosen(file, columns, choose)
    at = None if choose is None else [columns.index(name) for name in chosen]
    first = [*itertools.islice(lines, FIRST_ROWS if size else 0)]  # do not wait for the rows of a pipe
    rows = size * len(first) // sum(len(line) + 1 for line in first) if first else None
    form = CsvForm(file, columns, separator, at)
    return chosen, parts_of(itertools.chain(first, lines), form, block_rows), rows
