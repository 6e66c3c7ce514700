"""Several processes for one table: the same numbers in order, the same errors, nothing left behind."""

import os
import pickle
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from threading import Thread
from typing import TextIO

import numpy as np
import pytest

import hybridyn
from hybridyn.cli.common.table_pass import LONG_FOR_COMPILED, _processes
from hybridyn.errors import AssemblyError, HybridynError, TrajectoryError
from hybridyn.streams import one_pass
from hybridyn.streams.one_pass import rows_at_once
from hybridyn.streams.workers import Workers
from hybridyn.tables.opening import open_table
from tests import ROOT
from tests.support.command_line import program, table_text
from tests.support.comparing import refused
from tests.support.files import save
from tests.support.samples import slow
from tests.support.waiting import PATIENCE, wait_until

FIVE_BAR = ROOT / "urdf/five_bar.urdf.xacro"


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(one_pass, "MOST_ROWS", 130)


def periodic_table() -> tuple[list[str], np.ndarray]:
    """Return header and rows of one turn of the five-bar's trajectory."""
    with open_table(ROOT / "models/five_bar/traj.csv") as table:
        return list(table.columns), next(table.blocks).values[:-1]


def table_of(path: Path, count: int = 1000) -> np.ndarray:
    """Write so many rows of the five-bar's trajectory, and give them."""
    header, rows = periodic_table()
    path.write_text(table_text(header, rows[:count]))
    return rows[:count]


# -------------------------------------------------------------------- the whole program


def test_the_same_numbers_as_one_process(run, tmp_path: Path, small_blocks) -> None:
    path = tmp_path / "traj.csv"
    table_of(path, 150)
    found = []
    for jobs in (1, 2):
        words = ["-o", tmp_path / f"{jobs}.csv", "--reactions", tmp_path / f"{jobs}r.csv", "--jobs", jobs]
        said = run("idm", FIVE_BAR, path, *words)
        assert ("in 2 processes" in said.err) == (jobs == 2)
        found.append([(tmp_path / f"{jobs}{end}.csv").read_bytes() for end in ("", "r")])
    assert found[0] == found[1]


@pytest.mark.slow
def test_the_same_bits_for_a_robot_of_many_modules(run, tmp_path: Path, monkeypatch) -> None:
    """Its first block begins at home in both, but travels to another process packed."""
    monkeypatch.setattr(one_pass, "MOST_ROWS", 10)
    lines = (ROOT / "models/lx4/traj.csv").read_text().splitlines()
    path = save(tmp_path, "\n".join(lines[:27]), "traj.csv")
    one, two = (run("idm", "lx4", path, "-j", jobs, "--engine", "general").out for jobs in (1, 2))
    assert one.count("\n") > 20
    assert one == two


@pytest.mark.parametrize(
    ("row", "jobs"),
    [(1, 1), (131, 1), (1000, 1), (500, 2), slow(1, 2), slow(131, 2), slow(1000, 2), slow(500, 1)],
)
def test_errors_name_the_row_and_leave_nothing(run, tmp_path: Path, small_blocks, row, jobs) -> None:
    """Out of reach there: the arms would have to be longer."""
    path = tmp_path / "traj.csv"
    rows = table_of(path)
    header = path.read_text().splitlines()[0].split(",")
    rows[row - 1 :, 1] += 2e4
    path.write_text(table_text(header, rows))
    said = run("idm", FIVE_BAR, path, "-o", tmp_path / "out.csv", "--jobs", jobs, status=1)
    assert said.err.startswith(f"error: {path}, row {row} (t = {rows[row - 1, 0]:.6g} s): "), said.err
    assert [entry.name for entry in tmp_path.iterdir()] == ["traj.csv"]


def test_a_table_that_goes_wrong_later_on(run, tmp_path: Path, small_blocks, one_process) -> None:
    path = tmp_path / "traj.csv"
    table_of(path, 300)
    lines = path.read_text().splitlines()
    lines[290] = lines[290].replace(",", ",x", 1)
    path.write_text("\n".join(lines))
    run("idm", FIVE_BAR, path, "-o", tmp_path / "out.csv", "--jobs", 2, status=1, says="row 290")
    assert [entry.name for entry in tmp_path.iterdir()] == ["traj.csv"]


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


@contextmanager
def under_way(folder: Path) -> Iterator[tuple[subprocess.Popen[str], list[int]]]:
    """Run the inverse model in two processes on a table that never ends; give it and its processes.

    What was computed goes to `out.csv`, of which a draft stands in the folder.
    """
    header, rows = periodic_table()
    words = ("idm", FIVE_BAR, "-", "-o", folder / "out.csv", "--jobs", "2")
    with program(*words, stdin=subprocess.PIPE, start_new_session=True) as process:
        feeder = Thread(target=feed, args=(process.stdin, header, rows))
        feeder.start()
        try:
            wait_until(lambda: bool(list(folder.glob(".out.csv.*"))), "a draft of the output")
            wait_until(lambda: len(offspring(process.pid)) == 2, "two processes")
            yield process, offspring(process.pid)
        finally:
            process.kill()
            feeder.join()


def feed(pipe: TextIO, header: list[str], rows: np.ndarray) -> None:
    """Write turns of a table until nobody reads any more."""
    period, turn = rows[1, 0] * len(rows), 0
    try:
        with pipe:
            while True:
                text = table_text(header, rows + np.eye(len(header))[0] * period * turn)
                pipe.write(text if turn == 0 else text.partition("\n")[2])
                turn += 1
    except OSError:
        return


def end(process: subprocess.Popen[str]) -> str:
    """Wait until a program has ended; give what it said on standard error."""
    process.wait(PATIENCE)
    assert process.stderr is not None
    return process.stderr.read()


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_no_process_outlives_the_command(tmp_path: Path, number: int, status: int) -> None:
    """Ctrl-C, a polite end and a sudden one, while blocks are under way."""
    with under_way(tmp_path) as (process, workers):
        os.killpg(process.pid, number)
        assert end(process).strip() in ("error: interrupted", "")
    assert process.returncode == status
    wait_until(lambda: not any(map(alive, workers)), "the end of its processes")
    assert not (tmp_path / "out.csv").exists()
    assert number == signal.SIGKILL or not list(tmp_path.iterdir())


def offspring(parent: int) -> list[int]:
    """Return the workers that a process has started."""
    out = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except (OSError, ValueError):
            continue
        if (
            entry.name.isdigit()
            and int(fields[1]) == parent
            and b"spawn_main" in (entry / "cmdline").read_bytes()
        ):
            out.append(int(entry.name))
    return out


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_a_process_that_dies_ends_the_command_and_the_others(tmp_path: Path) -> None:
    with under_way(tmp_path) as (process, workers):
        os.kill(workers[0], signal.SIGKILL)
        assert "a worker process ended without a result; if memory ran out" in end(process)
    assert process.returncode == 1
    wait_until(lambda: not any(map(alive, workers)), "the end of the other process")
    assert not list(tmp_path.iterdir())


# -------------------------------------------------------------------- processes


def test_robots_and_errors_travel() -> None:
    robot = hybridyn.load(FIVE_BAR, base="floating")
    again = pickle.loads(pickle.dumps(robot))
    tau = np.array([1.0, 2.0])
    expected = hybridyn.ddm(robot, robot.home, np.zeros(robot.nv), tau)
    assert np.array_equal(hybridyn.ddm(again, again.home, np.zeros(again.nv), tau), expected)
    error = AssemblyError("message", module="m", sample=3, open_freedoms=2)
    copy = pickle.loads(pickle.dumps(error))
    assert (str(copy), vars(copy)) == (str(error), vars(error))
    named = pickle.loads(pickle.dumps(TrajectoryError("wrong", file="t.csv", row=7)))
    assert (str(named), named.row) == ("t.csv, row 7: wrong", 7)


def rows(last: int) -> Iterator[tuple[int, int]]:
    """Yield tasks, then the error of a table."""
    for row in range(last):
        yield 60, row
    raise TrajectoryError("the table", row=last)


@pytest.mark.parametrize("count", [0, 2])
def test_results_come_in_order_and_so_do_errors(count: int) -> None:
    with Workers(count) as workers:
        assert list(workers.over(divmod, ((60, row) for row in range(1, 30)))) == [
            divmod(60, row) for row in range(1, 30)
        ]
        found = workers.over(pow, rows(9))
        assert [next(found) for _ in range(9)] == [60**row for row in range(9)]
        refused(partial(next, found), TrajectoryError, "the table", row=9)
        with pytest.raises(ZeroDivisionError):  # of the first task, whatever comes later
            list(workers.over(divmod, rows(9)))


def test_a_process_that_dies_is_an_error() -> None:
    with Workers(1) as workers:
        (number,) = workers.over(os.getpid, [()])
        os.kill(number, signal.SIGKILL)
        said = "a worker process ended without a result; if memory ran out"
        refused(lambda: list(workers.over(os.getpid, [()])), HybridynError, said)


def test_only_some_tasks_are_held_at_once(one_process) -> None:
    taken: list[int] = []

    def tasks() -> Iterator[tuple[int, int]]:
        for row in range(1, 1000):
            taken.append(row)
            yield 60, row

    with Workers(1) as workers:
        next(workers.over(divmod, tasks()))
    assert len(taken) < 10


def test_how_many_processes_and_rows(tmp_path: Path) -> None:
    robot = hybridyn.load(FIVE_BAR)
    assert rows_at_once(robot) == 1_000
    path = tmp_path / "traj.csv"
    table_of(path)
    with open_table(path) as table:
        assert table.rows == pytest.approx(1_000, rel=0.5)
        assert _processes(None, table, False) == 0
        assert _processes(1, table, False) == 0
        assert _processes(3, table, True) == 3
        table = table._replace(rows=1_000_000)
        assert _processes(None, table, False) in (0, len(os.sched_getaffinity(0)))
        table = table._replace(rows=LONG_FOR_COMPILED // len(table.columns))
        assert _processes(None, table, True) == 0
