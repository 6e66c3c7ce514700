"""Reading tables: what a CSV or Parquet file may look like, and one test per way it can be wrong."""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.errors import TrajectoryError
from hybridyn.tables.csv_table import LINE_LIMIT
from hybridyn.tables.opening import open_table
from tests.comparing import refused
from tests.extras import needs
from tests.files import save


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
        "# a remark\na,b\n# another\n1,2.5\n-3e2,+.5\n\n\n",
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
        blocks = list(table.blocks)
        assert table.fraction() == 1.0
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
            (("fast", "1_000", "٣", "0x10", "1 2", "1e", "\x00"), "not a number"),
        )
        for cell in cells
    ),
    ("a;b\n1,5;2\n", 1, "a", "decimal point"),
    *((f"a,b\n1,2\n{row}\n", 2, None, "cells") for row in ("1", "1,2,3", "1,2,")),
    ("a,b\n1,2\n\n3,4\n", 2, None, "empty line"),
    ("a,a\nnot,numbers\n", None, "a", "twice"),
    ("a,\nnot,numbers\n", None, None, "column 2 of the header has no name"),
    ("a,1.5\nnot,numbers\n", None, None, "first line must name"),
    ("a,b\x07\nnot,numbers\n", None, None, "unprintable"),
    (b"", None, None, "empty"),
    (b"\n\n", None, None, "empty"),
    (b"a,b\n", None, None, "no rows"),
    ("a,b\n1,2\n".encode("utf-16"), None, None, "not UTF-8"),
    (b"\x1f\x8b\x08\x00\xff", None, None, "not UTF-8"),
    ("a" * (LINE_LIMIT + 1), None, None, "longer than"),
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


def test_tells_how_far_it_is(tmp_path: Path) -> None:
    path = save(tmp_path, "a\n" + "1.0\n" * 100_000)
    with open_table(path) as table:
        next(table.blocks)
        assert 0.0 < table.fraction() < 0.5
        assert sum(1 for _ in table.blocks) == 49
        assert table.fraction() == 1.0


def test_memory_does_not_grow_with_the_table(tmp_path: Path) -> None:
    import tracemalloc

    path = save(tmp_path, "a,b\n" + "1.0,2.0\n" * 50_000)
    tracemalloc.start()
    with open_table(path, block_rows=500) as table:
        for _ in table.blocks:
            pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 500_000  # the table as floats alone is 800 kB, as Python text far more
