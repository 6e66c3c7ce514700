"""Numbers of results as text: the shortest decimals, which read as the same bits."""

from __future__ import annotations

import numpy as np
import pytest

from hybridyn.spatial import Array
from hybridyn.tables.results import csv_text

SPECIAL = [0.0, -0.0, 5e-324, 1.7976931348623157e308, 1e22, 1e-7, 123456.0, 0.1, 1e15, 1e16, 2.0**53 + 2]


def read_back(text: str) -> Array:
    return np.array([[float(number) for number in line.split(",")] for line in text.splitlines()])


@pytest.mark.parametrize("unknown", [[], [np.nan, np.inf, -np.inf, 1e-7]])
def test_numbers_read_back_as_the_same_bits_and_are_as_short_as_repr(unknown: list[float]) -> None:
    drawn = np.random.default_rng(7).integers(0, 2**64, 3000, dtype=np.uint64).view(float)
    rows = np.resize(np.array([*SPECIAL, *drawn[np.isfinite(drawn)], *unknown]), (600, 6))
    text = csv_text(rows)
    assert read_back(text).tobytes() == rows.tobytes()
    assert len(text) <= sum(len(repr(x)) + 1 for x in rows.ravel().tolist())


def test_rows_without_numbers_columns_of_a_larger_table_and_integers() -> None:
    table = np.arange(12.0).reshape(3, 4)
    assert csv_text(table[:0]) == ""
    assert csv_text(table[:2, :0]) == "\n\n"
    assert csv_text(table[:, 1:2]) == "1.0\n5.0\n9.0\n"
    assert csv_text(table[:2, ::2].astype(int)) == "0.0,2.0\n4.0,6.0\n"
