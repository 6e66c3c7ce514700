"""The documentation builds without a warning, and holds every command and every public name."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html import unescape
from pathlib import Path

import click
import pytest
from snippets import ROOT

import hybridyn
from hybridyn.cli import COMMANDS, commands

DOCS = ROOT / "docs"
LIMIT = 300  # seconds; the build takes five on an idle core


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the pages as the README says, warnings being errors."""
    out = tmp_path_factory.mktemp("docs")
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "sphinx",
            "-W",
            "--keep-going",
            "-q",
            "-E",
            "-d",
            str(out / "trees"),
            "docs",
            str(out),
        ],
        cwd=ROOT,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=LIMIT,
    )
    assert done.returncode == 0, done.stderr
    return out


def text_of(page: Path) -> str:
    return unescape(re.sub(r"<[^>]+>", "", page.read_text()))


def test_every_command_and_option_has_its_place(built: Path) -> None:
    page = text_of(built / "commands.html")
    for name in COMMANDS:
        command = commands.get_command(click.Context(commands), name)
        assert f"Usage: hybridyn {name} " in page, name
        assert command is not None
        for parameter in command.params:
            if isinstance(parameter, click.Option) and not parameter.hidden:
                assert parameter.opts[-1] in page, (name, parameter.opts)


def test_every_public_name_has_its_place(built: Path) -> None:
    page = (built / "python.html").read_text()
    for name in set(hybridyn.__all__) - {"__version__"}:
        assert f'id="hybridyn.{name}"' in page, name


def test_every_page_is_in_the_table_of_contents() -> None:
    named = set(re.findall(r"^[\w/-]+$", (DOCS / "index.md").read_text(), re.MULTILINE))
    pages = {page.stem for page in [*DOCS.glob("*.md"), *DOCS.glob("*.rst")]} - {"index"}
    assert pages <= named
    assert named - pages == {"examples/index"}
