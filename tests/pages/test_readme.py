"""The README: its Python runs, its commands print what it shows; `.ci/run` runs the set-up commands whole."""

import re
import shlex
import tomllib
from itertools import groupby
from pathlib import Path

import pytest
import yaml

import hybridyn
from hybridyn.cli import COMMANDS
from tests import ROOT
from tests.pages.console import run_commands, shown
from tests.snippets import blocks, run_python, stand_where_a_user_does

README = ROOT / "README.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.fixture(autouse=True)
def as_a_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "90")
    stand_where_a_user_does(tmp_path, monkeypatch)


@pytest.mark.slow
def test_python_runs() -> None:
    run_python(README)


@pytest.mark.slow
def test_commands_print_what_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """In the order of the page: a later command reads what an earlier one wrote."""
    run_commands(shown(README), capsys)
    run_commands(shown(ROOT / "docs" / "command-line.md"), capsys, whole=True)


@pytest.mark.parametrize("block", blocks(README, "sh"), ids=str)
def test_setup_command_names_what_exists(block) -> None:
    for is_and, group in groupby(shlex.split(block.text), key="&&".__eq__):
        if is_and:
            continue
        program, *words = group
        name = Path(program).name
        assert name in ("python3", "pip", "pytest", "hybridyn")
        if name == "pip":
            (extras,) = re.fullmatch(r"\.(?:\[(.*)\])?", words[-1]).groups()
            extras = set(extras.split(",")) if extras else set()
            assert extras <= PROJECT["project"]["optional-dependencies"].keys()
        if name == "hybridyn":
            assert words[0] in COMMANDS
            assert all((ROOT / word).is_file() for word in words[1:])


@pytest.mark.parametrize("marker", ["main job", "tests"])
def test_ci_finds_the_setup_commands(marker: str) -> None:
    assert README.read_text().count(f"<!-- {marker} -->\n```sh\n") == 1
    assert f'readme_command "{marker}"' in (ROOT / ".ci" / "run").read_text()


def test_version_and_paper_are_stated_alike() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert PROJECT["project"]["version"] == hybridyn.__version__ == citation["version"]
    assert PROJECT["project"]["license"] == citation["license"]
    assert citation["preferred-citation"]["doi"] == "10.1016/j.mechmachtheory.2009.11.007"
    assert citation["preferred-citation"]["doi"] in README.read_text()
