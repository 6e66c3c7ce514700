"""The results on disk: one shard per chunk, written whole or not at all.

A shard is named by its designs and its study, `designs-000000000-000000099-0123456789abcdef.parquet`. The
names say what is done: a run that continues evaluates the other designs, so that nothing is lost and nothing
counted twice.
"""

from __future__ import annotations

import io
import json
import os
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...description.writing import appearing, write_text
from ...errors import HybridynError, required
from .evaluation import Row

#: The file that says of which study the shards are.
ABOUT = "sweep.json"
_SHARD = re.compile(r"designs-(\d{9,})-(\d{9,})-[0-9a-f]+\.parquet")


@dataclass(frozen=True)
class About:
    """What the shards of a folder belong to.

    Attributes:
        study: File of the study.
        identity: Digest of the study and its files.
        designs: Number of designs.
        parameters: Columns of the parameters.
        measures: Columns of the measures.
        compiled: Whether compiled models evaluate designs.
        units: Units of measures, as far as known.
    """

    study: str
    identity: str
    designs: int
    parameters: list[str]
    measures: list[str]
    compiled: bool = False
    units: dict[str, str] = field(default_factory=dict)

    def label(self, column: str) -> str:
        """Return a column with its unit, where it is known."""
        unit = self.units.get(column)
        return f"{column} [{unit}]" if unit else column

    @property
    def columns(self) -> list[str]:
        """Columns of a shard."""
        return ["design", *self.parameters, "status", *self.measures, "message"]


def begin(folder: Path, about: About, *, resume: bool) -> About:
    """Begin or continue the results in a folder, and return what they belong to.

    Args:
        folder: The folder, which exists, and which only this process writes (`locked`).
        about: What the shards belong to.
        resume: Whether to continue from shards that exist.

    Raises:
        HybridynError: The folder has shards and `resume` is false, or they are of another study.
        OSError: The folder cannot be written to.
    """
    if not shards_in(folder):
        required("polars", "sweep", "a sweep")
        write_text(folder / ABOUT, json.dumps(asdict(about), indent=1) + "\n")
        return about
    if not resume:
        raise HybridynError(
            f"{folder}: has results of an earlier sweep: continue them with resume=True, or choose another "
            "folder"
        )
    for draft in folder.glob(".designs-*"):  # of a program that was killed
        draft.unlink(missing_ok=True)
    before = about_of(folder)
    if before.identity != about.identity:
        raise HybridynError(
            f"{folder}: its results are of another study, or '{before.study}' or a file that it names has "
            "changed: choose another folder"
        )
    return before


def gaps(folder: Path, designs: int) -> list[tuple[int, int]]:
    """Return the designs without a row: first number, and the number after the last."""
    edges = [0, *(edge for start, stop, _ in shards_in(folder) for edge in (start, stop)), designs]
    return [(start, stop) for start, stop in zip(edges[::2], edges[1::2], strict=True) if start < stop]


def write_shard(folder: Path, about: About, rows: Sequence[Row]) -> None:
    """Write the rows of consecutive designs as one shard.

    Raises:
        OSError: The disk is full, or the folder is gone; the shard does not appear then.
    """
    cells = [(row.design, *row.values, row.status, *row.measures, row.message) for row in rows]
    out = io.BytesIO()
    _frame(about, cells).fill_nan(None).write_parquet(out)
    name = f"designs-{rows[0].design:09d}-{rows[-1].design:09d}-{about.identity[:16]}.parquet"
    with appearing(folder / name) as draft:
        draft.write_bytes(out.getvalue())


def about_of(folder: str | Path) -> About:
    """Read what the shards of a folder belong to.

    Raises:
        HybridynError: The folder holds no results of a sweep.
    """
    file = Path(folder, ABOUT)
    try:
        return About(**json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError):
        raise HybridynError(f"{folder}: holds no results of a sweep (no readable {ABOUT})") from None


def read_shards(folder: str | Path, columns: Sequence[str] = ()) -> Any:
    """Return the rows of a sweep as a data frame of polars, in the order of the designs.

    Args:
        columns: Columns to read; all by default.

    Raises:
        HybridynError: A shard cannot be read, is of another study, or has a design that the one before has.
    """
    polars, about, after = required("polars", "sweep", str(folder)), about_of(folder), 0
    wanted = [*(columns or about.columns)]
    parts = [_frame(about, []).select(wanted)]
    for start, stop, file in shards_in(Path(folder)):
        try:
            if not file.stem.endswith(f"-{about.identity[:16]}"):
                raise ValueError("another study wrote it")
            if start < after:
                raise ValueError(f"the shard before it has design {start}, too")
            after = stop
            parts.append(polars.read_parquet(file, columns=wanted).select(wanted))
        except (OSError, ValueError, polars.exceptions.PolarsError) as error:
            raise HybridynError(
                f"{file}: is no result of this sweep ({error}): remove it, and continue with resume=True"
            ) from error
    return polars.concat(parts)


def shards_in(folder: Path) -> list[tuple[int, int, Path]]:
    """Return the shards of a folder in order: first design, the number after the last, and the file.

    Args:
        folder: The folder, which need not exist.
    """
    names = os.listdir(folder) if folder.is_dir() else []
    matches = filter(None, map(_SHARD.fullmatch, names))
    return sorted((int(match[1]), int(match[2]) + 1, folder / match[0]) for match in matches)


def _frame(about: About, cells: Sequence[Sequence[object]]) -> Any:
    """Return rows as a data frame."""
    polars = required("polars", "sweep", "a shard")
    kinds = {"design": polars.Int64, "status": polars.String, "message": polars.String}
    schema = {name: kinds.get(name, polars.Float64) for name in about.columns}
    return polars.DataFrame(cells, schema=schema, orient="row")
