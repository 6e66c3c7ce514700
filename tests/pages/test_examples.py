"""The examples run, check what they claim, and make their pictures; the committed ones are small."""

import importlib
from pathlib import Path

import pytest

from tests import ROOT
from tests.extras import needs
from tests.samples import some

FOLDER = ROOT / "docs" / "examples"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "pictures")
LARGEST = 150_000  # bytes of a committed picture


def run(name: str, words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    if "hybridyn.sweep(" in (FOLDER / f"{name}.py").read_text():
        needs("sweep")
    monkeypatch.syspath_prepend(FOLDER)
    importlib.import_module(name).main(words)


def is_a_picture(path: Path) -> bool:
    from PIL import Image

    with Image.open(path) as picture:
        return picture.width > 600 and len(picture.convert("RGB").getcolors(2**24) or []) > 20


@pytest.mark.parametrize("name", some(SCRIPTS, ()))
def test_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(name, ["--short", "--to", str(tmp_path)], monkeypatch)
    assert is_a_picture(tmp_path / f"{name}.png")


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_whole_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run(name, ["--to", str(tmp_path)], monkeypatch)
    assert is_a_picture(tmp_path / f"{name}.png")


@pytest.mark.parametrize("name", SCRIPTS)
def test_committed_picture_is_small_and_shown(name: str) -> None:
    assert is_a_picture(FOLDER / f"{name}.png")
    assert (FOLDER / f"{name}.png").stat().st_size < LARGEST
    page = (FOLDER / "index.md").read_text()
    assert f"({name}.py)" in page
    assert f"({name}.png)" in page
