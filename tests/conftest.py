"""What every test shares: one thread of BLAS, and a folder in which workers find what one of them made."""

import gc
import hashlib
import inspect
import itertools
import os
import re
import shutil
import signal
import sys
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial, wraps
from pathlib import Path
from typing import Any

import pytest
from _pytest.runner import runtestprotocol

from tests import ROOT
from tests.support import missed, once
from tests.support.extras import all_installed, robots_of_others, skip

# The matrices of the tests are small: threads of BLAS gain nothing, and two pytest workers fight over cores.
# Before anything imports numpy.
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")

#: After so many new objects garbage is searched for; Python's own 700 cost seconds a run.
NEW_OBJECTS = 50_000
#: So many modules are kept at most.
MODULES = 500
#: So many written models are kept at most.
WRITTEN = 1000
#: Numbers of the folders of tests, and how many lie side by side.
FOLDERS, NEIGHBOURS = itertools.count(), 50

# Some hundred programs are started: each would compile the package anew, 0.2 s of 0.4.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_configure(config: pytest.Config) -> None:
    """Make the session's folder, in which compiled models are kept too, before workers start."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # in the background; programs inherit it
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if once.VARIABLE not in os.environ:
        os.environ[once.VARIABLE] = folder = tempfile.mkdtemp(prefix="hybridyn-tests-")
        config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))
        config.add_cleanup(lambda: os.environ.pop(once.VARIABLE))
        quick_compiler(once.folder() / "cc")
    os.environ["HYBRIDYN_SINGLE_CALLS"] = "general"  # it is the judge
    os.environ["HYBRIDYN_CACHE"] = str(once.folder() / "compiled")
    if not hasattr(config, "workerinput") and not config.getoption("missed"):
        config.pluginmanager.register(missed.Missed())


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--part 3/20`, the tests whose names fall into one of so many parts, and `--missed`."""
    parser.addoption("--part", default="0/1", metavar="K/N", help="run part K of N of the tests, K from 0")
    parser.addoption("--missed", action="store_true", help="what the last run skipped for an absent extra")


def pytest_collection() -> None:
    """Search for garbage again when all tests are known: there is none among them."""
    gc.disable()


def pytest_collection_finish() -> None:
    """Leave the tests themselves, 400,000 objects, out of what is searched for garbage, and search seldom."""
    gc.freeze()
    gc.set_threshold(NEW_OBJECTS)
    gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark what `slow_cases.txt` and `slow_tests.txt` list, and leave the tests of other parts out."""
    mark_slow_cases(items, whole=config.args_source is pytest.Config.ArgsSource.TESTPATHS)
    if config.getoption("missed"):
        missed.select(config, items)
    part, parts = map(int, config.getoption("part").split("/"))
    if parts > 1:
        items[:] = [item for item in items if zlib.crc32(item.nodeid.encode()) % parts == part]


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool | None:
    """Let a worker tell once of a test that passes, not of set-up, call and end: telling takes longest."""
    if not hasattr(item.config, "workerinput"):
        return None
    reports = runtestprotocol(item, log=False, nextitem=nextitem)
    passed = all(report.passed for report in reports)
    for report in reports:
        if report.when == "call" or not passed:
            item.ihook.pytest_runtest_logreport(report=report)
    return True


def mark_slow_cases(items: list[pytest.Item], whole: bool) -> None:
    """Add the mark `slow` to listed cases and tests; where all tests of all extras are collected, check them.

    Raises:
        UsageError: What is listed does not exist, or nothing that runs by default stands for it.
    """
    cases = {*lines_of("slow_cases.txt")}
    stands_for = dict(line.split() for line in lines_of("slow_tests.txt"))
    for item in items:
        if item.nodeid in cases or name_of_test(item.nodeid) in stands_for:
            item.add_marker(pytest.mark.slow)
    if whole and all_installed():
        default = {name_of_test(item.nodeid) for item in items if runs_by_default(item)}
        wrong = cases - {item.nodeid for item in items}
        wrong |= stands_for.keys() - {name_of_test(item.nodeid) for item in items}
        wrong |= {case for case in cases if name_of_test(case) not in default}
        wrong |= {test for test, other in stands_for.items() if other not in default}
        if wrong:
            raise pytest.UsageError(f"listed as slow: unknown, or nothing stands for it: {sorted(wrong)}")


def lines_of(name: str) -> list[str]:
    """Return the lines of a list in this folder, without comments."""
    lines = (ROOT / "tests" / name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if not line.startswith("#")]


def runs_by_default(item: pytest.Item) -> bool:
    return not any(item.get_closest_marker(mark) for mark in ("slow", "fuzz"))


def name_of_test(case: str) -> str:
    return case.split("[", 1)[0]


def quick_compiler(program: Path) -> None:
    """Build models without optimisation, which is for speed only; a CC in the environment wins.

    They stay built for this processor: without its vectors the lanes take twice the compiler's time.
    """
    if "CC" not in os.environ and shutil.which("cc"):
        program.write_text('#!/bin/sh\ncase "$*" in *-O[3g]*) exec cc "$@" -O0 ;; *) exec cc "$@" ;; esac\n')
        program.chmod(0o700)
        os.environ["CC"] = str(program)


@pytest.fixture(scope="session", autouse=True)
def optimised() -> None:
    """Let `compile` wait for the optimised library: building it beside other tests would slow them."""
    from hybridyn.compiled.compiling import compile

    vars(compile)["__wrapped__"].__kwdefaults__["wait"] = True


@pytest.fixture(scope="session", autouse=True)
def build_once() -> None:
    """Build each module once a session: many tests load the same robots, whose mechanisms never change."""
    from hybridyn.structure import mechanism, module_builder

    made: dict[object, mechanism.Mechanism] = {}

    def built(spec: Any, tolerances: Any, size: float, like: Any = None) -> mechanism.Mechanism:
        if like is not None:
            return mechanism.Mechanism(spec, tolerances, size, like)
        asked = (spec.key, tolerances, size)
        if asked not in made:
            if len(made) == MODULES:
                made.clear()
            made[asked] = mechanism.Mechanism(spec, tolerances, size)
        return made[asked]

    module_builder.Mechanism = built  # type: ignore[assignment,misc]


@pytest.fixture(scope="session", autouse=True)
def write_once() -> None:
    """Write each model of a robot, and each derivative, once a worker: programs never change."""
    from hybridyn.compiled.programs import built_beside, robot_programs, sources, whole_robot

    write = whole_robot.programs_of
    made: dict[object, Any] = {}

    def known(key: object, make: Callable[[], Any]) -> Any:
        if key not in made:
            if len(made) == WRITTEN:
                made.clear()
            made[key] = make()
        return made[key]

    @wraps(write)
    def written(asked: Any, models: tuple[str, ...]) -> Any:
        slots = getattr(asked.arguments, "slots", ())
        if asked.arguments is not None and not slots:
            return write(asked, models)
        facts = sources.robot_key(asked.robot, asked.on), slots, asked.dtype, asked.compared, asked.links
        out: dict[str, Any] = {}
        for model in models:
            out |= known((model, facts), partial(write, asked, (model,)))
        return out

    whole_robot.programs_of = robot_programs.programs_of = written

    @wraps(built_beside.BuiltBeside.program.func)
    def program(self: Any) -> Any:
        slots = self._parameters.slots if hasattr(self, "_parameters") else ()
        return known((self._name, sources.robot_key(self.robot, self._effects), slots), self._write)

    write_by(program)


def write_by(program: Callable[[Any], Any], patch: Callable[..., None] = setattr) -> None:
    """Let derivatives get their program from a function."""
    from hybridyn.compiled.programs.built_beside import BuiltBeside

    of = cached_property(program)
    of.__set_name__(BuiltBeside, "program")
    patch(BuiltBeside, "program", of)


@pytest.fixture
def built_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a test see how modules are built, whatever was built before."""
    from hybridyn.structure import mechanism, module_builder

    monkeypatch.setattr(module_builder, "Mechanism", mechanism.Mechanism)


@pytest.fixture
def written_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a test change how models are written: none that was written before is taken, or kept."""
    from hybridyn.compiled.programs import built_beside, robot_programs, whole_robot

    write_by(inspect.unwrap(built_beside.BuiltBeside.program.func), monkeypatch.setattr)
    for file in (robot_programs, whole_robot):
        monkeypatch.setattr(file, "programs_of", inspect.unwrap(file.programs_of))


def is_shipped(file: Any) -> bool:
    """Tell whether a file lies among those of the shipped robots."""
    return os.path.realpath(file).startswith(str(ROOT / "urdf") + os.sep)


@pytest.fixture(scope="session", autouse=True)
def read_once() -> None:
    """Read each shipped robot once a worker: many tests load the same ones, whose descriptions are frozen."""
    from hybridyn import description
    from hybridyn.description.urdf import xacro

    read = description.read
    made: dict[object, Any] = {}

    def known(path: Any, *, xacro_args: Any = None, **asked: Any) -> Any:
        if xacro_args or not is_shipped(path):
            return read(path, xacro_args=xacro_args, **asked)
        key = os.getcwd(), os.fspath(path), repr(asked), *xacro.share_dirs()
        if key not in made:
            made[key] = read(path, **asked)
        return made[key]

    description.read = known


@pytest.fixture(scope="session", autouse=True)
def expand_once() -> None:
    """Expand each shipped xacro file once a session."""
    from hybridyn.description import reading

    reading.expand = kept(reading.expand)


def kept(expand: Callable[..., Any]) -> Callable[..., Any]:
    """Return `expand` with its answers for shipped robots kept in the session's folder."""
    from hybridyn.description.urdf import xacro

    def expanded(file: str, arguments: Mapping[str, object], packages: Sequence[Any]) -> Any:
        if not is_shipped(file):
            return expand(file, arguments, packages)
        given = sorted((key, str(value)) for key, value in arguments.items())
        asked = (os.path.abspath(file), given, packages, xacro.share_dirs())
        name = hashlib.sha256(repr(asked).encode()).hexdigest()
        if os.path.basename(file).startswith("stewart_ur5") and not robots_of_others():
            skip("robots")
        text, notes = once.once(name, lambda: expand(file, arguments, packages))
        return text, list(notes)

    return expanded


@pytest.fixture
def tmp_path(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with few beside it: with each robot, files of loops are looked for among them."""
    number, name = next(FOLDERS), re.sub(r"\W", "_", request.node.name)[:30]
    beside = tmp_path_factory.getbasetemp() / f"from{number - number % NEIGHBOURS}"
    beside.mkdir(mode=0o700, exist_ok=True)
    folder = beside / f"{name}{number}"
    folder.mkdir(mode=0o700)
    return folder


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Give the command line as a function of its words: `tests.support.command_line.call`."""
    from tests.support.command_line import call

    return partial(call, capsys)


@pytest.fixture
def interpreted(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Stand for a machine without a compiler, on which CasADi runs all models: there is nothing to build."""
    from hybridyn.compiled.library.building import find_compiler

    monkeypatch.setenv("CC", "no-such-compiler")
    find_compiler.cache_clear()  # an earlier test may have found one
    yield
    find_compiler.cache_clear()


@pytest.fixture
def one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let worker processes be none: `tests/streams/test_jobs.py` starts some."""
    from tests.support.one_process import OneProcess

    monkeypatch.setattr("concurrent.futures.ProcessPoolExecutor", OneProcess)
