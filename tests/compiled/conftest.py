"""What tests of compiled models share: an empty cache, models that CasADi runs or C, libraries without C."""

from collections.abc import Mapping
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


@pytest.fixture
def uncompiled(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a library be its C source, where a test looks at files and opens none."""

    def build(units: Mapping[str, str], compiler: object, target: Path, *_: object) -> None:
        target.write_text("".join(units.values()))

    monkeypatch.setattr("hybridyn.compiled.library.cache.build", build)
