"""Each format has a page with tables of what is read, what is refused, and what is lost on the way out."""

from __future__ import annotations

import re

import pytest

from tests import ROOT

#: First column of the table of what is read, by page.
PAGES = {"mjcf": "MJCF", "sdf": "SDF", "usd": "USD", "pinocchio": "Pinocchio", "describing-loops": "`type`"}


@pytest.mark.parametrize("page", PAGES)
def test_a_page_has_its_three_tables(page: str) -> None:
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    heads = re.findall(r"^\| (.*?) \|.*\n\|(?:-+\|)+\n\| ", text, re.MULTILINE)
    assert {PAGES[page], "refused"} <= {*heads}
    assert any(head.startswith("lost") for head in heads)
