"""The README: its Python runs, its commands print what it shows; `.ci/run` runs the set-up commands whole."""

from __future__ import annotations

import re
import shlex
import subprocess
import tomllib
from itertools import groupby
from pathlib import Path

import pytest
import yaml

import hybridyn
from hybridyn.cli import COMMANDS, main
from tests import ROOT
from tests.snippets import blocks, run_python, stand_where_a_user_does

README = ROOT / "README.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
SHOWN = 1e-3  # numbers are printed with two to six digits
ROUNDING = 1e-9  # what is printed of a closed loop is rounding, other on every machine
MACHINE = re.compile(r"[\d,.]+(?= samples/s)|(?<=wall time )[\d.]+")  # speeds


@pytest.fixture(autouse=True)
def as_a_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "90")
    stand_where_a_user_does(tmp_path, monkeypatch)


@pytest.mark.slow
def test_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    run_python(README)
    assert "84 24 [6, 6, 6, 6]\n" in capsys.readouterr().out  # as the comment beside it says


def shown() -> list[tuple[str, str]]:
    """Return the commands that the README shows with their output."""
    pairs = []
    for block in blocks(README, "console"):
        for part in re.split(r"^\$ ", block.text, flags=re.MULTILINE)[1:]:
            command, _, output = part.partition("\n")
            pairs.append((command, output))
    return pairs


def same_word(word: str, expected: str) -> bool:
    try:
        a, b = float(word), float(expected)
    except ValueError:
        return word == expected
    return abs(a - b) <= max(SHOWN * abs(b), ROUNDING)


def same_line(line: str, expected: str) -> bool:
    """Compare word by word; where the README ends a line with `...` the rest is free."""
    found, wanted = (MACHINE.sub("#", text).split() for text in (line, expected))
    if wanted[-1:] == ["..."]:
        del found[len(wanted) - 1 :], wanted[-1]
    return len(found) == len(wanted) and all(map(same_word, found, wanted))


@pytest.mark.slow
def test_commands_print_what_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """In the order of the page: a later command reads what an earlier one wrote."""
    for command, expected in shown():
        program, *words = shlex.split(command)
        if program != "hybridyn":
            subprocess.run(command, shell=True, check=True)
            continue
        assert main(words) == 0, command
        out, err = capsys.readouterr()
        for found, wanted in zip((out + err).splitlines(), expected.splitlines(), strict=True):
            assert same_line(found, wanted), (command, found, wanted)


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
