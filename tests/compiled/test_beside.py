"""Another process builds the library, which replaces what CasADi runs: for the next program, too."""

import atexit
import functools
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

import hybridyn
from hybridyn.compiled.comparing import random_states
from hybridyn.compiled.library import current
from hybridyn.compiled.library.cache import folder_in_use
from tests import ROOT
from tests.compiled.beside import Model, Witness, alone, artifact, refuse
from tests.compiled.test_interpreted import AGREES
from tests.compiled.toys import numbered
from tests.robots.robot_texts import door
from tests.support.comparing import close_to, refused
from tests.support.files import save
from tests.support.waiting import PATIENCE, wait_until

#: A program that ends while its optimised library is built.
PROGRAM = """
import os, signal, sys
from functools import partial
from tests.compiled.beside import Model, numbered
model = Model(None, "a toy", partial(numbered, 1))
if "kill" in sys.argv:
    os.kill(os.getpid(), signal.SIGKILL)
"""

pytestmark = pytest.mark.usefixtures("empty_cache")


kept = artifact().known


def test_the_library_takes_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It agrees to rounding; whoever waits gets it, and the next program begins with it."""
    robot = hybridyn.load(save(tmp_path, door(2), "door.urdf"))
    model = hybridyn.compile(robot, wait=False)
    q, v, _, a = random_states(robot)
    first = model.idm(q, v, a)
    assert model.interpreted
    model.wait_until_optimised()
    assert not model.interpreted
    assert "CasADi" not in repr(model)
    assert model.steps is model.library.steps is not None
    close_to(model.idm(q, v, a), first, AGREES)
    monkeypatch.setattr(current, "build_beside", lambda *_: pytest.fail("it is there"))
    assert not hybridyn.compile(robot, wait=False).interpreted  # from the cache


@pytest.mark.slow
def test_the_process_uses_the_folder_that_replaces_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "file" / "cache"))  # cannot be written
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    model = Model()
    model.wait()
    assert not caplog.text
    assert model.models.built is not None
    assert len(list(tmp_path.glob("hybridyn-*"))) == 1


def test_the_folder_that_replaces_the_cache_is_removed_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_end: list[functools.partial[None]] = []
    monkeypatch.setattr(atexit, "register", lambda *given: at_end.append(functools.partial(*given)))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "file").touch()
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "file" / "cache"))
    made = folder_in_use()
    assert made.parent == tmp_path
    at_end[0].func(made, os.getpid() + 1)  # a fork
    assert made.is_dir()
    at_end[0]()
    assert not made.exists()


def test_a_library_that_is_wrong_is_not_used(caplog: pytest.LogCaptureFixture) -> None:
    """What is asked for is pickled before the caller goes on, who may fill the caches of a robot."""
    model = Model(refuse, "a toy", Witness())
    assert Witness.threads == [threading.current_thread().name]
    model.wait()
    assert model.models.built is None
    assert "there is no library, so CasADi computes: it is wrong" in caplog.text
    assert kept() is None
    refused(model.library, hybridyn.CompileError, "it is wrong")


@pytest.mark.parametrize("ending", ["", "kill"])
def test_what_a_program_begins_the_next_one_finds(ending: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, ending],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGKILL if ending else 0, "", "")
    wait_until(lambda: kept() is not None, "the library that the program began")


#: A compiler that writes its process into a file, and takes longer than any test waits.
SLOW = "#!/bin/sh\nsleep 3600 & echo $! > {pid}.new; mv {pid}.new {pid}; wait\n"

#: A program that ends as soon as a file exists; its build has little time then.
ENDS = """
import os, subprocess, sys, time
late = "from hybridyn.compiled.library.current import build_asked\\nbuild_asked({}, 0.1)"
subprocess.Popen([sys.executable, "-c", late.format(os.getpid())], process_group=0)
while not os.path.exists(sys.argv[1]):
    time.sleep(0.01)
"""


def test_a_temporary_folder_is_removed_by_the_build_that_outlives_its_program(
    empty_cache: Path, tmp_path: Path
) -> None:
    """Nobody finds a library there."""
    (tmp_path / "request").write_bytes(pickle.dumps(artifact(write=functools.partial(numbered, 1))))
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    command = "from hybridyn.compiled.library.current import build_asked; build_asked(0, 0.0)"
    with (tmp_path / "request").open("rb") as asked:
        words = [sys.executable, "-c", command]
        subprocess.run(words, stdin=asked, env=environment, timeout=PATIENCE, process_group=0)
    assert not empty_cache.exists()


def test_no_compiler_goes_on_for_long_after_the_program(tmp_path: Path) -> None:
    pid, compiler, request = tmp_path / "pid", tmp_path / "slow-cc", tmp_path / "request"
    compiler.write_text(SLOW.format(pid=pid))
    compiler.chmod(0o700)
    request.write_bytes(pickle.dumps(artifact()))
    environment = os.environ | {"PYTHONPATH": str(ROOT), "CC": str(compiler)}
    with request.open("rb") as asked:
        command = [sys.executable, "-c", ENDS, str(pid)]
        subprocess.run(command, stdin=asked, env=environment, timeout=PATIENCE, check=True)
    number = int(pid.read_text())
    wait_until(lambda: not Path(f"/proc/{number}").exists(), "the end of what the compiler started")


@pytest.mark.slow
def test_builds_of_a_cache_folder_take_turns(tmp_path: Path) -> None:
    """A loop over many robots starts one process after the other."""
    check = functools.partial(alone, tmp_path / "taken")
    models = [Model(check, f"toy {k}") for k in range(3)]
    for model in models:
        model.wait()
    assert all(model.models.built for model in models)
