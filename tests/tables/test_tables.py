"""Reading and writing tables: what files look like, each way of being wrong, numbers bit by bit."""

import csv
import stat
import sys
from pathlib import Path

import numpy as np
import pytest

from hybridyn.errors import HybridynError, TrajectoryError
from hybridyn.spatial import Array
from hybridyn.tables.opening import open_table
from hybridyn.tables.results import check_target, csv_text, open_results
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save


def read(path: Path, block_rows: int = 2000) -> tuple[tuple[str, ...], np.ndarray]:
    with open_table(path, block_rows=block_rows) as table:
        return table.columns, np.concatenate([block.values for block in table.blocks])


def refusal(path: Path, words: str) -> TrajectoryError:
    error: TrajectoryError = refused(lambda: read(path), TrajectoryError, words, file=str(path))
    assert str(path) in str(error)
    return error


@pytest.mark.parametrize(
    "text",
    [
        "a,b\n1,2.5\n-3e2,+.5\n",
        "a,b\r\n1,2.5\r\n-3e2,+.5\r\n",
        "\ufeffa,b\n1,2.5\n-3e2,+.5",
        "a;b\n1;2.5\n-3e2;+.5\n",
        "a\tb\n1\t2.5\n-3e2\t+.5\n",
        '"a", "b"\n"1", 2.5\n-3e2,"+.5"\n',
        "# a remark\na,b\n# another\n1,2.5\n\n-3e2,+.5\n\n\n",
        " a , b \n 1 , 2.5 \n -3e2 , +.5 \n",
    ],
    ids=["plain", "crlf", "bom", "semicolon", "tab", "quotes", "comments", "spaces"],
)
def test_reads_the_csv_files_that_programs_write(tmp_path: Path, text: str) -> None:
    columns, values = read(save(tmp_path, text, "t.csv"))
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
        values = read(save(tmp_path, f"a,b\n{row}\n"))[1]
        assert values.tobytes() == np.array([float(x) for x in row.split(",")]).tobytes()


@pytest.mark.parametrize("ending", ["csv", "parquet"])
@pytest.mark.parametrize("block_rows", [1, 3, 10, 100_000])
def test_blocks_hold_every_row_once_and_know_their_number(
    tmp_path: Path, block_rows: int, ending: str
) -> None:
    path = save(tmp_path, "a,b\n" + "".join(f"{x},{x / 3!r}\n" for x in range(10)), "t.csv")
    if ending == "parquet":
        path = path.with_suffix(".parquet")
        needs("io").read_csv(tmp_path / "t.csv").write_parquet(path)
    with open_table(path, block_rows=block_rows) as table:
        assert table.columns == ("a", "b")
        assert table.rows == 10
        blocks = list(table.blocks)
    values = np.concatenate([block.values for block in blocks])
    assert values.tolist() == [[float(x), x / 3] for x in range(10)]
    assert [block.first_row for block in blocks] == list(range(1, 11, block_rows))
    assert all(len(block.values) <= block_rows for block in blocks)


#: A table, row and column of what is wrong in it, and what is told.
REFUSED: list[tuple[str | bytes, int | None, str | None, str]] = [
    *(
        (f"a,b\n1,2\n3,{cell}\n5,6\n", 2, "b", words)
        for cells, words in (
            (("nan", "-inf", "1e400"), "not a finite number"),
            (("", "  "), "empty"),
            (("fast", "1_000", "٣", "0x10", "1 2", "1e", "\x00"), "not a finite number"),
        )
        for cell in cells
    ),
    ("a;b\n1,5;2\n", 1, "a", "decimal point"),
    *((f"a,b\n1,2\n{row}\n", 2, None, "cells") for row in ("1", "1,2,3", "1,2,")),
    ("a,a\nnot,numbers\n", None, "a", "twice"),
    ("a,\nnot,numbers\n", None, None, "column 2 of the header has no name"),
    ("a,b\x07\nnot,numbers\n", None, None, "no name that can be printed"),
    ("a,1.5\nnot,numbers\n", None, None, "first line must name"),
    (b"", None, None, "empty"),
    (b"\n\n", None, None, "empty"),
    (b"a,b\n", None, None, "no rows"),
    ("a,b\n1,2\n".encode("utf-16"), None, None, "not UTF-8"),
    (b"\x1f\x8b\x08\x00\xff", None, None, "not UTF-8"),
    ("a b\n1 2\n", None, None, "write commas"),
]


@pytest.mark.parametrize(("content", "row", "column", "words"), REFUSED, ids=range(len(REFUSED)))
def test_what_is_wrong_is_named_with_its_place(
    tmp_path: Path, content: str | bytes, row: int | None, column: str | None, words: str
) -> None:
    """The header is checked before any number."""
    error = refusal(save(tmp_path, content, "t.csv"), words)
    assert (error.row, error.column) == (row, column)


@pytest.mark.parametrize("name", ["missing.csv", "missing.parquet", "."])
def test_refuses_what_cannot_be_opened(tmp_path: Path, name: str) -> None:
    refusal(tmp_path / name, "cannot be read")


def test_estimates_its_rows_from_its_size(tmp_path: Path) -> None:
    with open_table(save(tmp_path, "a\n" + "1.0\n" * 10 + "0.123\n" * 100_000)) as table:
        assert table.rows == pytest.approx(100_010, rel=0.05)


def test_memory_does_not_grow_with_the_table(tmp_path: Path) -> None:
    import tracemalloc

    path = save(tmp_path, "a,b\n" + "1.0,2.0\n" * 20_000)
    tracemalloc.start()
    with open_table(path, block_rows=500) as table:
        for _ in table.blocks:
            pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 200_000  # the table as floats alone is 320 kB, as Python text far more


NUMBERS = np.array([[0.1, -0.0], [1.0 / 3.0, 5e-324], [1.7976931348623157e308, -123456789.123456789]])


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_numbers_come_back_bit_for_bit(tmp_path: Path, name: str) -> None:
    if name.endswith(".parquet"):
        needs("io")
    path = tmp_path / name
    with open_results(path, ["time", "a b/effort"]) as write:
        write(NUMBERS[:2])
        assert not path.exists()
        write(NUMBERS[2:])
    with open_table(path) as table:
        assert table.columns == ("time", "a b/effort")
        values = next(table.blocks).values
    assert values.tobytes() == NUMBERS.tobytes()
    assert [file.name for file in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_error_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, name: str, error: type[BaseException]
) -> None:
    if name.endswith(".parquet"):
        needs("io")
    path = save(tmp_path, "old", name)

    def interrupted() -> None:
        with open_results(path, ["a", "b"]) as write:
            write(NUMBERS)
            raise error

    refused(interrupted, error, "")
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == [name]


def test_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    with open_results(None, ["a", "b"]) as write:
        write(NUMBERS[:1])
    assert capsys.readouterr().out == "a,b\n0.1,-0.0\n"


def test_writes_into_a_device_and_never_replaces_it() -> None:
    with open_results("/dev/null", ["a", "b"]) as write:
        write(NUMBERS)
    assert stat.S_ISCHR(Path("/dev/null").stat().st_mode)


def test_follows_a_link(tmp_path: Path) -> None:
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    with open_results(tmp_path / "link.csv", ["a", "b"]) as write:
        write(NUMBERS)
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text().startswith("a,b\n")


@pytest.mark.parametrize(
    ("name", "words"),
    [("out.txt", "ends in"), ("out", "ends in"), ("no/out.csv", "does not exist"), ("d.csv", "is a folder")],
)
def test_refuses_a_bad_target_before_any_work(tmp_path: Path, name: str, words: str) -> None:
    (tmp_path / "d.csv").mkdir()
    refused(lambda: check_target(tmp_path / name), TrajectoryError, words)


def test_parquet_needs_polars(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "polars", None)
    refused(lambda: check_target(tmp_path / "out.parquet"), HybridynError, r"hybridyn\[io\]")


# -------------------- numbers as text


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


def test_a_table_begins_with_its_header(tmp_path: Path) -> None:
    """Readers of others find the columns: nothing stands before them."""
    with open_results(tmp_path / "out.csv", ["time", "a"]) as write:
        write(np.array([[0.0, 1.5]]))
    with open(tmp_path / "out.csv", newline="") as text:
        assert [*csv.DictReader(text)] == [{"time": "0.0", "a": "1.5"}]
