"""The page "Extending": its package installs, and its Python runs."""

import inspect
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import extensions
from hybridyn.studies.sweep.evaluation import Designer
from hybridyn.studies.sweep.reading import read_study
from tests import ROOT
from tests.extending.packages import PAGE, install_workshop
from tests.support.command_line import call
from tests.support.extras import needs
from tests.support.files import beginning, save
from tests.support.snippets import Block, blocks, stand_where_a_user_does


def shown() -> list[Block]:
    return [block for block in blocks(PAGE, "python") if "file" not in block.facts]


@pytest.mark.parametrize("block", shown(), ids=str)
def test_python_of_the_page_runs(
    block: Block, workshop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interpreted: None
) -> None:
    needs("compiled")
    monkeypatch.setitem(inspect.unwrap(hybridyn.compile).__kwdefaults__, "wait", False)  # as users have it
    stand_where_a_user_does(tmp_path, monkeypatch)
    block.run({"__name__": "__page__"})


@pytest.mark.slow
def test_package_of_the_page_installs(tmp_path: Path) -> None:
    """Pip installs it as a wheel, and a fresh process finds what it adds."""
    site, wheel = tmp_path / "made", tmp_path / "workshop-1.0-py3-none-any.whl"
    install_workshop(site)
    about = site / "workshop-1.0.dist-info"
    save(about, "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n", "WHEEL")
    every = [path for path in site.rglob("*") if path.is_file()]
    save(about, "".join(f"{path.relative_to(site)},,\n" for path in every), "RECORD")
    with zipfile.ZipFile(wheel, "w") as archive:
        for path in [*every, about / "RECORD"]:
            archive.write(path, path.relative_to(site))
    pip = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--target", tmp_path / "site", wheel], check=True)
    asked = [sys.executable, "-m", "hybridyn", "idm", "five_bar", "five_bar/traj.csv", "--effects", "drg"]
    path = os.pathsep.join([str(tmp_path / "site"), str(ROOT)])
    done = subprocess.run(asked, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True)
    assert "there is no effect 'drg' (did you mean 'drag'?)" in done.stderr


def test_own_names_ask_for_no_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(extensions, "_points", None)  # a call would fail
    table = beginning(tmp_path, "five_bar", 3)
    call(capsys, "idm", "five_bar", table, "--effects", "default,spring", status=1, says="no numbers for")
    call(capsys, "idm", "five_bar", table, "--effects", "model", "-o", tmp_path / "out.csv")
    call(capsys, "info", "five_bar")
    designs = "[designs]\nmethod = 'grid'\n[parameters]\nmass = { values = [0.3] }"
    task = "[tasks.t]\ntrajectory = 'motion.csv'\nmeasure = ['peak_effort', 'stroke_margin']"
    numbers = "[numbers]\n'mass:m1_left_lower' = 'mass'"
    save(tmp_path, f"robot.file = 'five_bar'\n{designs}\n{numbers}\n{task}\n", "study.toml")
    source = read_study(tmp_path / "study.toml")
    assert Designer(source)(0, np.array([0.3])).message == ""
