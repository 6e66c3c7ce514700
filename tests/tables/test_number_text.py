"""Numbers as text, all at once: the characters of `repr`."""

from __future__ import annotations

import numpy as np
import pytest

from hybridyn.spatial import Array
from hybridyn.tables.number_text import csv_text
from tests.samples import slow

SPECIAL = [
    0.0,
    -0.0,
    np.nan,
    np.inf,
    -np.inf,
    5e-324,
    1.7976931348623157e308,
    1e22,
    123456.0,
    0.1,
    1e-4,
    1e15,
]


def numbers(kind: str, n: int) -> Array:
    """Return n numbers of a kind whose shortest decimals differ."""
    rng = np.random.default_rng(7)
    exponents = rng.integers(-8, 19, n)
    match kind:
        case "bits":
            return rng.integers(0, 2**64, n, dtype=np.uint64).view(float)
        case "sizes":
            return np.asarray(rng.normal(size=n) * 10.0 ** rng.uniform(-6, 18, n))
        case "few digits":
            pairs = zip(rng.integers(1, 18, n).tolist(), rng.normal(size=n) * 10.0**exponents, strict=True)
            return np.array([float(f"{x:.{digits}g}") for digits, x in pairs])
        case "whole":
            return rng.integers(-(2**60), 2**60, n) // 2 ** rng.integers(0, 60, n) * 1.0
        case "powers":
            base = rng.choice([2.0, 10.0], n) ** exponents
            return np.asarray(np.nextafter(base, rng.choice([0.0, 1.0, np.inf], n) * base))
        case _:
            return np.resize(np.array(SPECIAL), n)


@pytest.mark.parametrize("n", [600, slow(600_000)])
@pytest.mark.parametrize("kind", ["bits", "sizes", "few digits", "whole", "powers", "special"])
def test_numbers_are_written_as_repr_writes_them(kind: str, n: int) -> None:
    rows = numbers(kind, n).reshape(-1, 6)
    with np.errstate(all="raise"):
        text = csv_text(rows)
    assert text == "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())


def test_rows_without_numbers_and_columns_of_a_larger_table() -> None:
    table = np.arange(12.0).reshape(3, 4)
    assert csv_text(table[:0]) == ""
    assert csv_text(table[:2, :0]) == "\n\n"
    assert csv_text(table[:, 1:2]) == "1.0\n5.0\n9.0\n"
    assert csv_text(np.zeros((1, 20_000))) == ",".join(["0.0"] * 20_000) + "\n"
