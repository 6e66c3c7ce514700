"""`--executor` and `--dask`: the bits of this machine on processes of others, and what may be wrong there."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from threading import Barrier, BrokenBarrierError
from typing import Any

import pytest

import hybridyn
from hybridyn.cli.common import executors
from hybridyn.errors import HybridynError
from hybridyn.studies.far_processes import far
from tests.cli.test_cli_batch import place, shards
from tests.studies.test_sweep import folder, rows_of, written
from tests.studies.test_sweep_engines import KILLER, MANY
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save
from tests.support.waiting import wait_until

__all__ = ["folder", "place"]

needs("sweep")

#: A module with executors: one that works in this process, and what is none.
HERE = """
from concurrent.futures import ThreadPoolExecutor
from hybridyn.studies.pools import ThisProcess as one

number = 3

def none():
    return 3

def threads():
    return ThreadPoolExecutor(1)
"""
#: A measure that ends the scheduler at design 20 of 40.
ENDS = """
import os, signal, time
def mass(robot, motion):
    mass = next(link.mass for link in robot.description.links if link.name == "rod")
    if mass > 2 * (1 + 2 * 19.5 / 39) and not os.path.exists("ended"):
        open("ended", "w").close()
        os.kill({pid}, signal.SIGKILL)
    time.sleep(0.02)
    return mass
"""


def test_a_sweep_on_workers_of_dask_has_the_rows_of_this_process(folder: Path, run: Any) -> None:
    distributed = needs("dask")
    study = written("method = 'grid'")
    words = {"n_workers": 2, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**words) as cluster:
        run("sweep", study, "-o", "far", "--dask", cluster.scheduler_address)
    run("sweep", study, "-o", "here", "--jobs", "1")
    assert rows_of("far") == rows_of("here")


def test_tables_on_an_executor_have_the_bits_of_single_ones(place: Path, run: Any) -> None:
    """A process that lives on knows a robot whose file was changed."""
    save(place, HERE, "here_tables.py")
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "--executor", "here_tables:one", "-o"]
    for out in ("first", "second"):
        run(*words, out)
        for name, shard in shards(out).items():
            run("idm", "pendulum.urdf", f"in/{name}", "-o", name, "-q")
            assert Path(name).read_bytes() == shard
        robot = place / "pendulum.urdf"
        robot.write_text(robot.read_text().replace('"0.1"', '"0.2"'))
    assert shards("first") != shards("second")


@pytest.mark.parametrize(
    ("words", "status", "said"),
    [
        (["--executor", "here_wrong"], 2, "--executor: 'here_wrong' is not of the form MODULE:FUNCTION"),
        (["--executor", "nowhere:pool"], 2, "--executor nowhere:pool: ModuleNotFoundError: No module named"),
        (["--executor", "here_wrong:two"], 2, "has no attribute 'two'"),
        (["--executor", "here_wrong:number"], 2, "'number' is no function"),
        (
            ["--executor", "here_wrong:none"],
            1,
            "the executor is of type int: return one of",
        ),
        (["--executor", "here_wrong:threads"], 1, "type ThreadPoolExecutor, whose threads share one robot"),
        (["--executor", "here_wrong:one", "--dask", "x"], 2, "--executor and --dask exclude each other"),
        (["--dask", "tcp://127.0.0.1:9"], 1, "--dask: no scheduler of Dask answers at 'tcp://127.0.0.1:9'"),
        (["--dask", "nothing://x"], 1, "--dask: no scheduler of Dask answers at 'nothing://x' (ValueError"),
    ],
)
def test_what_computes_nothing_is_one_line(
    folder: Path, run: Any, monkeypatch: pytest.MonkeyPatch, words: list[str], status: int, said: str
) -> None:
    if "tcp" in words[1] or "nothing:" in words[1]:
        needs("dask")
    monkeypatch.setattr(executors, "PATIENCE", 0.1)
    save(folder, HERE, "here_wrong.py")
    err = run("sweep", written("method = 'grid'"), *words, status=status).err
    assert said in err
    assert err.count("\n") == 1


def test_without_a_study_or_several_tables_there_is_nothing_to_spread(place: Path, run: Any) -> None:
    said = run("idm", "pendulum.urdf", "swing.csv", "--dask", "tcp://host:8786", status=2).err
    assert "--dask belongs to several tables" in said
    said = run("sweep", "--best", "x", "--executor", "a:b", status=2).err
    assert "--executor and --dask belong to a STUDY" in said


def test_dask_is_an_extra(folder: Path, run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    said = run("sweep", written("method = 'grid'"), "--dask", "tcp://host:8786", status=1).err
    assert "--dask needs distributed" in said
    assert "hybridyn[dask]" in said


def test_a_worker_without_the_folder_or_the_release_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there = tmp_path / "gone"
    there.mkdir()
    monkeypatch.chdir(there)
    task = far(abs)
    monkeypatch.chdir(tmp_path)
    assert task(-2) == 2
    assert Path.cwd() == there
    monkeypatch.chdir(tmp_path)
    there.rmdir()
    refused(lambda: task(-2), HybridynError, f"has no folder '{there}'")
    monkeypatch.setattr("hybridyn.studies.far_processes.__version__", "9.0")
    refused(lambda: task(-2), HybridynError, f"has hybridyn 9.0, and the caller {hybridyn.__version__}")


def test_a_process_of_several_threads_computes_one_task_at_a_time() -> None:
    """The robots that tasks keep belong to one of them."""
    both = Barrier(2)

    def met() -> bool:
        with suppress(BrokenBarrierError):
            both.wait(0.05)
            return True
        return False

    with ThreadPoolExecutor(2) as threads:
        assert not any(found.result() for found in [threads.submit(far(met)) for _ in range(2)])


@pytest.fixture
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, int]]:
    """Start a scheduler of Dask and two workers, of two threads, elsewhere: its address and process."""
    needs("dask")
    away = tmp_path_factory.mktemp("away")
    command, logs = [sys.executable, "-m"], (away / "log.txt").open("w")
    words: dict[str, Any] = {"cwd": away, "stdout": logs, "stderr": logs, "start_new_session": True}
    options = ["--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", away / "s.json"]
    scheduler = subprocess.Popen([*command, "distributed.cli.dask_scheduler", *options], **words)
    wait_until((away / "s.json").exists, "a scheduler")
    address = json.loads((away / "s.json").read_text())["address"]
    options = [address, "--nworkers", "2", "--nthreads", "2", "--no-dashboard"]
    workers = subprocess.Popen([*command, "distributed.cli.dask_worker", *options], **words)
    try:
        yield address, scheduler.pid
    finally:
        workers.terminate()
        workers.wait()
        scheduler.kill()
        scheduler.wait()
        logs.close()


@pytest.mark.slow
def test_a_killed_worker_of_a_cluster_loses_nothing(
    folder: Path, cluster: tuple[str, int], run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridyn.studies.sweep.sweep.CHUNK_SECONDS", 0.1)
    save(folder, KILLER.format(mark=folder / "killed", pid=os.getpid()), "killer.py")
    study = written("method = 'grid'", MANY, "{ mass = 'killer.py:mass' }")
    run("sweep", study, "-o", "far", "--allow-python", "--dask", cluster[0])
    assert Path("killed").exists()
    run("sweep", study, "-o", "here", "--allow-python", "--jobs", "1")
    assert rows_of("far") == rows_of("here")
    assert rows_of("far")["status"] == ["ok"] * 40


@pytest.mark.slow
def test_tables_on_a_cluster_have_the_bits_of_this_process(
    place: Path, cluster: tuple[str, int], run: Any
) -> None:
    words = ["idm", "pendulum.urdf", "in/t[013].csv", "-o"]
    run(*words, "far", "--dask", cluster[0])
    run(*words, "here", "--jobs", "1")
    assert len(shards("far")) == 3
    assert shards("far") == shards("here")


@pytest.mark.slow
def test_a_scheduler_that_ends_is_one_line_and_its_sweep_is_continued(
    folder: Path, cluster: tuple[str, int], run: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hybridyn.studies.sweep.sweep.CHUNK_SECONDS", 0.1)
    save(folder, ENDS.format(pid=cluster[1]), "ends.py")
    study = written("method = 'grid'", MANY, "{ mass = 'ends.py:mass' }")
    words = ["sweep", study, "--allow-python", "-o"]
    err = run(*words, "far", "--dask", cluster[0], status=1).err
    assert [line.split(":")[0] for line in err.splitlines()][-1] == "error"
    assert "the executor cancelled its tasks, as Dask does when its scheduler has gone" in err
    assert "continue with --resume" in err
    run(*words, "far", "--resume", "--jobs", "1")
    run(*words, "here", "--jobs", "1")
    assert rows_of("far") == rows_of("here")
