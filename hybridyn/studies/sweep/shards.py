"""The rows of a sweep on disk: parts of a folder of results, one per chunk of designs.

A part, or shard, is named by its designs, `designs-000000000-000000099.parquet`. The names say what is done:
a run that continues evaluates the other designs, so that nothing is lost and nothing counted twice.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...errors import HybridynError, required
from ..results_folder import part, read_record
from .evaluation import DesignRow

_SHARD = re.compile(r"designs-(\d{9,})-(\d{9,})\.parquet")


@dataclass(frozen=True)
class About:
    """What the shards of a folder belong to.

    Attributes:
        study: File of the study.
        designs: Number of designs.
        parameters: Columns of the parameters.
        measures: Columns of the measures.
        compiled: Whether compiled models evaluate designs.
        units: Units of measures, as far as known.
        gradients: Columns of their derivatives, where they were asked for.
    """

    study: str
    designs: int
    parameters: list[str]
    measures: list[str]
    compiled: bool = False
    units: dict[str, str] = field(default_factory=dict)
    gradients: list[str] = field(default_factory=list)

    def label(self, column: str) -> str:
        """Return a column with its unit, where it is known."""
        unit = self.units.get(column)
        return f"{column} [{unit}]" if unit else column

    @property
    def columns(self) -> list[str]:
        """Columns of a shard."""
        return ["design", *self.parameters, "status", *self.measures, *self.gradients, "message"]


def gaps(folder: Path, designs: int) -> list[tuple[int, int]]:
    """Return the designs without a row: first number, and the number after the last."""
    edges = [0, *(edge for start, stop, _ in shards_in(folder) for edge in (start, stop)), designs]
    return [(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True) if start < stop]


def write_shard(folder: Path, about: About, rows: Sequence[DesignRow]) -> None:
    """Write the rows of consecutive designs as one shard.

    Raises:
        OSError: The disk is full, or the folder is gone; the shard does not appear then.
    """
    none = (math.nan,) * len(about.gradients)
    cells = [
        (row.design, *row.values, row.status, *row.measures, *(row.gradients or none), row.message)
        for row in rows
    ]
    out = io.BytesIO()
    _frame(about, cells).fill_nan(None).write_parquet(out)
    with part(folder, f"designs-{rows[0].design:09d}-{rows[-1].design:09d}.parquet") as draft:
        draft.write_bytes(out.getvalue())


def about_of(folder: str | Path) -> About:
    """Read what the shards of a folder belong to.

    Raises:
        HybridynError: The folder holds no results of a sweep.
    """
    try:
        return About(**read_record(folder).told)
    except TypeError:
        raise HybridynError(f"{folder}: holds no results of a sweep") from None


def read_shards(folder: str | Path, columns: Sequence[str] = ()) -> Any:
    """Return the rows of a sweep as a data frame of polars, in the order of the designs.

    Args:
        columns: Columns to read; all by default.

    Raises:
        HybridynError: A shard has changed, is of another sweep, or has a design that the one before has.
    """
    polars, about, after = required("polars", "sweep", str(folder)), about_of(folder), 0
    wanted, record = [*(columns or about.columns)], read_record(folder)
    parts = [_frame(about, []).select(wanted)]
    for start, stop, file in shards_in(record.folder):
        if start < after or not record.has(file.name):
            raise HybridynError(
                f"{file}: is no result of this sweep, has changed, or the file before it has designs of it, "
                "too: remove it, and continue with resume=True"
            )
        after = stop
        parts.append(polars.read_parquet(file, columns=wanted).select(wanted))
    return polars.concat(parts)


def shards_in(folder: Path) -> list[tuple[int, int, Path]]:
    """Return the shards of a folder in order: first design, the number after the last, and the file.

    Args:
        folder: The folder, which need not exist.
    """
    matches = filter(None, (_SHARD.fullmatch(file.name) for file in folder.glob("*")))
    return sorted((int(match[1]), int(match[2]) + 1, folder / match[0]) for match in matches)


def _frame(about: About, cells: Sequence[Sequence[object]]) -> Any:
    """Return rows as a data frame."""
    polars = required("polars", "sweep", "a shard")
    kinds = {"design": polars.Int64, "status": polars.String, "message": polars.String}
    schema = {name: kinds.get(name, polars.Float64) for name in about.columns}
    return polars.DataFrame(cells, schema=schema, orient="row")
