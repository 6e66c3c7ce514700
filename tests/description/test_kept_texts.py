"""Expanded xacro and checked model files are kept, and used again while all they depend on is unchanged."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hybridyn.description import kept_texts
from hybridyn.description.cache_folder import folder
from hybridyn.description.side_cars import model_toml
from hybridyn.description.urdf import xacro, xacro_process
from hybridyn.errors import CompileError, ModelError
from tests.robot_texts import FOUR_BAR, save

#: A stand-in for the child: it asks for the files that its first one lists, and answers with their content.
CHILD = """
import json, sys
def ask(what, of):
    print(json.dumps({"ask": what, "of": of}), flush=True)
    header = json.loads(sys.stdin.readline())
    return sys.stdin.read(header["size"]) if "size" in header else header["error"]
request = json.loads(sys.stdin.readline())
text = ask("read", request["file"])
for line in text.splitlines():
    text += ask(*line.split())
print(json.dumps({"notes": ["a note"], "locks": ["seccomp"], "size": len(text.encode())}))
sys.stdout.write(text)
"""


@pytest.fixture
def at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def expand(at: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[str, bool]]:
    """Expand a file, and return its text and whether a child was started."""
    xacro_process.drop_child()  # of a study that this process evaluated
    monkeypatch.setattr(xacro_process, "START", CHILD)
    monkeypatch.setattr(xacro, "START", CHILD)
    started = []
    child = xacro.child_of

    def counted(file: str, *, kept: bool) -> Any:
        started.append(file)
        return child(file, kept=kept)

    monkeypatch.setattr(xacro, "child_of", counted)

    def expanded(**arguments: object) -> tuple[str, bool]:
        before = len(started)
        text, notes = xacro.expand(str(at / "r.xacro"), arguments, ())
        assert notes == ["a note"]
        return text.decode(), len(started) > before

    return expanded


def test_an_expansion_is_kept_until_a_file_that_it_asked_for_changes(
    at: Path, expand: Callable[..., tuple[str, bool]]
) -> None:
    robot = f"read {at}/inner.txt\nglob {at}/part*\nfind hybridyn_absent\n"
    save(at, robot, "r.xacro")
    save(at, "first", "inner.txt")
    first, again = expand(), expand()
    assert "first" in first[0]
    assert (first[1], again) == (True, (first[0], False))
    changes: list[tuple[Callable[[], object], str]] = [
        (lambda: save(at, "other", "inner.txt"), "other"),
        (lambda: (at / "inner.txt").unlink(), "No such file"),
        (lambda: save(at, "", "part1"), "part1"),
        (lambda: save(at, robot + f"read {at}/part1", "r.xacro"), "part1"),
        (lambda: (at / "hybridyn_absent" / "urdf").mkdir(parents=True), "hybridyn_absent"),
    ]
    for change, there in changes:
        change()
        text, made = expand()
        assert made
        assert there in text
        assert expand() == (text, False)
    assert expand(n=3)[1]
    save(at, "first", "inner.txt")  # what was kept for another state of the files does not return
    assert expand()[1]


@pytest.mark.parametrize("harm", ["writable", "link", "cut", "open"])
def test_an_entry_that_somebody_else_may_have_written_is_not_used(
    at: Path, expand: Callable[..., tuple[str, bool]], harm: str
) -> None:
    save(at, "", "r.xacro")
    expand()
    (entry,) = (folder() / "texts").iterdir()
    if harm == "writable":
        entry.chmod(0o666)
    elif harm == "link":
        entry.rename(at / "elsewhere")
        entry.symlink_to(at / "elsewhere")
    elif harm == "cut":
        entry.write_bytes(entry.read_bytes()[:-3])
    else:
        (folder() / "texts").chmod(0o777)
    assert expand()[1]
    assert expand()[1] is (harm in ("open", "link"))


def test_a_failure_is_not_kept(at: Path) -> None:
    save(at, FOUR_BAR.replace("<link", "<xacro:nothing/><link", 1), "r.xacro")
    with pytest.raises(ModelError, match="xacro"):
        xacro.expand(str(at / "r.xacro"), {}, ())
    assert not (folder() / "texts").exists()


def test_a_model_file_is_checked_once(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = b"[home]\ndrive = 1\nelbow = [0.6, 0.8]\n[effects.damper]\ncoefficient = { elbow = 2 }\n"
    first = model_toml.read_model_file(text, "m.toml")
    monkeypatch.setitem(sys.modules, "hybridyn.description.side_cars.model_tables", None)
    assert repr(model_toml.read_model_file(text, "m.toml")) == repr(first)  # a float stays a float
    assert first["home"] == {"drive": 1.0, "elbow": [0.6, 0.8]}
    monkeypatch.undo()
    monkeypatch.setenv("HYBRIDYN_CACHE", str(at / "cache"))
    for _ in range(2):
        with pytest.raises(ModelError, match="valid number"):
            model_toml.read_model_file(b"home.drive = 'one'", "m.toml")


def test_the_entries_used_least_recently_are_removed(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(kept_texts, "MOST_ENTRIES", 3)
    for i in range(3):
        kept_texts.keep(str(i), {"number": i})
        os.utime(folder() / "texts" / str(i), (i, i))
    assert kept_texts.kept("0") == {"number": 0}
    kept_texts.keep("3", [1.5])
    assert [kept_texts.kept(str(i)) for i in range(4)] == [{"number": 0}, None, {"number": 2}, [1.5]]


def test_a_large_text_and_a_folder_that_cannot_be_used_keep_nothing(
    at: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept_texts.keep("large", os.urandom(2 * kept_texts.LARGEST_ENTRY).hex())
    assert kept_texts.kept("large") is None
    save(at, "", "in_the_way")
    monkeypatch.setenv("HYBRIDYN_CACHE", str(at / "in_the_way"))
    kept_texts.keep("any", json.loads("{}"))
    assert kept_texts.kept("any") is None
    monkeypatch.delenv("HYBRIDYN_CACHE")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setattr(Path, "home", classmethod(_homeless))
    kept_texts.keep("any", {})
    assert kept_texts.kept("any") is None
    with pytest.raises(CompileError, match=r"no home folder for the cache: name .* HYBRIDYN_CACHE"):
        folder()


def _homeless(_: type[Path]) -> Path:
    """Fail as `Path.home` does for a user without a home folder."""
    raise RuntimeError("Could not determine home directory.")
