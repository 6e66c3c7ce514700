"""Reading tables: what a CSV or Parquet file may look like, and one test per way it can be wrong."""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.errors import TrajectoryError
from hybridyn.tables.csv_table import LINE_LIMIT
from hybridyn.tables.opening import open_table
from tests.comparing import refused


def write(path: Path, text: str | bytes) -> Path:
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def read(path: Path, block_rows: int = 2000) -> tuple[tuple[str, ...], np.ndarray]:
    with open_table(path, block_rows=block_rows) as table:
        return table.columns, np.concatenate([block.values for block in table.blocks])


def refusal(path: Path) -> TrajectoryError:
    caught = refused(lambda: read(path), TrajectoryError, "", file=str(path))
    assert str(path) in str(caught)
    return caught


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n1,2.5\n-3e2,+.5\n",
        "a,b\r\n1,2.5\r\n-3e2,+.5\r\n",
        "\ufeffa,b\n1,2.5\n-3e2,+.5",
        "a;b\n1;2.5\n-3e2;+.5\n",
        "a\tb\n1\t2.5\n-3e2\t+.5\n",
        '"a", "b"\n"1", 2.5\n-3e2,"+.5"\n',
        "# a remark\na,b\n# another\n1,2.5\n-3e2,+.5\n\n\n",
        " a , b \n 1 , 2.5 \n -3e2 , +.5 \n",
    ],
    ids=["plain", "crlf", "bom", "semicolon", "tab", "quotes", "comments", "spaces"],
)
def test_reads_the_csv_files_that_programs_write(tmp_path: Path, text: str) -> None:
    columns, values = read(write(tmp_path / "t.csv", text))
    assert columns == ("a", "b")
    assert values.tolist() == [[1.0, 2.5], [-300.0, 0.5]]


@pytest.mark.parametrize(
    "cell",
    ["-0", "-0.0", "+1", "1.", ".5", "007", "1e5", "2E-3", " 3", "4 ", "5e-324", "9007199254740993", "1" * 30]
    + [
        repr(x) for x in np.random.default_rng(1).integers(0, 2**62, 20, dtype=np.uint64).view(float).tolist()
    ],
)
def test_cells_have_the_bits_that_python_reads(tmp_path: Path, cell: str) -> None:
    """Cells that JSON knows are read as JSON, the others by `float`."""
    for row in (f"{cell},0.1", f"0.1,{cell}"):
        values = read(write(tmp_path / "t.csv", f"a,b\n{row}\n"))[1]
        assert values.tobytes() == np.array([float(x) for x in row.split(",")]).tobytes()


@pytest.mark.parametrize("block_rows", [1, 3, 10, 1000])
def test_blocks_hold_every_row_once_and_know_their_number(tmp_path: Path, block_rows: int) -> None:
    numbers = np.arange(20.0).reshape(10, 2)
    path = write(tmp_path / "t.csv", "a,b\n" + "".join(f"{x},{y}\n" for x, y in numbers))
    with open_table(path, block_rows=block_rows) as table:
        blocks = list(table.blocks)
    assert np.array_equal(np.concatenate([block.values for block in blocks]), numbers)
    assert [block.first_row for block in blocks] == list(range(1, 11, block_rows))
    assert all(len(block.values) <= block_rows for block in blocks)


@pytest.mark.parametrize(
    ("cell", "words"),
    [
        ("nan", "not a finite number"),
        ("-inf", "not a finite number"),
        ("1e400", "not a finite number"),
        ("", "empty"),
        ("  ", "empty"),
        ("fast", "not a number"),
        ("1_000", "not a number"),
        ("٣", "not a number"),
        ("0x10", "not a number"),
        ("1 2", "not a number"),
        ("1e", "not a number"),
        ("\x00", "not a number"),
    ],
)
def test_names_the_cell_that_is_not_a_finite_number(tmp_path: Path, cell: str, words: str) -> None:
    error = refusal(write(tmp_path / "t.csv", f"a,b\n1,2\n3,{cell}\n5,6\n"))
    assert (error.row, error.column) == (2, "b")
    assert words in str(error)


def test_advises_on_decimal_commas(tmp_path: Path) -> None:
    error = refusal(write(tmp_path / "t.csv", "a;b\n1,5;2\n"))
    assert (error.row, error.column) == (1, "a")
    assert "decimal point" in str(error)


@pytest.mark.parametrize("row", ["1", "1,2,3", "1,2,"])
def test_refuses_ragged_rows(tmp_path: Path, row: str) -> None:
    error = refusal(write(tmp_path / "t.csv", f"a,b\n1,2\n{row}\n"))
    assert error.row == 2
    assert "cells" in str(error)


def test_refuses_an_empty_line_between_rows(tmp_path: Path) -> None:
    error = refusal(write(tmp_path / "t.csv", "a,b\n1,2\n\n3,4\n"))
    assert error.row == 2
    assert "empty line" in str(error)


@pytest.mark.parametrize(
    ("header", "words", "column"),
    [
        ("a,a", "twice", "a"),
        ("a,", "column 2 of the header has no name", None),
        ("a,1.5", "first line must name", None),
        ("a,b\x07", "unprintable", None),
    ],
)
def test_checks_the_header_before_any_number(
    tmp_path: Path, header: str, words: str, column: str | None
) -> None:
    path = write(tmp_path / "t.csv", f"{header}\nnot,numbers\n")
    refused(lambda: open_table(path), TrajectoryError, words, column=column)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "empty"),
        (b"\n\n", "empty"),
        (b"a,b\n", "no rows"),
        ("a,b\n1,2\n".encode("utf-16"), "not UTF-8"),
        (b"\x1f\x8b\x08\x00\xff", "not UTF-8"),
    ],
)
def test_refuses_files_that_are_no_tables(tmp_path: Path, content: bytes, words: str) -> None:
    assert words in str(refusal(write(tmp_path / "t.csv", content)))


def test_refuses_absurdly_long_lines(tmp_path: Path) -> None:
    assert "longer than" in str(refusal(write(tmp_path / "t.csv", "a" * (LINE_LIMIT + 1))))


@pytest.mark.parametrize("name", ["missing.csv", "missing.parquet", "."])
def test_refuses_what_cannot_be_opened(tmp_path: Path, name: str) -> None:
    assert "cannot be read" in str(refusal(tmp_path / name))


def test_tells_how_far_it_is(tmp_path: Path) -> None:
    path = write(tmp_path / "t.csv", "a\n" + "1.0\n" * 100_000)
    with open_table(path) as table:
        next(table.blocks)
        assert 0.0 < table.fraction() < 0.5
        assert sum(1 for _ in table.blocks) == 49
        assert table.fraction() == 1.0


def test_memory_does_not_grow_with_the_table(tmp_path: Path) -> None:
    import tracemalloc

    path = write(tmp_path / "t.csv", "a,b\n" + "1.0,2.0\n" * 50_000)
    tracemalloc.start()
    with open_table(path, block_rows=500) as table:
        for _ in table.blocks:
            pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 500_000  # the table as floats alone is 800 kB, as Python text far more
