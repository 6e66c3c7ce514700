"""Read and write Parquet tables with polars (the extra `io`), which is imported only here.

A Parquet file is read as the same `Table` as a CSV file, in blocks, and is written in blocks.
"""

from __future__ import annotations

import contextlib
import inspect
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..description.records import Array
from ..errors import TrajectoryError, install_advice
from .table import EMPTY_CELL, Block, Table, check_columns

#: Rows that are decoded, or collected before they are written, together: Parquet's pages are not our blocks.
PART_ROWS = 50_000


def load_polars(file: str, advice: str = f"Parquet needs polars: {install_advice('io')}, or use CSV") -> Any:
    """Import polars.

    Args:
        advice: What the error says: who needs it, and how to install it.

    Raises:
        TrajectoryError: polars is not installed.
    """
    try:
        import polars
    except ImportError as error:
        raise TrajectoryError(advice, file=file) from error
    return polars


def open_parquet(file: str, block_rows: int) -> Table:
    """Open a Parquet table and check its header.

    Returns:
        The table; no block is read yet.

    Raises:
        TrajectoryError: polars is missing, the file cannot be read, or a column does not hold numbers.
    """
    polars = load_polars(file)
    with open(file, "rb") as probe:
        if probe.read(4) != b"PAR1":
            raise TrajectoryError("is not a Parquet file", file=file)
    try:
        frame = polars.scan_parquet(file, glob=False)
        schema = frame.collect_schema()
        total = int(frame.select(polars.len()).collect().item())
    except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
        raise TrajectoryError(f"cannot be read: {error}", file=file) from error
    check_columns(tuple(schema), file)
    for name, kind in schema.items():
        if not kind.is_numeric():
            raise TrajectoryError(f"holds {kind}, numbers are needed", file=file, column=name)
    if not total:
        raise TrajectoryError("the table has no rows", file=file)
    done = [0]
    blocks = _parquet_blocks(polars, frame, file, total, block_rows, done)
    return Table(file, tuple(schema), blocks, lambda: done[0] / total, lambda: None, total)


def _parquet_blocks(
    polars: Any, frame: Any, file: str, total: int, block_rows: int, done: list[int]
) -> Iterator[Block]:
    slab_rows = block_rows * max(1, PART_ROWS // block_rows)
    for start in range(0, total, slab_rows):
        try:
            slab = frame.slice(start, slab_rows).collect()
            values = slab.cast(polars.Float64).to_numpy()
        except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
            raise TrajectoryError(f"cannot be read: {error}", file=file) from error
        wrong = np.argwhere(~np.isfinite(values))
        if len(wrong):
            row, column = wrong[0]
            missing = slab.to_series(int(column)).is_null()[int(row)]
            message = EMPTY_CELL if missing else f"{values[row, column]} is not a finite number"
            raise TrajectoryError(message, file=file, row=start + int(row) + 1, column=slab.columns[column])
        for first in range(0, len(values), block_rows):
            done[0] = start + min(first + block_rows, len(values))
            yield Block(start + first + 1, np.ascontiguousarray(values[first : first + block_rows]))


@contextlib.contextmanager
def parquet_writer(
    file: Path, columns: Sequence[str], remarks: Sequence[str] = (), name: str | None = None
) -> Iterator[Callable[[Array], None]]:
    """Return a function that writes rows; polars streams them into one file when the context ends.

    Args:
        file: Path of the file; an existing file is overwritten.
        columns: Names of the columns.
        remarks: Lines for the file's metadata, under the key "hybridyn"; a polars that cannot write them
            leaves them out.
        name: Name of the file in errors, where `file` is a draft.

    Yields:
        A function that takes rows, shape (rows, columns), and collects them in parts on disk.

    Raises:
        TrajectoryError: The disk is full, or the file cannot be written for another reason.
    """
    polars = load_polars(str(file))
    parts = Path(tempfile.mkdtemp(prefix=f".{file.name}.", dir=file.parent))
    waiting: list[Array] = []
    written = 0

    def flush() -> None:
        """Write the waiting rows as a part."""
        nonlocal written
        rows = np.concatenate([np.empty((0, len(columns))), *waiting])
        frame = polars.DataFrame({name: rows[:, index] for index, name in enumerate(columns)})
        frame.write_parquet(parts / f"{written:08d}.parquet")
        waiting.clear()
        written += 1

    def write(rows: Array) -> None:
        """Collect rows, and write a part when there are enough."""
        waiting.append(np.array(rows, dtype=np.float64))
        if sum(map(len, waiting)) >= PART_ROWS:
            flush()

    try:
        yield write
        if waiting or not written:
            flush()
        rows = polars.scan_parquet(sorted(parts.glob("*.parquet")), glob=False)
        known = "metadata" in inspect.signature(rows.sink_parquet).parameters
        said = {"metadata": {"hybridyn": "\n".join(remarks)}} if remarks and known else {}
        rows.sink_parquet(file, **said)
    except polars.exceptions.PolarsError as error:
        raise TrajectoryError(f"cannot be written: {error}", file=name or str(file)) from None
    finally:
        shutil.rmtree(parts, ignore_errors=True)
