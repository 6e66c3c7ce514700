"""The page "Extending": its package installs, and its Python runs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests import ROOT
from tests.extending.packages import PAGE, files
from tests.support.extras import needs
from tests.support.files import save
from tests.support.snippets import Block, blocks, stand_where_a_user_does


def shown() -> list[Block]:
    return [block for block in blocks(PAGE, "python") if "file" not in block.facts]


@pytest.mark.parametrize("block", shown(), ids=str)
def test_python_of_the_page_runs(
    block: Block, workshop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    needs("compiled")
    stand_where_a_user_does(tmp_path, monkeypatch)
    exec(compile("\n" * (block.line - 1) + block.text, str(PAGE), "exec"), {"__name__": "__page__"})


@pytest.mark.slow
def test_package_of_the_page_installs(tmp_path: Path) -> None:
    """A fresh environment finds what pip installs, and hybridyn lists it."""
    for file, block in files().items():
        if file == "pyproject.toml" or file.startswith("workshop/"):
            save(tmp_path / "source", block.text, file)
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*pip, "--target", tmp_path / "site", tmp_path / "source"], check=True)
    asked = [sys.executable, "-m", "hybridyn", "idm", "five_bar", "--effects", "magnet,drg"]
    path = os.pathsep.join([str(tmp_path / "site"), str(ROOT)])
    done = subprocess.run(asked, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    assert "there is no effect 'drg' (did you mean 'drag'?)" in done.stderr
