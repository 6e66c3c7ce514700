"""Write tables of results, CSV or Parquet; a file appears complete or not at all.

A file is written beside its target under another name, and is renamed after its last row. Numbers have as
many digits as are needed to read the same bits back.
"""

from __future__ import annotations

import contextlib
import csv
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
import orjson

from ..description.records import Array
from ..description.writing import appearing, naming
from ..errors import TrajectoryError

Write = Callable[[Array], None]


@contextlib.contextmanager
def open_results(
    target: str | Path | None, columns: Sequence[str], remarks: Sequence[str] = ()
) -> Iterator[Write]:
    """Yield a function that writes blocks of rows; the file appears when the context ends without an error.

    Args:
        target: A `.csv` or `.parquet` file, or None (or "-") for CSV on standard output.
        columns: Names of the columns.
        remarks: Lines before the header of a CSV file, behind `#`, or in a Parquet file's metadata.

    Yields:
        A function that takes rows, shape (rows, columns), and writes them.

    Raises:
        TrajectoryError: The ending is neither `.csv` nor `.parquet`, or the file cannot be written.
    """
    if target is None or str(target) == "-":
        with naming("standard output"):
            yield _csv_writer(sys.stdout, columns, remarks)
            sys.stdout.flush()
        return
    with naming(target), _opened(target, columns, remarks) as write:
        yield write


@contextlib.contextmanager
def _opened(target: str | Path, columns: Sequence[str], remarks: Sequence[str]) -> Iterator[Write]:
    file = Path(os.path.realpath(target))  # the target of a link is replaced, not the link
    check_target(target)
    if file.suffix.lower() == ".parquet":
        from .parquet import parquet_writer  # polars is an extra

        with appearing(file) as draft, parquet_writer(draft, columns, remarks, str(target)) as write:
            yield write
    elif file.exists() and not file.is_file():  # a device or a pipe is written to, never replaced
        with open(file, "w", encoding="utf-8", newline="") as text:
            yield _csv_writer(text, columns, remarks)
    else:
        with appearing(file) as draft, open(draft, "x", encoding="utf-8", newline="") as text:
            yield _csv_writer(text, columns, remarks)


def check_target(target: str | Path) -> None:
    """Check, before any work is done, that a result file can be written.

    Raises:
        TrajectoryError: The ending is unknown, the folder is missing or closed, or polars is missing.
    """
    file = Path(os.path.realpath(target))
    special = file.exists() and not file.is_file() and not file.is_dir()
    if file.suffix.lower() not in (".csv", ".parquet") and not special:
        raise TrajectoryError("a result file ends in .csv or .parquet", file=str(target))
    if file.is_dir():
        raise TrajectoryError("is a folder", file=str(target))
    if not file.parent.is_dir():
        raise TrajectoryError(f"the folder '{file.parent}' does not exist", file=str(target))
    if not special and not os.access(file.parent, os.W_OK):
        raise TrajectoryError(f"the folder '{file.parent}' cannot be written to", file=str(target))
    if file.suffix.lower() == ".parquet":
        from .parquet import load_polars  # polars is an extra

        load_polars(str(target))


def _csv_writer(text: TextIO, columns: Sequence[str], remarks: Sequence[str]) -> Write:
    text.write("".join(f"# {line}\n" for line in remarks))
    csv.writer(text, lineterminator="\n").writerow(columns)

    def write(rows: Array) -> None:
        """Write rows as text."""
        text.write(csv_text(rows))

    return write


def csv_text(rows: Array) -> str:
    """Return rows as lines of numbers with commas: the shortest decimals that read as the same bits."""
    if rows.size and np.isfinite(rows).all():  # JSON has neither nan nor inf
        numbers = np.ascontiguousarray(rows, dtype=float)
        text = orjson.dumps(numbers, option=orjson.OPT_SERIALIZE_NUMPY)  # [[1.0,2.0],[3.0,4.0]]
        return text[2:-2].replace(b"],[", b"\n").decode() + "\n"
    return "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())
