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
from typing import Any, TextIO

import numpy as np
import pytest

import hybridyn
from hybridyn.cli.common.tables import _processes
from hybridyn.errors import AssemblyError, HybridynError, TrajectoryError
from hybridyn.streams import blocks as blocks_file
from hybridyn.streams.blocks import LONG_FOR_COMPILED, Block, Done, blocks, in_order, rows_at_once
from hybridyn.streams.workers import Failure, Workers
from hybridyn.tables.opening import open_table
from hybridyn.tables.trajectory import Motion
from tests import ROOT
from tests.command_line import program, table_text
from tests.comparing import refused
from tests.files import save
from tests.samples import slow
from tests.waiting import PATIENCE, wait_until

FIVE_BAR = ROOT / "urdf/five_bar.urdf.xacro"


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocks_file, "MOST_ROWS", 130)


def periodic_table() -> tuple[list[str], np.ndarray]:
    """Return header and rows of one turn of the five-bar's trajectory."""
    with open_table(ROOT / "models/five_bar/traj.csv") as table:
        return list(table.columns), next(table.blocks).values[:-1]


def long_table(path: Path, times: int) -> np.ndarray:
    """Write the five-bar's periodic trajectory several times, and give its rows."""
    header, rows = periodic_table()
    period = rows[1, 0] * len(rows)
    rows = np.vstack([rows + np.eye(len(header))[0] * period * turn for turn in range(times)])
    path.write_text(table_text(header, rows))
    return rows


# -------------------------------------------------------------------- the whole program


def test_the_same_numbers_as_one_process(run, tmp_path: Path, small_blocks) -> None:
    path = tmp_path / "traj.csv"
    long_table(path, 1)
    found = []
    for jobs in (1, 3):
        words = ["-o", tmp_path / f"{jobs}.csv", "--reactions", tmp_path / f"{jobs}r.csv", "--jobs", jobs]
        said = run("idm", FIVE_BAR, path, *words)
        assert ("in 3 processes" in said.err) == (jobs == 3)
        found.append([(tmp_path / f"{jobs}{end}.csv").read_bytes() for end in ("", "r")])
    assert found[0] == found[1]


@pytest.mark.slow
def test_the_same_bits_for_a_robot_of_many_modules(run, tmp_path: Path, monkeypatch) -> None:
    """Its first block begins at home in both, but travels to another process packed."""
    monkeypatch.setattr(blocks_file, "MOST_ROWS", 10)
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
    rows = long_table(path, 1)
    header = path.read_text().splitlines()[0].split(",")
    rows[row - 1 :, 1] += 2e4
    path.write_text(table_text(header, rows))
    said = run("idm", FIVE_BAR, path, "-o", tmp_path / "out.csv", "--jobs", jobs, status=1)
    assert said.err.startswith(f"error: {path}, row {row} (t = {rows[row - 1, 0]:.6g} s): "), said.err
    assert [entry.name for entry in tmp_path.iterdir()] == ["traj.csv"]


def test_a_table_that_goes_wrong_later_on(run, tmp_path: Path, small_blocks) -> None:
    path = tmp_path / "traj.csv"
    long_table(path, 3)
    lines = path.read_text().splitlines()
    lines[2900] = lines[2900].replace(",", ",x", 1)
    path.write_text("\n".join(lines))
    run("idm", FIVE_BAR, path, "-o", tmp_path / "out.csv", "--jobs", 2, status=1, says="row 2900")
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


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc")
def test_a_process_that_dies_is_an_error(tmp_path: Path) -> None:
    with under_way(tmp_path) as (process, workers):
        os.kill(workers[0], signal.SIGKILL)
        assert "a worker process ended without a result; if memory ran out" in end(process)
    assert process.returncode == 1
    wait_until(lambda: not any(map(alive, workers)), "the end of the other process")
    assert not list(tmp_path.iterdir())


# -------------------------------------------------------------------- blocks


def motion(first_row: int, size: int, *, timed: bool = True) -> Motion:
    x = np.arange(first_row, first_row + size, dtype=float)
    return Motion(
        first_row,
        size,
        x if timed else None,
        joints={"j": (x, x, x)},
        wrenches={"l": np.outer(x, np.ones(6))},
    )


@pytest.mark.parametrize("connected", [True, False])
def test_blocks_have_the_row_before_them_in_front(connected: bool) -> None:
    made = list(blocks([motion(1, 5), motion(6, 4)], 2, connected))
    own = [block.motion.time[block.lead :].tolist() for block in made]
    assert own == [[1, 2], [3, 4], [5], [6, 7], [8, 9]]
    assert [block.lead for block in made] == [0, *[int(connected)] * 4]
    for block in made:
        rows = np.arange(block.motion.first_row, block.motion.first_row + block.motion.size)
        assert block.motion.size == len(rows)
        assert np.array_equal(block.motion.time, rows)
        assert np.array_equal(block.motion.joints["j"][2], rows)
        assert np.array_equal(block.motion.wrenches["l"][:, 5], rows)


class Walk:
    """Stands for a robot whose posture is the row's number plus what it started from, 0 or 100."""

    def __init__(self, start: float = 0.0, fail_at: int | None = None) -> None:
        self.start, self.fail_at = start, fail_at

    def __call__(self, block: Block, guess: Any) -> Done:
        """Walk along the rows."""
        x = block.motion.time
        branch = self.start if guess is None else guess[0] - x[0] if block.lead else 0.0
        if self.fail_at is not None and (x == self.fail_at).any():
            raise TrajectoryError("no", row=self.fail_at)
        q = (x + branch)[:, None]
        own = len(x) - block.lead
        return Done(int(x[block.lead]), x[block.lead :], q[block.lead :], None, 0 * x, q[0], q[-1], own)


class SameProcess:
    """Stands for `Workers`, with another function for those that start from a guess."""

    def __init__(self, work: Any, count: int) -> None:
        self.work, self.count = work, count
        self.results: list[Any] = []
        self.most = 0

    def __len__(self) -> int:
        return self.count

    def give(self, arguments: Any) -> None:
        """Do it at once."""
        try:
            self.results.append(self.work(*arguments))
        except HybridynError as error:
            self.results.append(Failure(error))
        self.most = max(self.most, len(self.results))

    def take(self) -> Any:
        """Return the oldest result."""
        return self.results.pop(0)


@pytest.mark.parametrize("elsewhere", [0.0, 100.0])
def test_a_block_on_another_branch_is_done_again(elsewhere: float) -> None:
    workers = SameProcess(lambda block, guess: Walk(elsewhere if block.lead else 0.0)(block, guess), 3)
    given = blocks([motion(1, 50)], 4, True)
    found = list(in_order(Walk(), given, workers))
    rows = np.vstack([done.rows for done in found])
    assert rows[:, 0].tolist() == list(range(1, 51))
    assert sum(done.handed_over for done in found) == 50
    assert workers.most == 3
    assert not workers.results


@pytest.mark.parametrize("elsewhere", [(), (7,), (7, 8), (5, 7, 8, 12)])
def test_one_process_takes_what_several_take(elsewhere: tuple[int, ...]) -> None:
    """Blocks that a guess leads astray are done again; after two in a row guesses are left; by all alike."""

    class Rounded(Walk):
        """A walk whose last digits tell whether it began at home."""

        def __call__(self, block: Block, guess: Any) -> Done:
            number = int(block.motion.time[block.lead]) // 4
            self.start = 100.0 if guess is None and number in elsewhere else 0.0
            done = super().__call__(block, guess)
            return done._replace(rows=done.rows + 1e-13 * (guess is None))

    found = []
    for count in (0, 1, 2, 5):
        workers = SameProcess(Rounded(), count)
        given = blocks([motion(1, 60)], 4, True)
        found.append(np.vstack([done.rows for done in in_order(Rounded(), given, workers)]).tobytes())
    assert found == found[:1] * 4


def test_a_failure_of_a_guess_is_no_failure() -> None:
    workers = SameProcess(lambda block, guess: Walk(0.0, 9 if block.lead else None)(block, guess), 2)
    given = blocks([motion(1, 20)], 4, True)
    rows = np.vstack([done.rows for done in in_order(Walk(), given, workers)])
    assert rows[:, 0].tolist() == list(range(1, 21))


def test_the_first_error_in_order_of_rows_is_raised() -> None:
    def rows() -> Any:
        yield from blocks([motion(1, 12)], 4, True)
        raise TrajectoryError("the table", row=13)

    for fail_at, wanted in ((6, 6), (None, 13)):
        done = in_order(Walk(0.0, fail_at), rows(), SameProcess(Walk(0.0, fail_at), 4))
        refused(partial(list, done), TrajectoryError, "", row=wanted)


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


def test_workers_answer_in_turn_and_give_their_errors() -> None:
    with Workers(2) as workers:
        workers.prepare(divmod)
        workers.give((7, 2))
        workers.give((7, 0))
        assert workers.take() == (3, 1)
        workers.give((9, 2))
        failure = workers.take()
        assert isinstance(failure, Failure)
        assert isinstance(failure.error, ZeroDivisionError)
        assert workers.take() == (4, 1)
    assert len(workers) == 0


def test_how_many_processes_and_rows(tmp_path: Path) -> None:
    robot = hybridyn.load(FIVE_BAR)
    assert rows_at_once(robot) == 1_000
    path = tmp_path / "traj.csv"
    long_table(path, 1)
    with open_table(path) as table:
        assert table.rows == pytest.approx(1_000, rel=0.5)
        assert _processes(None, table, False) == 0
        assert _processes(1, table, False) == 0
        assert _processes(3, table, True) == 3
        table.rows = 1_000_000
        assert _processes(None, table, False) in (0, len(os.sched_getaffinity(0)))
        table.rows = LONG_FOR_COMPILED // len(table.columns)
        assert _processes(None, table, True) == 0
