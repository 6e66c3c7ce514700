"""The cache of built libraries does not grow for ever, and nothing in use is taken from anybody."""

import ctypes
import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

import hybridyn.compiled.library.cache as cache_file
import hybridyn.compiled.library.cache as keeping
from hybridyn.compiled.code.library_source import library_source
from hybridyn.compiled.code.scalars import Scalar
from hybridyn.compiled.library.artifact import Artifact
from hybridyn.compiled.library.cache import ABANDONED, IN_USE, Built, remove_unused
from hybridyn.compiled.library.calls import Library
from hybridyn.errors import CompileError
from tests import ROOT
from tests.compiled.toys import cached, double, never, numbered
from tests.support.clocks import Clock
from tests.support.waiting import PATIENCE

HOUR = 3600.0
#: The time of all tests [s]; it stands still, and files that are written are newer.
NOW = time.time()
FILES_ALONE = pytest.mark.usefixtures("uncompiled")


@pytest.fixture(autouse=True)
def at(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(keeping, "time", Clock(NOW))
    return empty_cache


def built(number: int) -> Built:
    return cached(f"key {number}", lambda: numbered(number))


def known(number: int) -> bool:
    """Tell whether a library is found without building."""
    try:
        return cached(f"key {number}", never).about == {"number": number}
    except CompileError:
        return False


def used(one: Built, ago: float) -> None:
    """Pretend that a library was used some seconds ago."""
    os.utime(one.path, (NOW - ago,) * 2)


def limit(monkeypatch: pytest.MonkeyPatch, libraries: float) -> None:
    """Keep as much as some libraries of these tests take."""
    size = built(0).path.stat().st_size
    monkeypatch.setattr(keeping, "LIMIT", int(size * (libraries + 0.5)))


def count(at: Path) -> tuple[int, int]:
    """Return how many keys, two for each library, and libraries there are."""
    keys, libraries = (len(list((at / name).iterdir())) for name in ("keys", "libraries"))
    return keys, libraries


@FILES_ALONE
def test_those_not_used_for_longest_go_first(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limit(monkeypatch, 4)
    for number, ago in ((0, 20), (1, 40), (2, 30), (3, 10)):
        used(built(number), ago * HOUR)
    assert count(at) == (8, 4)
    assert known(1)  # which is use
    used(built(4), 5 * HOUR)
    assert count(at) == (8, 4)
    built(5)
    assert count(at) == (8, 4)
    assert [known(number) for number in range(6)] == [False, True, False, True, True, True]


@FILES_ALONE
def test_what_was_used_within_the_hour_stays(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    limit(monkeypatch, 1)
    for number in range(4):
        used(built(number), IN_USE - 60)
    assert count(at) == (8, 4)
    used(built(1), IN_USE + 60)  # found, then left
    remove_unused(at)
    assert [known(number) for number in range(4)] == [True, False, True, True]


@FILES_ALONE
def test_a_large_library_may_stand_alone(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used(built(0), 2 * HOUR)
    monkeypatch.setattr(keeping, "LIMIT", 1)
    assert built(1).path.exists()
    assert count(at) == (2, 1)


@FILES_ALONE
def test_below_the_limit_nothing_goes(at: Path) -> None:
    for number in range(3):
        used(built(number), 1e4 * HOUR)
    remove_unused(at)
    assert count(at) == (6, 3)


def test_an_open_library_works_on(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = built(7)
    library = ctypes.CDLL(str(one.path))
    used(one, 2 * HOUR)
    monkeypatch.setattr(keeping, "LIMIT", 0)
    remove_unused(at)
    assert not one.path.exists()
    assert library.number() == 7
    assert ctypes.CDLL(str(built(7).path)).number() == 7  # built again


@FILES_ALONE
def test_only_what_was_abandoned_is_removed_of_what_is_being_built(at: Path) -> None:
    built(0)
    drafts = [at / "building-old", at / "building-new", at / "keys" / ".old", at / "keys" / ".new"]
    for draft in drafts:
        if draft.name.startswith("building"):
            draft.mkdir()
            (draft / "library.so").write_text("")
        else:
            draft.write_text("")
        if draft.name.endswith("old"):
            os.utime(draft, (NOW - ABANDONED - 60,) * 2)
    remove_unused(at)
    assert [draft.exists() for draft in drafts] == [False, True, False, True]
    assert known(0)


@FILES_ALONE
def test_foreign_and_damaged_files_do_no_harm(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    used(built(0), 2 * HOUR)
    (at / "keys" / "da").write_text('{"library": 3')
    (at / "keys" / "ed").write_text("[]")
    (at / "keys" / "abc").write_bytes(b"\xff\xfe")
    (at / "keys" / "def").write_text('{"library": "../keys/ed"}')
    (at / "libraries" / "folder.so").mkdir()
    (at / "mine.txt").write_text("mine")
    monkeypatch.setattr(keeping, "LIMIT", 0)
    remove_unused(at)
    assert count(at) == (0, 1)
    assert (at / "mine.txt").exists()


def test_a_library_that_goes_before_it_is_loaded_is_built_again() -> None:
    """Another process may have looked at its age just before it was handed out."""
    program, found = double(), []

    def load(built: Built) -> Library:
        found.append(built)
        if len(found) == 1:
            built.path.unlink()
        return Library(built)

    artifact = Artifact(None, "toy", lambda: library_source([program], Scalar()))
    assert artifact.loaded(load).programs.keys() == {program.name}
    assert len(found) == 2


WORKER = f"""
import ctypes, sys
import hybridyn.compiled.library.cache as keeping
from {__name__} import built
keeping.LIMIT, keeping.IN_USE = int(sys.argv[1]), 0.1
for turn in range(24):
    number = 10 * turn + int(sys.argv[2]) if turn % 2 else turn // 2 % 4
    while True:
        try:
            library = ctypes.CDLL(str(built(number).path))
            break
        except OSError:  # another one removed it before it was opened
            continue
    assert library.number() == number
"""


@pytest.mark.slow
def test_processes_may_build_use_and_remove_at_once(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three libraries fit; everybody wants the same four, and others of their own in between."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    room = 3 * built(0).path.stat().st_size
    running = [
        subprocess.Popen([sys.executable, "-c", WORKER, str(room), str(own)], env=environment)
        for own in (4, 5, 6)
    ]
    assert [process.wait(PATIENCE) for process in running] == [0, 0, 0]
    monkeypatch.setattr(keeping, "IN_USE", -HOUR)
    monkeypatch.setattr(keeping, "LIMIT", room)
    remove_unused(at)
    assert 1 <= count(at)[1] <= 3
    for path in (at / "libraries").iterdir():
        assert hashlib.sha256(path.read_bytes()).hexdigest() == path.stem
    for key in (at / "keys").iterdir():
        assert (at / "libraries" / f"{json.loads(key.read_text())['library']}.so").exists()


@FILES_ALONE
def test_a_read_only_file_is_used_all_the_same(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another user's cache: the time of use cannot be set."""
    built(0)

    def refuse(*_: object, **__: object) -> None:
        raise PermissionError("not yours")

    with monkeypatch.context() as patch:
        patch.setattr(cache_file.os, "utime", refuse)
        assert cache_file.kept(at, next((at / "keys").iterdir()).name) is not None
