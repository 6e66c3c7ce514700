"""Sweeps in real processes: the same bits on every engine, and a killed worker that loses nothing."""

import os
import re
import shutil
import socket
from pathlib import Path

import pytest

import hybridyn
from tests.command_line import program
from tests.comparing import refused
from tests.extras import needs
from tests.studies.test_sweep import folder, rows_of, written
from tests.waiting import wait_until

__all__ = ["folder"]

needs("sweep")

#: Designs enough for several chunks in each of two processes.
MANY = """rod = { scale_inertia = 'rod', range = [1.0, 3.0], steps = 40 }
base = { scale_inertia = 'base', values = [1.0] }"""
#: A measure that once ends its process, unless it is that of the test, at design 7 of 40.
KILLER = """
import os, signal, time
from pathlib import Path

def mass(robot, motion):
    mass = next(link.mass for link in robot.description.links if link.name == "rod")
    if mass > 2 * (1 + 2 * 6.5 / 39) and os.getpid() != {pid} and not Path("{mark}").exists():
        Path("{mark}").write_text("killed")
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.02)
    return mass
"""


@pytest.mark.slow
@pytest.mark.parametrize("always", [False, True])
@pytest.mark.parametrize("engine", ["loky", "dask", "ray"])
def test_a_killed_worker_loses_nothing_and_counts_nothing_twice(
    folder: Path, engine: str, always: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A design that ends every process is named."""
    if engine != "loky":
        needs(engine)
    monkeypatch.setattr("hybridyn.studies.sweep.sweep.CHUNK_SECONDS", 0.1)
    text = KILLER.format(mark=folder / "killed", pid=os.getpid())
    if always:
        text = re.sub(r"Path\(.*\).write_text.*", "pass", text.replace("6.5 / 39) and", "38.5 / 39) and"))
    Path("killer.py").write_text(text)
    path = written("method = 'grid'", MANY, "{ mass = 'killer.py:mass' }")
    state = hybridyn.sweep(path, "out", pool=engine, jobs=2, allow_python=True, format="csv")
    rows = rows_of("out")
    assert Path("killed").exists() != always
    assert rows["design"] == list(range(40))
    assert rows["status"] == ["ok"] * 39 + ["failed" if always else "ok"]
    assert state.done == state.now == 40
    if always:
        assert "ended without a result" in rows["message"][-1]
        assert state.restarts >= 2
        return
    hybridyn.sweep(path, "alone", jobs=1, allow_python=True, format="csv")
    assert rows_of("alone") == rows


@pytest.mark.slow
def test_processes_that_are_used_again_read_the_files_of_the_caller(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridyn.studies.sweep.sweep.CHUNK_SECONDS", 0.01)
    written("method = 'grid'", "length = { range = [0.5, 1.5], steps = 40 }")
    for place in ("first", "second"):
        shutil.copytree(folder, place, ignore=shutil.ignore_patterns("first", "second"))
        with monkeypatch.context() as here:
            here.chdir(place)
            state = hybridyn.sweep("study.toml", "out", jobs=2)
        assert state.statuses == {"ok": 40}
        shutil.rmtree(place)


@pytest.mark.slow
def test_a_cluster_that_stands_is_used(folder: Path) -> None:
    distributed = needs("dask")
    path = written("method = 'grid'")
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        hybridyn.sweep(path, "out", pool="dask", scheduler=cluster.scheduler_address, format="csv")
    hybridyn.sweep(path, "alone", jobs=1, format="csv")
    assert rows_of("out") == rows_of("alone")


def test_a_scheduler_that_does_not_answer_is_one_line(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    needs("dask")
    monkeypatch.setattr("hybridyn.studies.sweep.clusters.PATIENCE", 0.2)
    path = written("method = 'grid'")
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen()
        address = f"tcp://127.0.0.1:{deaf.getsockname()[1]}"
        refused(
            lambda: hybridyn.sweep(path, "out", pool="dask", scheduler=address, format="csv"),
            hybridyn.HybridynError,
            f"the scheduler {address} does not answer within 0.2 s",
        )
    refused(
        lambda: hybridyn.sweep(path, "out2", scheduler=address, format="csv"),
        hybridyn.HybridynError,
        "belongs to the pool 'dask' or 'ray'",
    )


@pytest.mark.slow
def test_a_killed_program_is_continued(folder: Path) -> None:
    Path("slowly.py").write_text(
        "import time\n\ndef wait(robot, motion):\n    time.sleep(0.1)\n    return 1.0\n"
    )
    path = written("method = 'grid'", MANY, "{ one = 'slowly.py:wait', top = 'peak_effort' }")
    words = ["sweep", path, "-o", "out", "--jobs", 1, "--allow-python", "--format", "csv"]
    running = program(*words)
    wait_until(lambda: len(list(folder.glob("out/designs-*"))) >= 2, "two shards")
    running.kill()
    running.communicate()
    (folder / "out" / ".designs-000000039-000000039.csv.1.tmp").write_text("half a sh")
    begun = len(rows_of("out")["design"])
    assert 0 < begun < 40
    state = hybridyn.sweep(path, "out", jobs=1, allow_python=True, resume=True)
    assert (state.now, state.done) == (40 - begun, 40)
    hybridyn.sweep(path, "whole", jobs=1, allow_python=True, format="csv")
    assert rows_of("out") == rows_of("whole")
    assert not list(folder.glob("out/.*"))
