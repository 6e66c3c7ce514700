"""The package of the page, installed."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.extending.packages import forget, install_workshop, use


@pytest.fixture
def packages(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a folder in which a test installs packages, before it asks hybridyn for what they add."""
    with monkeypatch.context() as patch:
        (tmp_path / "site").mkdir()
        use(tmp_path / "site", patch)
        yield tmp_path / "site"
    forget()


@pytest.fixture
def workshop(packages: Path) -> Path:
    """Install the package of the page in a folder of its own."""
    install_workshop(packages)
    return packages
