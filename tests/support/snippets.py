"""The fenced blocks of the Markdown pages, for the tests that run them."""

import re
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import pytest

from tests import ROOT

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


class Block(NamedTuple):
    """One fenced block.

    Attributes:
        page: Its page.
        line: Line of its first line of text, from 1.
        language: First word after the fence.
        facts: The words after that: `rows=5` as a pair, a bare word with an empty value.
        text: Its text.
    """

    page: Path
    line: int
    language: str
    facts: dict[str, str]
    text: str

    def __str__(self) -> str:
        """Name the block in a test's id."""
        return f"{self.page.name}:{self.line}"

    def run(self, names: dict[str, object]) -> None:
        """Run it as Python, lines numbered as on the page."""
        exec(compile("\n" * (self.line - 1) + self.text, str(self.page), "exec"), names)


def blocks(page: Path, language: str | None = None) -> list[Block]:
    """Return the blocks of a page, of one language or of all."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in re.finditer(r"^```(\w+)([^\n]*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        facts = dict(word.partition("=")[::2] for word in match[2].split())
        found.append(Block(page, text.count("\n", 0, match.start(3)) + 1, match[1], facts, match[3]))
    return [block for block in found if language in (None, block.language)]


def stand_where_a_user_does(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Go to a folder that has the shipped robots, as a clone has, and may be written to."""
    for name in ("urdf", "models"):
        (folder / name).symlink_to(ROOT / name)
    monkeypatch.chdir(folder)


def run_python(page: Path) -> dict[str, object]:
    """Run a page's Python blocks one after the other in one namespace, lines numbered as on the page."""
    names: dict[str, object] = {"__name__": "__page__"}
    for block in blocks(page, "python"):
        if (module := block.facts.get("needs")) and find_spec(module) is None:
            continue
        block.run(names)
    return names
