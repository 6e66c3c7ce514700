"""Parquet tables: the same rules as for CSV."""

import re
import sys
from pathlib import Path

import numpy as np
import pytest

from hybridyn.errors import HybridynError, TrajectoryError, install_advice
from hybridyn.tables.opening import open_table
from hybridyn.tables.results import open_results
from tests.support.comparing import refused
from tests.support.extras import needs

pl = needs("io")


def saved(tmp_path: Path, columns: dict[str, object]) -> Path:
    path = tmp_path / "t.parquet"
    pl.DataFrame(columns).write_parquet(path)
    return path


def refusal(path: Path, words: str = "", **place: object) -> None:
    """Check that a table is refused with some words, and with row and column."""

    def read() -> None:
        with open_table(path) as table:
            list(table.blocks)

    refused(read, TrajectoryError, words, file=str(path), **place)


@pytest.mark.parametrize(
    ("columns", "words", "place"),
    [
        *(
            ({"a": [1.0, 2.0, 3.0], "b": [1.0, 2.0, cell]}, words, {"row": 3, "column": "b"})
            for cell, words in ((None, "empty"), (np.nan, "not a finite"), (np.inf, "not a finite"))
        ),
        ({"a": [1.0], "b": ["x"]}, "numbers", {"column": "b"}),
        ({"a": pl.Series([], dtype=pl.Float64)}, "no rows", {}),
    ],
)
def test_what_is_no_table_of_finite_numbers_is_refused(
    tmp_path: Path, columns: dict[str, object], words: str, place: dict[str, object]
) -> None:
    refusal(saved(tmp_path, columns), words, **place)


@pytest.mark.parametrize("damage", ["text", "truncated", "flipped"])
def test_refuses_damaged_files(tmp_path: Path, damage: str) -> None:
    path = saved(tmp_path, {"a": [float(x) for x in range(1000)]})
    content = path.read_bytes()
    middle = len(content) // 2
    flipped = content[:-20] + bytes(byte ^ 255 for byte in content[-20:-8]) + content[-8:]
    path.write_bytes({"text": b"a,b\n1,2\n", "truncated": content[:middle], "flipped": flipped}[damage])
    refusal(path)


def test_says_what_to_install_without_polars(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path, {"a": [1.0]})
    monkeypatch.setitem(sys.modules, "polars", None)
    refused(open_table(path).__enter__, HybridynError, re.escape(install_advice("io")))


@pytest.mark.parametrize("rows", [0, 1, 120_000])
def test_writes_what_it_is_given(tmp_path: Path, rows: int) -> None:
    folder = tmp_path / "odd [1] name"
    folder.mkdir()
    path = folder / "t.parquet"
    numbers = np.random.default_rng(0).normal(size=(rows, 2))
    numbers[:1] = np.nan, -np.inf
    with open_results(path, ["a, b", 'b/"c"']) as write:
        for start in range(0, rows, 7_000):
            write(numbers[start : start + 7_000])
    frame = pl.read_parquet(path, glob=False)
    assert frame.columns == ["a, b", 'b/"c"']
    assert np.array_equal(frame.to_numpy(), numbers, equal_nan=True)
    assert list(folder.iterdir()) == [path]
