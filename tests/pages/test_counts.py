"""Pages that count what the code or a list beside them holds: each count is named here, and counted."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import hybridyn
from hybridyn.description.motors import RANKING
from hybridyn.description.records import RotationKind
from tests import ROOT
from tests.robots.robot_texts import CLOSED_FOUR_BAR
from tests.support.extras import needs
from tests.support.files import save

PAGES = [*(ROOT / name for name in ("README.md", "CONTRIBUTING.md")), *sorted((ROOT / "docs").rglob("*.md"))]
#: From two on.
WORDS = [
    "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve", "thirteen",
    "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen", "twenty",
]  # fmt: skip
NOUNS = [
    "studies", "sources", "forms", "formats", "commands", "engines", "effects", "measures", "examples",
    "layers", "quantities", "dialects", "extras", "scripts", "kinds", "types", "tables", "columns",
    "settings", "methods", "rules", "cases", "options", "statuses", "robots", "tools",
]  # fmt: skip
COUNT = re.compile(
    rf"(?<![\w,.])({'|'.join(WORDS)}|\d+) (?:(?!of\b|and\b|or\b|in\b)[a-z-]+ )?({'|'.join(NOUNS)})\b",
    re.IGNORECASE,
)


def bullets_below(page: str, words: str) -> int:
    """Count the entries of the list that follows some words."""
    after = (ROOT / page).read_text().partition(words)[2].partition("\n\n")[2]
    return len(re.findall(r"^- ", after.partition("\n\n")[0], re.MULTILINE))


def robots_of_the_section() -> int:
    """Count the whole robots below the heading."""
    page = (ROOT / "docs/describing-loops.md").read_text()
    return len(
        re.findall(r"^```xml whole=", page.partition("## Three robots")[2].partition("\n## ")[0], re.M)
    )


#: Number of what a page counts, by page and words.
COUNTED: dict[tuple[str, str], Callable[[], int]] = {
    ("CONTRIBUTING.md", "four kinds"): lambda: len(get_args(RotationKind)),
    ("docs/describing-loops.md", "three robots"): robots_of_the_section,
    ("docs/scenes.md", "two forms"): lambda: bullets_below("docs/scenes.md", "one of two forms:"),
    ("docs/tables.md", "three options"): lambda: bullets_below("docs/tables.md", "Three options select"),
}


def counts_in(page: Path) -> dict[str, int]:
    """Return the counts of a page by their words, without those of code, output and captions."""
    text = re.sub(r"^(```|~~~).*?^\1", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    lines = " ".join(line for line in text.splitlines() if not line.startswith("!["))
    found = {match[0].lower(): match[1].lower() for match in COUNT.finditer(lines)}
    return {words: int(n) if n.isdigit() else WORDS.index(n) + 2 for words, n in found.items()}


def test_what_pages_count_is_counted() -> None:
    found = {
        (page.relative_to(ROOT).as_posix(), words): number
        for page in PAGES
        for words, number in counts_in(page).items()
    }
    assert found == {key: count() for key, count in COUNTED.items()}


def test_the_page_lists_the_sources_of_motors() -> None:
    """The caller, the sources that files state in their order, and a rule each for trees and for loops."""
    page = (ROOT / "docs/describing-loops.md").read_text()
    listed = page.partition("## Motors")[2].partition("```")[0]
    assert len(re.findall(r"^\d+\. ", listed, re.MULTILINE)) == 1 + len(RANKING) + 2


@pytest.mark.parametrize(("ending", "closes"), [("urdf", 0.0), ("xml", 0.0), ("sdf", 10.0)])
def test_a_file_whose_loops_are_open_by_rounding_keeps_what_the_page_says(
    ending: str, closes: float, tmp_path: Path
) -> None:
    """SDF states loops closed: what the file's digits leave open is what the efforts differ by."""
    if ending == "xml":
        needs("mjcf")
    text = CLOSED_FOUR_BAR.replace('rpy="0 0 -0.4"', 'rpy="0 0 -0.400000003"')
    robot = hybridyn.load(save(tmp_path, text, "bar.urdf"))
    opening = hybridyn.closure_residual(robot, robot.home)
    hybridyn.convert(robot, tmp_path / f"out.{ending}")
    efforts = []
    for one in (robot, hybridyn.load(tmp_path / f"out.{ending}")):
        start = float(one.home[one.motor_q[0]])
        motion = {one.motors[0]: (np.array([start + 0.3]), np.array([1.0]), np.array([0.5]))}
        efforts.append(hybridyn.idm(one, *hybridyn.assemble(one, motors=motion)))
    off = float(np.abs(efforts[1] / efforts[0] - 1.0).max())
    assert 1e-9 < opening < 1e-8
    assert off <= max(1e-12, closes * opening)
    assert (off > 1e-12) == bool(closes)
