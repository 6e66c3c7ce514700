"""Generic postures that are kept are those of the search, bit by bit, and only for the same module."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.description.cache_folder import folder
from hybridyn.linkage import generic_postures as searching
from hybridyn.linkage.generic_postures import FOLDER, generic_postures, kept_generic_postures


def entries() -> list[Path]:
    return sorted((folder() / FOLDER).glob("*"))


def test_kept_postures_are_those_of_the_search(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path))
    monkeypatch.setattr(searching, "WORTH_KEEPING", 1)
    searched: list[Any] = []

    def counting(*given: Any) -> Any:
        """Search, and count it."""
        searched.append(given)
        return generic_postures(*given)

    monkeypatch.setattr(searching, "generic_postures", counting)
    first = hybridyn.load("five_bar").modules[0].mechanism
    again = hybridyn.load("five_bar").modules[0].mechanism
    assert len(searched) == len(entries()) == 1
    assert np.array_equal(first.postures, again.postures)
    assert first.best_residual == again.best_residual
    wanted, _ = generic_postures(*searched[0])
    assert np.array_equal(again.postures, wanted)
    closures, home, *rest = searched[0]
    kept_generic_postures(closures, np.nextafter(home, 4.0), *rest)
    assert len(searched) == len(entries()) == 2


def test_small_modules_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path))
    hybridyn.load("five_bar")
    assert not entries()
