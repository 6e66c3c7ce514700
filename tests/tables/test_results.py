"""Writing tables: exact numbers, as short as they can be, and a file that is complete or not there."""

import stat
import sys
from pathlib import Path

import numpy as np
import pytest

from hybridyn.errors import TrajectoryError
from hybridyn.spatial import Array
from hybridyn.tables.opening import open_table
from hybridyn.tables.results import check_target, csv_text, open_results
from tests.comparing import refused
from tests.extras import needs
from tests.files import save

NUMBERS = np.array([[0.1, -0.0], [1.0 / 3.0, 5e-324], [1.7976931348623157e308, -123456789.123456789]])


@pytest.mark.parametrize("name", ["out.csv", "out.parquet"])
def test_numbers_come_back_bit_for_bit(tmp_path: Path, name: str) -> None:
    if name.endswith(".parquet"):
        needs("io")
    path = tmp_path / name
    with open_results(path, ["time", "a, b/effort"]) as write:
        write(NUMBERS[:2])
        assert not path.exists()
        write(NUMBERS[2:])
    with open_table(path) as table:
        assert table.columns == ("time", "a, b/effort")
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
    refused(lambda: check_target(tmp_path / "out.parquet"), TrajectoryError, r"hybridyn\[io\]")


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
