"""Sweeps in real processes: the same bits on every engine, and a killed worker that loses nothing."""

import os
import re
import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

import pytest

import hybridyn
from tests.studies.test_sweep import folder, rows_of, written
from tests.support.command_line import program
from tests.support.extras import needs
from tests.support.files import save
from tests.support.waiting import wait_until

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


@contextmanager
def executors(engine: str) -> Iterator[Callable[[], Executor] | None]:
    """Yield what starts the processes of an engine: nothing for loky, which is the default."""
    if engine == "dask":
        distributed, config = needs("dask"), import_module("dask").config
        with (
            config.set({"distributed.scheduler.allowed-failures": 0}),
            distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
            distributed.Client(cluster, set_as_default=False) as client,
        ):
            yield partial(client.get_executor, pure=False)
    else:
        yield partial(ProcessPoolExecutor, 2, get_context("spawn")) if engine == "processes" else None


@pytest.mark.slow
@pytest.mark.parametrize("always", [False, True])
@pytest.mark.parametrize("engine", ["loky", "processes", "dask"])
def test_a_killed_worker_loses_nothing_and_counts_nothing_twice(
    folder: Path, engine: str, always: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A design that ends every process is named."""
    monkeypatch.setattr("hybridyn.studies.sweep.sweep.CHUNK_SECONDS", 0.1)
    text = KILLER.format(mark=folder / "killed", pid=os.getpid())
    if always:
        text = re.sub(r"Path\(.*\).write_text.*", "pass", text.replace("6.5 / 39) and", "38.5 / 39) and"))
    Path("killer.py").write_text(text)
    path = written("method = 'grid'", MANY, "{ mass = 'killer.py:mass' }")
    with executors(engine) as executor:
        state = hybridyn.sweep(path, "out", executor=executor, jobs=2, allow_python=True)
    rows = rows_of("out")
    assert Path("killed").exists() != always
    assert rows["design"] == list(range(40))
    assert rows["status"] == ["ok"] * 39 + ["failed" if always else "ok"]
    assert state.done == state.now == 40
    if always:
        assert "ended without a result" in rows["message"][-1]
        assert state.restarts >= 2
        return
    hybridyn.sweep(path, "alone", jobs=1, allow_python=True)
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
def test_a_killed_program_is_continued(folder: Path) -> None:
    Path("slowly.py").write_text(
        "import time\n\ndef wait(robot, motion):\n    time.sleep(0.1)\n    return 1.0\n"
    )
    path = written("method = 'grid'", MANY, "{ one = 'slowly.py:wait', top = 'peak_effort' }")
    words = ["sweep", path, "-o", "out", "--jobs", 1, "--allow-python"]
    running = program(*words)
    wait_until(lambda: len(list(folder.glob("out/designs-*"))) >= 2, "two shards")
    running.kill()
    running.communicate()
    draft = ".designs-000000039-000000039.parquet.hybridyn-part.0123456789abcdef.parquet"
    save(folder / "out", "half a sh", draft)
    begun = len(rows_of("out")["design"])
    assert 0 < begun < 40
    state = hybridyn.sweep(path, "out", jobs=1, allow_python=True, resume=True)
    assert (state.now, state.done) == (40 - begun, 40)
    hybridyn.sweep(path, "whole", jobs=1, allow_python=True)
    assert rows_of("out") == rows_of("whole")
    assert not list(folder.glob("out/.*"))
