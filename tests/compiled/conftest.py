"""What tests of compiled models share: an empty cache of libraries."""

from pathlib import Path

import pytest


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let libraries be kept in a folder of the test."""
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"
