"""Write tables of results, CSV or Parquet; a file appears complete or not at all.

A file is written beside its target under another name, and is renamed after its last row. Numbers have as
many digits as are needed to read the same bits back. Polars (the extra `io`) makes a Parquet file of such a
CSV file, so that the memory does not hold the table.
"""

from __future__ import annotations

import contextlib
import csv
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import orjson

from ..description.records import Array
from ..description.writing import appearing, naming
from ..errors import TrajectoryError, required

Write = Callable[[Array], None]


@contextlib.contextmanager
def open_results(target: str | Path | None, columns: Sequence[str]) -> Iterator[Write]:
    """Yield a function that writes blocks of rows; the file appears when the context ends without an error.

    A CSV file begins with its header, so that every reader of such files finds it.

    Args:
        target: A `.csv` or `.parquet` file, or None (or "-") for CSV on standard output.
        columns: Names of the columns.

    Yields:
        A function that takes rows, shape (rows, columns), and writes them.

    Raises:
        HybridynError: The ending is neither `.csv` nor `.parquet`, or the file cannot be written.
    """
    if target is None or str(target) == "-":
        with naming("standard output"):
            yield _csv_writer(sys.stdout, columns)
            sys.stdout.flush()
        return
    check_target(target)
    words: Any = {"mode": "w", "encoding": "utf-8", "newline": ""}
    with appearing(target) as draft:
        if draft.suffix.lower() != ".parquet":
            with open(draft, **words) as text:
                yield _csv_writer(text, columns)
            return
        import tempfile  # only Parquet needs it

        with tempfile.NamedTemporaryFile(dir=draft.parent, prefix=f"{draft.name}.", **words) as text:
            yield _csv_writer(text, columns)
            text.flush()
            polars = required("polars", "io", "Parquet")
            try:
                kinds = dict.fromkeys(columns, polars.Float64)
                how = {"has_header": False, "skip_rows": 1, "glob": False, "raise_if_empty": False}
                polars.scan_csv(text.name, schema=kinds, **how).sink_parquet(draft)
            except polars.exceptions.PolarsError as error:
                raise TrajectoryError(f"cannot be written: {error}", file=str(target)) from None


def check_target(target: str | Path) -> None:
    """Check, before any work is done, that a result file can be written.

    Raises:
        HybridynError: The ending is unknown, the folder is missing or closed, or polars is missing.
    """
    file = Path(os.path.realpath(target))
    if file.exists() and not file.is_file() and not file.is_dir():
        return  # a device or a pipe
    if file.is_dir():
        raise TrajectoryError("is a folder", file=str(target))
    if file.suffix.lower() not in (".csv", ".parquet"):
        raise TrajectoryError("a result file ends in .csv or .parquet", file=str(target))
    if not os.access(file.parent, os.W_OK):
        message = f"the folder '{file.parent}' does not exist, or cannot be written to"
        raise TrajectoryError(message, file=str(target))
    if file.suffix.lower() == ".parquet":
        required("polars", "io", f"{target}: Parquet")


def _csv_writer(text: IO[str], columns: Sequence[str]) -> Write:
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
