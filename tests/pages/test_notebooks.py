"""The notebooks run from their first cell to their last, and are committed without results."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests import ROOT
from tests.support.extras import needs

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    content = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in content["cells"] if cell["cell_type"] == kind]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_have_words_pictures_and_no_results(path: Path) -> None:
    code = cells(path, "code")
    assert all((cell["outputs"], cell["execution_count"]) == ([], None) for cell in code)
    assert "".join(cells(path, "markdown")[0]["source"]).startswith("# ")
    assert sum("plt.show()" in "".join(cell["source"]) for cell in code) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path) -> None:
    for extra in ("plot", "sweep", "identify"):
        needs(extra)
    program = "\n\n".join("".join(cell["source"]) for cell in cells(path, "code"))
    environment = {**os.environ, "MPLBACKEND": "agg", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-W", "error", "-W", "ignore:FigureCanvasAgg", "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
