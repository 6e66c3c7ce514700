"""Expanded xacro and checked model files are kept, and used again while all they depend on is unchanged."""

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hybridyn.description import cache_folder
from hybridyn.description.side_cars import beside, model_toml
from hybridyn.description.urdf import xacro
from hybridyn.errors import CompileError, ModelError
from tests.robots.robot_texts import FOUR_BAR, save
from tests.support.comparing import refused


@pytest.fixture
def at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))
    return tmp_path


@pytest.fixture
def expand(at: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[str, bool]]:
    """Expand a file, and return its text and whether xacro expanded it."""
    made = []
    expanded = xacro._expanded

    def counted(*given: Any) -> Any:
        made.append(given)
        return expanded(*given)

    monkeypatch.setattr(xacro, "_expanded", counted)

    def expand(**arguments: object) -> tuple[str, bool]:
        before = len(made)
        text, _ = xacro.expand(str(at / "r.xacro"), arguments, ())
        return text.decode(), len(made) > before

    return expand


ROBOT = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:arg name="n" default="1"/><xacro:include filename="inner.xacro"/>
  <xacro:include filename="absent.xacro" optional="true"/>
</robot>"""


def test_an_expansion_is_kept_until_a_file_that_it_asked_for_changes(
    at: Path, expand: Callable[..., tuple[str, bool]]
) -> None:
    save(at, ROBOT, "r.xacro")
    save(at, '<robot name="first"><first/></robot>', "inner.xacro")
    first, again = expand(), expand()
    assert "<first " in first[0]
    assert (first[1], again) == (True, (first[0], False))
    changes = [("other", "inner.xacro"), ("absent", "absent.xacro"), ("own", "own.xacro")]
    for tag, name in changes:
        save(at, f"<robot><{tag}/></robot>", name)
        if tag == "own":
            save(at, ROBOT.replace("absent", "own"), "r.xacro")
        text, made = expand()
        assert made
        assert f"<{tag} " in text
        assert expand() == (text, False)
    (at / "own.xacro").unlink()
    assert expand()[1]
    assert [expand(n=n)[1] for n in (3, 4)] == [True, False]  # those of a sweep are traced
    save(at, "<robot><last/></robot>", "inner.xacro")
    text, made = expand(n=5)
    assert made
    assert "<last " in text


@pytest.mark.parametrize("harm", ["writable", "link", "cut", "open"])
def test_an_entry_that_somebody_else_may_have_written_is_not_used(
    at: Path, expand: Callable[..., tuple[str, bool]], harm: str
) -> None:
    save(at, "<robot/>", "r.xacro")
    expand()
    (entry,) = (cache_folder.folder() / "texts").iterdir()
    if harm == "writable":
        entry.chmod(0o666)
    elif harm == "link":
        entry.rename(at / "elsewhere")
        entry.symlink_to(at / "elsewhere")
    elif harm == "cut":
        entry.write_bytes(entry.read_bytes()[:-3])
    else:
        (cache_folder.folder() / "texts").chmod(0o777)
    assert expand()[1]
    assert expand()[1] is (harm in ("open", "link"))


def test_a_failure_is_not_kept(at: Path) -> None:
    save(at, FOUR_BAR.replace("<link", "<xacro:nothing/><link", 1), "r.xacro")
    refused(lambda: xacro.expand(str(at / "r.xacro"), {}, ()), ModelError, "xacro")
    assert not (cache_folder.folder() / "texts").exists()


def test_a_model_file_is_checked_once(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = b"[home]\ndrive = 1\nelbow = [0.6, 0.8]\n[effects.damper]\ncoefficient = { elbow = 2 }\n"
    first = model_toml.read_model_file(text, "m.toml")
    monkeypatch.setitem(sys.modules, "hybridyn.description.side_cars.tables", None)
    assert repr(model_toml.read_model_file(text, "m.toml")) == repr(first)  # a float stays a float
    assert first["home"] == {"drive": 1.0, "elbow": [0.6, 0.8]}
    monkeypatch.undo()
    monkeypatch.setenv("HYBRIDYN_CACHE", str(at / "cache"))
    for _ in range(2):
        refused(lambda: model_toml.read_model_file(b"home.drive = ''", "m.toml"), ModelError, "valid number")


def test_a_place_of_a_model_file_that_cannot_be_looked_at_is_an_error(
    at: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its motors and effects would be lost in silence."""
    look = os.stat

    def closed(path: Any, *args: Any, **kwargs: Any) -> os.stat_result:
        if "models" in os.fspath(path):
            raise PermissionError(13, "Permission denied", path)
        return look(path, *args, **kwargs)

    monkeypatch.setattr(beside.os, "stat", closed)
    refused(lambda: beside.find_model_file(str(at / "r.urdf")), PermissionError, r"models/r/model.toml")


def test_the_entries_used_least_recently_are_removed(at: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache_folder, "MOST_ENTRIES", 3)
    for i in range(3):
        cache_folder.keep(str(i), {"number": i})
        os.utime(cache_folder.folder() / "texts" / str(i), (i, i))
    assert cache_folder.kept("0") == {"number": 0}
    cache_folder.keep("3", [1.5])
    assert [cache_folder.kept(str(i)) for i in range(4)] == [{"number": 0}, None, {"number": 2}, [1.5]]


def test_a_large_text_and_a_folder_that_cannot_be_used_keep_nothing(
    at: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache_folder.keep("large", os.urandom(2 * cache_folder.LARGEST_ENTRY).hex())
    assert cache_folder.kept("large") is None
    save(at, "", "in_the_way")
    for cache in (str(at / "in_the_way"), ""):  # without a name, it is in the home folder
        monkeypatch.setenv("HYBRIDYN_CACHE", cache)
        monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
        monkeypatch.setattr(Path, "home", classmethod(_homeless))
        cache_folder.keep("any", {})
        assert cache_folder.kept("any") is None
    refused(cache_folder.folder, CompileError, r"no home folder for the cache: name .* HYBRIDYN_CACHE")


def _homeless(_: type[Path]) -> Path:
    """Fail as `Path.home` does for a user without a home folder."""
    raise RuntimeError("Could not determine home directory.")
