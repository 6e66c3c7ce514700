"""The results on disk: one shard per chunk, written whole or not at all.

A shard is named by its designs and by a digest of its study and its bytes,
`designs-000000000-000000099-0123456789abcdef.parquet`. The names say what is done, the digests that this
study did it: a run that continues evaluates the other designs, so that nothing is lost and nothing counted
twice.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from ...description.writing import naming
from ...errors import HybridynError, required
from .evaluation import Row

#: The file that says of which study the shards are.
ABOUT = "sweep.json"
_SHARD = re.compile(r"designs-(\d{9,})-(\d{9,})-[0-9a-f]+\.parquet")

Columns = dict[str, Any]


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


class Shards:
    """The results of a sweep in a folder, which only this process writes (`locked`)."""

    def __init__(self, folder: str | Path, about: About) -> None:
        self.folder, self.about = Path(folder), about
        self._done = [(start, stop) for start, stop, _ in shards_in(self.folder)]

    @classmethod
    def create(cls, folder: str | Path, about: About, *, resume: bool) -> Shards:
        """Begin or continue the results in a folder.

        Args:
            folder: The folder, which exists.
            about: What the shards belong to.
            resume: Whether to continue from shards that exist.

        Raises:
            HybridynError: The folder has shards and `resume` is false, or they are of another study.
            OSError: The folder cannot be written to.
        """
        folder = Path(folder)
        if shards_in(folder):
            if not resume:
                raise HybridynError(
                    f"{folder}: has results of an earlier sweep: continue them with resume=True, or choose "
                    "another folder"
                )
            for draft in folder.glob(".designs-*.tmp"):  # of a program that was killed
                draft.unlink(missing_ok=True)
            before = about_of(folder)
            if before.identity != about.identity:
                raise HybridynError(
                    f"{folder}: its results are of another study, or '{before.study}' or a file that it "
                    "names has changed: choose another folder"
                )
            return cls(folder, before)
        required("polars", "sweep", "a sweep")
        _write(folder / ABOUT, (json.dumps(asdict(about), indent=1) + "\n").encode())
        return cls(folder, about)

    def gaps(self) -> list[tuple[int, int]]:
        """Return the designs without a row: first number, and the number after the last."""
        out, at = [], 0
        for start, stop in [*sorted(self._done), (self.about.designs, self.about.designs)]:
            if start > at:
                out.append((at, start))
            at = max(at, stop)
        return out

    def write(self, rows: Sequence[Row]) -> None:
        """Write the rows of consecutive designs as one shard.

        Raises:
            OSError: The disk is full, or the folder is gone; the shard does not appear then.
        """
        start, stop = rows[0].design, rows[-1].design + 1
        columns = {
            name: list(values)
            for name, values in zip(self.about.columns, zip(*map(_cells, rows), strict=True), strict=True)
        }
        out = io.BytesIO()
        required("polars", "sweep", "a shard").DataFrame(columns, schema=_schema(columns)).write_parquet(out)
        seal = _seal(self.about, out.getvalue())
        _write(self.folder / f"designs-{start:09d}-{stop - 1:09d}-{seal}.parquet", out.getvalue())
        self._done.append((start, stop))


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


def read_shards(folder: str | Path, columns: Iterable[str] | None = None) -> Iterator[Columns]:
    """Read the shards of a folder one after the other, in the order of the designs.

    Args:
        columns: Columns to read; all by default.

    Yields:
        Columns by name: numbers as arrays, shape (designs,), nan for missing ones; texts as lists.

    Raises:
        HybridynError: A shard cannot be read, is not one that the sweep of the folder wrote, or has a design
            that the one before has.
    """
    about, after = about_of(folder), 0
    wanted = list(about.columns if columns is None else columns)
    for start, stop, file in shards_in(Path(folder)):
        try:
            content = file.read_bytes()
            if not file.stem.endswith(f"-{_seal(about, content)}"):
                raise ValueError("another study wrote it, or it has changed")
            if start < after:
                raise ValueError(f"the shard before it has design {start}, too")
            after = stop
            yield _read(file, content, wanted)
        except (OSError, ValueError, KeyError) as error:
            raise HybridynError(
                f"{file}: is no result of this sweep ({error}): remove it, and continue with resume=True"
            ) from error


def shards_in(folder: Path) -> list[tuple[int, int, Path]]:
    """Return the shards of a folder in order: first design, the number after the last, and the file.

    Args:
        folder: The folder, which need not exist.
    """
    names = os.listdir(folder) if folder.is_dir() else []
    matches = filter(None, map(_SHARD.fullmatch, names))
    return sorted((int(match[1]), int(match[2]) + 1, folder / match[0]) for match in matches)


def _seal(about: About, content: bytes) -> str:
    """Compute the digest of a shard: of its study and its bytes."""
    return hashlib.sha256(about.identity.encode() + content).hexdigest()[:16]


def _cells(row: Row) -> list[Any]:
    """Return the cells of a row; what is missing is None."""
    measures = [None if math.isnan(value) else value for value in row.measures]
    return [row.design, *row.values, row.status, *measures, row.message]


def _write(file: Path, content: bytes) -> None:
    """Write a file under another name, and rename it when it is complete."""
    draft = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        with naming(file), open(draft, "wb") as out:
            out.write(content)
            out.flush()
            os.fsync(out.fileno())
        os.replace(draft, file)
    finally:
        draft.unlink(missing_ok=True)


def _read(file: Path, content: bytes, wanted: list[str]) -> Columns:
    """Return columns of a shard's bytes."""
    polars = required("polars", "sweep", str(file))
    try:
        frame = polars.read_parquet(content, columns=wanted).select(wanted).fill_null(math.nan)
    except polars.exceptions.PolarsError as error:
        raise ValueError(str(error)) from error
    return {
        name: column.to_list() if column.dtype == polars.String else column.to_numpy().astype(float)
        for name, column in frame.to_dict().items()
    }


def _schema(columns: Iterable[str]) -> dict[str, Any]:
    """Return the types of a shard's columns."""
    polars = required("polars", "sweep", "a shard")
    kinds = {"design": polars.Int64, "status": polars.String, "message": polars.String}
    return {name: kinds.get(name, polars.Float64) for name in columns}
