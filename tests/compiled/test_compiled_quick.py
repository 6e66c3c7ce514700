"""A quick build gives the same bits, is replaced by the optimised one, and leaves no compiler behind."""

from __future__ import annotations

import functools
import logging
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.code.library_source import Source, library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library import replacing
from hybridyn.compiled.library.cache import cached
from hybridyn.compiled.library.calls import Library
from hybridyn.compiled.library.replacing import Replacement, different_programs
from tests import ROOT
from tests.compiled_toys import inputs, toy
from tests.waiting import PATIENCE, wait_until

TOY = toy(4, 2)

#: A compiler that writes its process into a file, and takes a minute.
SLOW = "#!/bin/sh\nsleep 60 & echo $! > {pid}.new; mv {pid}.new {pid}; wait\n"

#: A program that ends while its optimised library is built.
PROGRAM = """
import os, sys, time
from hybridyn.compiled.library.replacing import Replacement
class Model:
    def use(self, library):
        print("used")
model = Model()
Replacement(None, lambda accept, run: run([[sys.argv[1]]]), model.use)
while not os.path.exists(sys.argv[2]):
    time.sleep(0.01)
"""


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))


def source() -> Source:
    return library_source([TOY], Scalar("float64", 1))


find = functools.partial(cached, "a toy", source)


class Model:
    """An object that uses a library, and replaces it."""

    def __init__(self, library: Library) -> None:
        self.library = library
        self.replacement = Replacement(library, find, self.use)

    def use(self, library: Library) -> None:
        """Take the library."""
        self.library = library


def answers(library: Library) -> list[np.ndarray]:
    parts, guard = library.batch(TOY.name, *inputs(TOY, 7))
    return [*parts, guard]


def test_the_optimised_library_takes_over_with_the_same_bits() -> None:
    quick = find(quick=True)
    assert quick.quick
    model = Model(Library(quick))
    before = answers(model.library)
    model.replacement.wait()
    assert not model.library.built.quick
    assert all(map(np.array_equal, before, answers(model.library)))
    assert find(quick=True) == model.library.built  # the next program begins with it
    assert different_programs(Library(quick), model.library) == []


def test_a_library_with_other_bits_is_not_used(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    model_library = Library(find(quick=True))
    monkeypatch.setattr(replacing, "different_programs", lambda *_: ["idm"])
    with caplog.at_level(logging.WARNING):
        model = Model(model_library)
        model.replacement.wait()
    assert model.library is model_library
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


def test_no_compiler_outlives_the_program(tmp_path: Path) -> None:
    pid, compiler = tmp_path / "pid", tmp_path / "slow-cc"
    compiler.write_text(SLOW.format(pid=pid))
    compiler.chmod(0o700)
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(compiler), str(pid)],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    number = int(pid.read_text())
    wait_until(lambda: not Path(f"/proc/{number}").exists(), "the end of what the compiler started")


@pytest.mark.filterwarnings("ignore::DeprecationWarning")  # of forks beside threads
def test_a_fork_leaves_the_compiler_alone() -> None:
    unused: Any = Shifted(SimpleNamespace(inputs=[]))
    replacement = Replacement(unused, lambda accept, run: run([["sleep", "60"]]), unused.batch)
    wait_until(lambda: replacement._process is not None, "the compiler")
    process = replacement._process
    assert process is not None
    if (fork := os.fork()) == 0:
        replacement.stop()
        os._exit(0)
    os.waitpid(fork, 0)
    assert process.poll() is None
    replacement.stop()
    assert process.poll() is not None


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lx4", "five_bar", "delta"])
def test_robots_keep_their_bits(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    robot = hybridyn.load(name)
    compiled = hybridyn.compile(robot, quick=True)
    generator = np.random.default_rng(3)
    q = np.tile(robot.home, (5, 1))
    v, a = generator.normal(size=(2, 5, robot.nv))
    quick = compiled.library
    before = quick.batch("idm", q, v, a)
    compiled.wait_until_optimised()
    assert not compiled.quick
    again = compiled.library.batch("idm", q, v, a)
    assert np.array_equal(before[0][0], again[0][0])
    assert different_programs(quick, compiled.library) == []
