"""The cache of built libraries takes nothing that somebody else may have written."""

import os
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest

from hybridyn.compiled.library import cache
from hybridyn.compiled.library.cache import Built
from hybridyn.errors import CompileError
from tests.compiled.toys import cached, numbered
from tests.support.comparing import refused


@pytest.fixture
def group_may_write() -> Iterator[None]:
    """Make new files and folders writable by the group, as many systems do."""
    before = os.umask(0o002)
    yield
    os.umask(before)


def built() -> tuple[Built, int]:
    """Return a library, and how often its source was asked for."""
    asked = []
    return cached("key", lambda: asked.append(1) or numbered(1)), len(asked)


def test_a_folder_in_which_others_can_write_is_refused(empty_cache: Path) -> None:
    built()
    for folder, mode in product((".", "keys", "libraries"), (0o777, 0o720, 0o1777)):
        (empty_cache / folder).chmod(mode)
        refused(built, CompileError, r"others can write in .*chmod go-w .* HYBRIDYN_CACHE")
        (empty_cache / folder).chmod(mode & ~0o022)
        assert built()[1] == 0, (folder, oct(mode))


def test_a_folder_that_anybody_can_replace_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "open" / "mine" / "cache"))
    built()
    (tmp_path / "open").chmod(0o777)
    refused(built, CompileError, r"anybody can replace .*chmod o-w .*open'.* HYBRIDYN_CACHE")
    for mode in (0o1777, 0o775):  # only owners rename there, as in /tmp; a group of one's own
        (tmp_path / "open").chmod(mode)
        assert built()[1] == 0


def test_a_folder_of_somebody_else_is_refused(empty_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    built()
    other = os.geteuid() + 1
    monkeypatch.setattr(os, "geteuid", lambda: other)
    refused(built, CompileError, r"belongs to another user.*HYBRIDYN_CACHE")


def test_the_users_own_folder_is_looked_at_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HYBRIDYN_CACHE", raising=False)
    monkeypatch.setattr(cache, "folder", lambda: tmp_path / "default")
    built()
    (tmp_path / "default").chmod(0o777)
    refused(built, CompileError, "others can write")


@pytest.mark.parametrize("pattern", ["keys/*", "libraries/*.so"])
def test_files_that_others_can_write_are_made_anew(empty_cache: Path, pattern: str) -> None:
    built()
    for file in empty_cache.glob(pattern):
        file.chmod(0o666)
    assert built()[1] == 1
    assert file.stat().st_mode & 0o022 == 0
    assert built()[1] == 0


def test_a_link_in_the_cache_is_not_followed(empty_cache: Path, tmp_path: Path) -> None:
    library = built()[0].path
    library.rename(tmp_path / "elsewhere.so")
    library.symlink_to(tmp_path / "elsewhere.so")
    assert built()[1] == 1
    assert not library.is_symlink()


@pytest.mark.usefixtures("group_may_write")
def test_what_is_built_is_the_users_alone_whatever_the_system_gives(empty_cache: Path) -> None:
    built()
    assert built()[1] == 0
    assert all(path.stat().st_mode & 0o022 == 0 for path in empty_cache.rglob("*"))
