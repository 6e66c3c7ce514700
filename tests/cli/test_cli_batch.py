"""Commands over a folder or a glob of tables: shards, errors that name the table, and lost processes."""

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from hybridyn.cli.common import batch
from hybridyn.studies.results_folder import RECORD, writing
from tests.studies.test_sweep import pendulum_in, pool_here
from tests.support.extras import needs
from tests.support.files import save


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a pendulum and four motions in `in`, the third of which is broken."""
    monkeypatch.chdir(tmp_path)
    pendulum_in(tmp_path)
    (tmp_path / "in").mkdir()
    header, *rows = (tmp_path / "swing.csv").read_text().splitlines()
    for i in range(4):
        lines = rows[: 10 + i] + (["1.0,nan,0,0"] if i == 2 else [])
        (tmp_path / "in" / f"t{i}.csv").write_text("\n".join([header, *lines]))
    return tmp_path


@pytest.fixture
def lost(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """Times that the process ends, by table; the test fills it."""
    times: dict[str, int] = {}

    def deaths(_: object, options: dict[str, str], *more: object) -> bool:
        name = Path(options["source"]).stem
        times[name] = times.get(name, 0) - 1
        return times[name] >= 0

    monkeypatch.setattr("hybridyn.cli.common.batch.open_pool", lambda *_: pool_here(deaths))
    return times


def shards(folder: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(Path(folder).glob("[!.]*.csv"))}


def test_each_table_has_its_shard_and_a_broken_one_is_named(
    place: Path, lost: dict[str, int], run: Any
) -> None:
    lost |= {"t1": 1}  # its process ends once
    words = ["idm", "pendulum.urdf", "in/*.csv", "-o", "out"]
    err = run(*words, status=1).err
    assert "error: in/t2.csv, row 13, column 'turn/position'" in err
    assert "3 tables of 4 in 'out', 3 computed now" in err
    assert list(shards("out")) == ["t0.csv", "t1.csv", "t3.csv"]
    for name, shard in shards("out").items():
        run("idm", "pendulum.urdf", f"in/{name}", "-o", name, "-q")
        assert Path(name).read_bytes() == shard
    assert "continue it with --resume" in run(*words, status=1).err
    Path("out", "t0.csv").unlink()
    (place / "in" / "t2.csv").write_text((place / "in" / "t1.csv").read_text())
    assert "4 tables of 4 in 'out', 2 computed now" in run(*words, "--resume").err
    said = run(*words, "--resume", "--effects", "none", status=1)
    assert "out: its results were computed with another '--effects': undo the change" in said.err


def test_a_shard_is_done_if_it_has_the_bytes_of_its_table(
    place: Path, lost: dict[str, int], run: Any
) -> None:
    """No newer file of another hand counts as done, and no older table that replaced the one computed."""
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "-o", "out"]
    run(*words)
    whole = shards("out")
    (place / "out" / "t0.csv").write_text("another's\n")
    (place / "in" / "t1.csv").write_text((place / "in" / "t3.csv").read_text())
    os.utime(place / "in" / "t1.csv", (0, 0))
    os.utime(place / "in" / "t3.csv")  # newer than its shard, and the same
    assert "3 tables of 3 in 'out', 2 computed now" in run(*words, "--resume").err
    assert shards("out") == {**whole, "t1.csv": whole["t3.csv"]}
    assert "3 tables of 3 in 'out', 0 computed now" in run(*words, "--resume").err


#: Computes the tables of a folder, and is killed in the middle of the second.
KILLED = """
import os, signal, sys
from hybridyn.cli import main
from hybridyn.cli.common import batch

compute = batch.one_table

def killed(command, words):
    if "t1" in words["source"]:
        open(words["output"], "w").write("half a ro")
        os.kill(os.getpid(), signal.SIGKILL)
    return compute(command, words)

batch.one_table = killed
main(sys.argv[1:])
"""


def test_a_killed_program_is_continued(place: Path, lost: dict[str, int], run: Any) -> None:
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "-o"]
    ended = subprocess.run([sys.executable, "-c", KILLED, *words, "out", "-j", "1"], check=False)
    assert ended.returncode == -signal.SIGKILL
    assert list(shards("out")) == ["t0.csv"]
    assert "3 tables of 3 in 'out', 2 computed now" in run(*words, "out", "--resume").err
    run(*words, "whole")
    assert shards("out") == shards("whole")
    assert not list(place.glob("out/.*"))


def test_errors_name_the_shard_and_no_draft(place: Path, lost: dict[str, int], run: Any) -> None:
    (place / "in" / "t1.csv").rename(place / "in" / "t1.txt")
    err = run("idm", "pendulum.urdf", "in/*.txt", "-o", "out", status=1).err
    assert "error: in/t1.txt: out/t1.txt: a result file ends in .csv or .parquet" in err


def test_a_worker_knows_its_run(
    place: Path, lost: dict[str, int], run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Begin another run where the first one was killed before its worker has a result."""
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "-o", "out"]
    compute = batch.one_table

    def meanwhile(*task: Any) -> int:
        record = Path("out", RECORD)
        record.write_text(record.read_text().replace('"command": "', '"command": "other '))
        return compute(*task)

    monkeypatch.setattr(batch, "one_table", meanwhile)
    assert "another run has begun here" in run(*words, status=1).err
    assert not shards("out")


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (["--gravity", "0,0,-1"], "--gravity"),
        (["--passive", "solved"], "--passive"),
        (None, "pendulum.urdf"),
    ],
)
def test_another_robot_or_option_is_named(
    place: Path, lost: dict[str, int], run: Any, change: list[str] | None, what: str
) -> None:
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "-o", "out"]
    run(*words)
    if change is None:
        robot = place / "pendulum.urdf"
        robot.write_text(robot.read_text().replace('"0.1"', '"0.2"'))
    said = f"out: its results were computed with another '{what}': undo the change, or choose another folder"
    assert said in run(*words, "--resume", *(change or ()), status=1).err
    said = "out: has results of another command: choose another folder"
    assert said in run("ddm", *words[1:], "--resume", status=1).err


@pytest.mark.parametrize("name", ["\u684c" * 80, "t" * 240])
def test_tables_may_have_long_names_and_move_with_their_robot(
    place: Path, lost: dict[str, int], run: Any, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Systems allow 255 bytes."""
    (place / "in" / "t1.csv").rename(place / "in" / f"{name}.csv")
    words = ["idm", str(place / "pendulum.urdf"), f"in/{name[0]}*.csv", "-o", "out", "--resume"]
    (place / "in" / "t2.csv").unlink()
    assert "computed now" in run(*words).err
    assert f"{name}.csv" in shards("out")
    (place / "moved").mkdir()
    for part in ("in", "out", "pendulum.urdf"):
        (place / part).rename(place / "moved" / part)
    monkeypatch.chdir(place / "moved")
    words[1] = str(place / "moved" / "pendulum.urdf")
    assert ", 0 computed now" in run(*words).err


def test_a_table_of_another_hand_is_never_replaced(place: Path, lost: dict[str, int], run: Any) -> None:
    shard = save(place / "out", "another's", "t[1].csv")
    (place / "in" / "t1.csv").rename(place / "in" / "t[1].csv")
    for more in ([], ["--resume"]):
        err = run("idm", "pendulum.urdf", "in/*.csv", "-o", "out", *more, status=1).err
        assert "out: has 't[1].csv', of which it has no record: choose another folder" in err
    assert shard.read_text() == "another's"
    run("idm", "pendulum.urdf", "in/t[03].csv", "-o", "out")
    err = run("idm", "pendulum.urdf", "in/*.csv", "-o", "out", "--resume", status=1).err
    assert "out: has 't[1].csv', of which it has no record: choose another folder" in err


def test_a_folder_belongs_to_one_process(place: Path, lost: dict[str, int], run: Any) -> None:
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "-o", "out"]
    with writing("out", {}, {}, [], resume=False):
        assert "out: another process writes its results here" in run(*words, status=1).err
    run(*words)


def test_a_table_that_ends_every_process_is_named(place: Path, lost: dict[str, int], run: Any) -> None:
    lost |= {"t3": 10}
    said = run("idm", "--loads", "pendulum.urdf", "in/t[013].csv", "-o", "out", status=1)
    assert "error: in/t3.csv: its process ended without a result 2 times" in said.err
    assert list(shards("out")) == ["t0.csv", "t1.csv"]
    assert [line for line in said.out.splitlines() if line.startswith("in/")] == ["in/t0.csv:", "in/t1.csv:"]


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["in/*.csv"], 2, "several tables need a folder for their shards"),
        (["in", "-o", "out"], 2, "'in/*.parquet' matches no table; others by a glob: 'in/*.csv'"),
        (["in/*.csv", "-o", "in"], 2, "'in/t0.csv', the shard of 'in/t0.csv', would replace a table"),
        (["**/*.csv", "-o", "out"], 2, "'out/t0.csv', the shard of 'in/t0.csv', would replace that of 'a/"),
        (["swing.csv", "--resume"], 2, "--resume belongs to several tables"),
        (["in/*.csv", "-o", "out", "--plot", "x.png"], 2, "--plot belongs to a single table"),
        (["swing.csv", "-o", "out"], 2, "a result file ends in .csv or .parquet"),
    ],
)  # fmt: skip
def test_wrong_words_are_one_line(place: Path, run: Any, words: list[str], status: int, said: str) -> None:
    save(place / "a", "", "t0.csv")
    assert said in run("idm", "pendulum.urdf", *words, status=status).err
    assert not list(place.glob("out/*"))


@pytest.mark.slow
def test_other_processes_write_the_same_bits(place: Path, run: Any) -> None:
    polars = needs("sweep") and needs("io")
    for path in place.glob("in/t[013].csv"):
        polars.read_csv(path).write_parquet(path.with_suffix(".parquet"))
    run("idm", "pendulum.urdf", "in", "-o", "out", "-j", "2")
    for path in sorted(place.glob("in/*.parquet")):
        run("idm", "pendulum.urdf", path, "-o", "one.parquet", "-q")
        assert polars.read_parquet("one.parquet").equals(polars.read_parquet(f"out/{path.name}"))
