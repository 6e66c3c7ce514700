"""What tests of compiled models share: an empty cache of libraries, and models that CasADi runs or C."""

from pathlib import Path

import pytest

from tests.support.samples import slow


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Let libraries be kept in a folder of the test."""
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture(params=["casadi", slow("c")])
def by(request: pytest.FixtureRequest) -> str:
    """Let CasADi run the models of a test about their equations; C runs them under the mark `slow`."""
    if request.param == "casadi":
        request.getfixturevalue("interpreted")
    return str(request.param)
