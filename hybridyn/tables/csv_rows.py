"""The rows of a CSV file: cells, numbers, and what is wrong with them."""

from __future__ import annotations

import contextlib
import csv
import itertools
import re
from collections.abc import Iterator
from typing import NamedTuple, TextIO

import numpy as np
import orjson

from ..description.records import Array
from ..errors import TrajectoryError

#: Characters of plain numbers; other forms that float() accepts (1_000, digits of other scripts) are errors.
NUMBERS = b"0123456789eE+-.,; \t"


class CsvForm(NamedTuple):
    """How the rows of a CSV file are read.

    Attributes:
        file: Path, for messages.
        columns: All columns.
        separator: What separates cells.
        chosen: Places of the columns that are read, and may have empty cells; None for all.
    """

    file: str
    columns: tuple[str, ...]
    separator: str
    chosen: list[int] | None

    def cells(self, line: str) -> list[str]:
        """Return the cells of a row; those of texts between quotes may hold the separator."""
        if self.chosen is None:
            return line.replace('"', "").split(self.separator)
        return next(csv.reader([line], delimiter=self.separator))


def lines_of(text: TextIO, file: str) -> Iterator[str]:
    """Yield the header and the rows without line ends, without comments and blank lines."""
    try:
        for line in text:
            if line.strip() and not line.startswith("#"):
                yield line.rstrip("\n")
    except UnicodeDecodeError as error:
        raise TrajectoryError("is not UTF-8 text, so it is not a CSV table", file=file) from error


def parts_of(lines: Iterator[str], form: CsvForm, block_rows: int) -> Iterator[Array]:
    """Yield the numbers of rows in blocks.

    Raises:
        TrajectoryError: A row has a wrong number of cells, or a cell that is no number.
    """
    first_row = 1
    while chunk := [*itertools.islice(lines, block_rows)]:
        values = _numbers(chunk, len(form.columns), form.separator)
        if form.chosen is not None:
            values = _with_gaps(chunk, form) if values is None else values[:, form.chosen]
        if values is None:
            raise next(_faults(chunk, first_row, form))
        yield values
        first_row += len(chunk)


def _with_gaps(lines: list[str], form: CsvForm) -> Array | None:
    """Return the chosen columns of rows, NaN in empty cells, or None where a cell holds no number."""
    rows = [form.cells(line) for line in lines]
    if any(len(row) != len(form.columns) for row in rows):
        return None
    cells = [row[i].strip() for row in rows for i in form.chosen or ()]
    numbers = [np.nan if _empty(cell) else as_number(cell) for cell in cells]
    return None if None in numbers else np.array(numbers, dtype=float).reshape(len(rows), -1)


def _empty(cell: str) -> bool:
    """Return whether a cell says that there is no number."""
    return not cell or cell.lower() == "nan"


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


def _faults(lines: list[str], first_row: int, form: CsvForm) -> Iterator[TrajectoryError]:
    """Yield the errors of rows with a wrong number of cells, or with a cell that is no number."""
    columns = form.columns
    chosen = range(len(columns)) if form.chosen is None else form.chosen
    for row, line in enumerate(lines, start=first_row):
        cells = form.cells(line)
        if len(cells) != len(columns):
            message = f"has {len(cells)} cells, the header names {len(columns)} columns"
            yield TrajectoryError(message, file=form.file, row=row)
        for i in chosen:
            cell = cells[i].strip()
            if as_number(cell) is None and not (form.chosen is not None and _empty(cell)):
                shown = f"{cell[:40]!a} is not a finite number" if cell else "the cell is empty"
                comma = "; write a decimal point" if re.fullmatch(r"[+-]?\d+,\d+", cell) else ""
                yield TrajectoryError(shown + comma, file=form.file, row=row, column=columns[i])


def is_plain(text: str) -> bool:
    """Return whether a text has characters of plain numbers and separators only."""
    return not text.encode(errors="surrogatepass").translate(None, NUMBERS)


def as_number(cell: str) -> float | None:
    """Return the number in a cell, or None if there is none."""
    try:
        return float(cell) if is_plain(cell) else None
    except ValueError:
        return None
