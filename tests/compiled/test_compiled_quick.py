"""A quick build gives the same bits, is replaced by the optimised one, and leaves no compiler behind."""

import atexit
import functools
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code.library_source import Source, library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library import current
from hybridyn.compiled.library.building import find_compiler
from hybridyn.compiled.library.cache import Built, cached, folder_in_use, known
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.library.current import (
    Current,
    Replacement,
    check_bits,
    different_programs,
    receive,
    run_in_turn,
)
from tests import ROOT
from tests.compiled_toys import inputs, toy
from tests.waiting import PATIENCE, wait_until

TOY = toy(4, 2)

#: A compiler that writes its process into a file, and takes longer than any test waits.
SLOW = "#!/bin/sh\nsleep 3600 & echo $! > {pid}.new; mv {pid}.new {pid}; wait\n"

#: A program that ends while its optimised library is built.
PROGRAM = """
import os, signal, sys, time
from hybridyn.compiled.library.building import run_one
from hybridyn.compiled.library.current import Replacement, receive
class Model:
    def use(self, library):
        print("used")
def build():
    run_one([receive()])
build.__module__ = "builder"
if __name__ == "__main__":
    model = Model()
    Replacement(build, sys.argv[1], lambda: None, model.use)
    while not os.path.exists(sys.argv[2]):
        time.sleep(0.01)
    if "kill" in sys.argv:
        os.kill(os.getpid(), signal.SIGKILL)
"""


pytestmark = pytest.mark.usefixtures("empty_cache")


def source() -> Source:
    return library_source([TOY], Scalar("float64", 1))


find = functools.partial(cached, "a toy", source)
kept = functools.partial(known, "a toy")


def build_toy() -> None:
    """Build the optimised library of the toy in a process of its own, or fail with other bits."""
    quick, differing = receive()
    current.different_programs = lambda *_: differing
    try:
        find(accept=functools.partial(check_bits, Library(quick)), run=run_in_turn)
    except hybridyn.CompileError as error:
        sys.exit(str(error))


class Model:
    """An object that uses a library, and replaces it."""

    def __init__(self, quick: Built, differing: Sequence[str] = ()) -> None:
        self.library = Library(quick)
        self.replacement = Replacement(build_toy, (quick, differing), kept, self.use)

    def use(self, library: Library) -> None:
        """Take the library."""
        self.library = library


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


def test_what_is_asked_for_is_pickled_before_the_caller_goes_on() -> None:
    """A robot fills its caches while a thread would pickle it: its dictionary changes size."""
    model = Model(find(quick=True))
    replacement = Replacement(build_toy, Witness(), kept, model.use)
    assert Witness.threads == [threading.current_thread().name]
    replacement.stop()
    model.replacement.stop()


def test_the_optimised_library_takes_over_with_the_same_bits() -> None:
    quick = find(quick=True)
    assert quick.quick
    model = Model(quick)
    before = answers(model.library)
    model.replacement.wait()
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
    model.replacement.wait()
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


def test_a_library_with_other_bits_is_not_used(caplog: pytest.LogCaptureFixture) -> None:
    quick = find(quick=True)
    model = Model(quick, ["idm"])
    first = model.library
    model.replacement.wait()
    assert model.library is first
    assert "other bits in idm" in caplog.text
    assert find(quick=True).quick


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
def test_no_compiler_outlives_the_program(tmp_path: Path, ending: str) -> None:
    pid, compiler, program = tmp_path / "pid", tmp_path / "slow-cc", tmp_path / "builder.py"
    compiler.write_text(SLOW.format(pid=pid))
    compiler.chmod(0o700)
    program.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, str(program), str(compiler), str(pid), ending],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGKILL if ending else 0, "", "")
    number = int(pid.read_text())
    wait_until(lambda: not Path(f"/proc/{number}").exists(), "the end of what the compiler started")


def wait_for_the_end() -> None:
    """Be a build that ends with its program only."""
    receive()
    time.sleep(PATIENCE)


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of forks beside threads
def test_a_fork_leaves_the_process_alone() -> None:
    unused: Any = Shifted(SimpleNamespace(inputs=[]))
    replacement = Replacement(wait_for_the_end, None, kept, unused.batch)
    if (fork := os.fork()) == 0:
        replacement.stop()
        os._exit(0)
    os.waitpid(fork, 0)
    assert replacement._process.poll() is None
    replacement.stop()
    assert replacement._process.poll() is not None


@pytest.mark.slow
@pytest.mark.parametrize("first", ["idm", "ddm"])
def test_the_first_model_is_built_alone(first: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first library has one model; a call of another builds all, and none waits for the optimised one."""
    monkeypatch.setattr(Replacement, "__init__", lambda self, *_: None)
    robot = hybridyn.load("five_bar")
    model = hybridyn.compile(robot, quick=first)
    assert list(model._current.library.programs) == [first]
    last = np.zeros(len(robot.motors) if first == "ddm" else robot.nv)
    state = robot.home, np.zeros(robot.nv), last
    assert np.allclose(getattr(model, first)(*state), getattr(hybridyn, first)(robot, *state))
    assert list(model._current.library.programs) == [first]
    assert {"idm", "ddm", "lift"} <= set(model.library.programs)
    assert model.quick


def test_a_program_that_is_missing_is_built_once() -> None:
    first: Any = SimpleNamespace(programs={"idm": 1})
    whole: Any = SimpleNamespace(programs={"idm": 2, "ddm": 3})
    later: Any = SimpleNamespace(programs={"idm": 4, "ddm": 5})
    used: list[Any] = []
    built: list[int] = []
    take: list[Any] = []
    current: Any = Current(first, used.append)

    def build() -> Any:
        """Build all."""
        built.append(1)
        return whole

    current.replace_later(build, take.append)
    assert current.program("idm") == 1
    assert not built
    assert current.program("ddm") == 3
    assert current.whole() is whole
    take[0](later)
    assert current.program("ddm") == 5
    assert used == [first, whole, later]
    assert built == [1]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lx4", "five_bar", "delta"])
def test_robots_keep_their_bits(
    name: str, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest
) -> None:
    monkeypatch.delenv("CC", raising=False)
    find_compiler.cache_clear()
    request.addfinalizer(find_compiler.cache_clear)
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, quick=True)
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
