"""Open a table, CSV or Parquet."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Array
from ..errors import TrajectoryError
from .csv_table import open_csv
from .table import BLOCK_ROWS, Table


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
