"""The pages on checks, workspaces, sizing and maps of joints: commands print what is shown."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from hybridyn.cli import main
from hybridyn.studies.check.check import CODES
from tests import ROOT
from tests.extras import needs
from tests.pages.test_readme import same_line
from tests.samples import slow
from tests.snippets import blocks, stand_where_a_user_does

PAGES = ("check.md", "workspace-and-sizing.md", "joint-map.md")


@pytest.mark.parametrize("page", [page if page == "check.md" else slow(page) for page in PAGES])
def test_commands_print_what_is_shown(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    needs("view", "trimesh")  # the first page checks a robot with meshes
    stand_where_a_user_does(tmp_path, monkeypatch)
    monkeypatch.setenv("COLUMNS", "90")
    parts = [part for block in blocks(ROOT / "docs" / page, "console") for part in block.text.split("$ ")[1:]]
    assert parts
    for part in parts:
        command, _, expected = part.partition("\n")
        program, *words = shlex.split(command)
        assert (program, main(words)) == ("hybridyn", 0), command
        out, err = capsys.readouterr()
        for found, wanted in zip((out + err).splitlines(), expected.splitlines(), strict=True):
            assert same_line(found, wanted), (command, found, wanted)


def test_the_table_of_codes_is_complete() -> None:
    text = (ROOT / "docs" / "check.md").read_text()
    rows = re.findall(r"^\| `([\w-]+)` \| (\w+) \| (.*) \|$", text, re.MULTILINE)
    assert {code: (severity, title) for code, severity, title in rows} == CODES
