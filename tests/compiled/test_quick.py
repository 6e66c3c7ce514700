"""A quick build gives the same bits, and the optimised one replaces it: for the next program, too."""

import atexit
import functools
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code.library_source import Source, library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library import current
from hybridyn.compiled.library.artifact import Artifact
from hybridyn.compiled.library.building import find_compiler
from hybridyn.compiled.library.cache import Built, folder_in_use
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.library.current import Current, build_beside, different_programs
from tests import ROOT
from tests.compiled.toys import inputs, toy
from tests.support.comparing import refused
from tests.support.waiting import PATIENCE, wait_until

TOY = toy(4, 2)

#: A program that ends while its optimised library is built.
PROGRAM = f"""
import os, signal, sys
from {__name__} import Model, find
model = Model(find(quick=True))
if "kill" in sys.argv:
    os.kill(os.getpid(), signal.SIGKILL)
"""

pytestmark = pytest.mark.usefixtures("empty_cache")


def source() -> Source:
    return library_source([TOY], Scalar("float64", 1))


def artifact(check: Callable[[Built], None] | None = None, key: str = "a toy") -> Artifact:
    return Artifact(None, key, source, check)


find, kept = artifact().built, artifact().known


class Model:
    """An object that uses a library, and replaces it."""

    def __init__(self, quick: Built, check: Callable[[Built], None] | None = None) -> None:
        self.current = Current(Library(quick), lambda library: None, artifact(check))

    @property
    def library(self) -> Library:
        """The library in use."""
        return self.current.library


def answers(library: Library) -> list[np.ndarray]:
    parts, guard = library.batch(TOY.name, *inputs(TOY, 7))
    return [*parts, guard]


class Witness:
    """What is asked for; it notes the thread in which it is pickled."""

    threads: ClassVar[list[str]] = []

    def __reduce__(self) -> tuple[type, tuple[()]]:
        """Note the thread."""
        self.threads.append(threading.current_thread().name)
        return Witness, ()

    def __call__(self) -> Source:
        """Write the source."""
        return source()


def test_what_is_asked_for_is_pickled_before_the_caller_goes_on() -> None:
    """A robot fills its caches while a thread would pickle it: its dictionary changes size."""
    thread = build_beside(replace(artifact(), write=Witness()), lambda library: None)
    assert thread is not None
    thread.join()
    assert Witness.threads == [threading.current_thread().name]


def test_the_optimised_library_takes_over_with_the_same_bits() -> None:
    quick = find(quick=True)
    assert quick.quick
    model = Model(quick)
    before = answers(model.library)
    model.current.wait()
    assert not model.library.built.quick
    assert all(map(np.array_equal, before, answers(model.library)))
    assert find(quick=True) == model.library.built  # the next program begins with it
    assert different_programs(Library(quick), model.library) == []


@pytest.mark.slow
def test_the_process_uses_the_folder_that_replaces_the_cache(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "file" / "cache"))  # cannot be written
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    model = Model(find(quick=True))
    model.current.wait()
    assert not caplog.text
    assert not model.library.built.quick
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


def test_a_library_with_other_bits_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The process that builds compares the bits before a key leads to the library."""
    sent: list[Artifact] = []
    monkeypatch.setattr(current, "build_beside", lambda artifact, _: sent.append(artifact))
    Model(find(quick=True))
    with monkeypatch.context() as patch:
        patch.setattr(current, "different_programs", lambda *_: ["idm"])
        refused(sent[0].built, hybridyn.CompileError, "other bits in idm")
        assert kept() is None
    assert not sent[0].built().quick


def refuse(built: Built) -> None:
    """Refuse every library."""
    raise hybridyn.CompileError("it is wrong")


def test_a_library_that_is_wrong_is_not_used(caplog: pytest.LogCaptureFixture) -> None:
    model = Model(find(quick=True), refuse)
    model.current.wait()
    assert model.library.built.quick
    assert "no optimised library, so what is in use stays: it is wrong" in caplog.text
    assert kept() is None


class Shifted:
    """The calls of a program, with another last bit in the last output."""

    def __init__(self, calls: Any) -> None:
        self.calls, self.inputs = calls, calls.inputs

    def batch(self, given: Any, threads: int) -> Any:
        """Run the program."""
        (*parts, last), guard = self.calls.batch(given, threads)
        return (*parts, np.nextafter(last, np.inf)), guard


def test_other_bits_are_found() -> None:
    library: Any = Library(find(quick=True))
    assert different_programs(library, library) == []
    other: Any = SimpleNamespace(programs={TOY.name: Shifted(library.programs[TOY.name])})
    assert different_programs(library, other) == [TOY.name]


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
    (tmp_path / "request").write_bytes(pickle.dumps(artifact()))
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
def test_the_inverse_model_is_built_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """A call of another builds all, and none waits for the optimised ones."""
    monkeypatch.setattr(current, "build_beside", lambda *_: None)
    robot = hybridyn.load("five_bar")
    model = hybridyn.compile(robot, wait=False)
    state = robot.home, np.zeros(robot.nv), np.zeros(robot.nv)
    assert np.allclose(model.idm(*state), hybridyn.idm(robot, *state))
    assert list(model._current.library.programs) == ["idm"]
    assert {"idm", "ddm", "lift"} <= set(model.library.programs)
    assert model.quick
    assert "a quick build" in repr(model)


def test_a_program_that_is_missing_is_built_once(monkeypatch: pytest.MonkeyPatch) -> None:
    first: Any = SimpleNamespace(programs={"idm": 1}, built=SimpleNamespace(quick=True))
    whole: Any = SimpleNamespace(programs={"idm": 2, "ddm": 3})
    later: Any = SimpleNamespace(programs={"idm": 4, "ddm": 5})
    used: list[Any] = []
    built: list[int] = []

    def load(*_: object, **__: object) -> Any:
        """Build all."""
        built.append(1)
        return whole

    monkeypatch.setattr(current, "build_beside", lambda *_: None)
    monkeypatch.setattr(Artifact, "loaded", load)
    tried: Any = Current(first, used.append, artifact())
    assert tried.program("idm") == 1
    assert not built
    assert tried.program("ddm") == 3
    assert tried.whole() is whole
    tried._take(later)
    assert tried.program("ddm") == 5
    assert used == [first, whole, later]
    assert built == [1]


def alone(folder: Path, built: Built) -> None:
    """Fail where another process does so at the same time."""
    folder.mkdir()
    time.sleep(0.2)
    folder.rmdir()


@pytest.mark.slow
def test_builds_of_a_cache_folder_take_turns(tmp_path: Path) -> None:
    """A loop over many robots starts one process after the other."""
    quick, check = find(quick=True), functools.partial(alone, tmp_path / "taken")
    toys = [artifact(check, f"toy {k}") for k in range(3)]
    models = [Current(Library(quick), lambda library: None, toy) for toy in toys]
    for model in models:
        model.wait()
    assert not any(model.library.built.quick for model in models)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lx4", "five_bar", "delta"])
def test_robots_keep_their_bits(
    name: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.delenv("CC", raising=False)
    find_compiler.cache_clear()
    request.addfinalizer(find_compiler.cache_clear)
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, wait=False)
    generator = np.random.default_rng(3)
    q = np.tile(robot.home, (5, 1))
    v, a = generator.normal(size=(2, 5, robot.nv))
    quick = compiled._current.library
    before = quick.batch("idm", q, v, a)
    compiled.wait_until_optimised()
    assert not compiled.quick
    again = compiled.library.batch("idm", q, v, a)
    assert np.array_equal(before[0][0], again[0][0])
    assert different_programs(quick, compiled.library) == []
