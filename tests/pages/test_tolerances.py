"""The page of tolerances: written from the code, each with a name of its own and a reason."""

from __future__ import annotations

from collections import Counter

from docs.extensions.tolerances import PAGE, page, tolerances


def test_the_page_names_each_tolerance_of_the_code_once_and_gives_a_reason() -> None:
    found = list(tolerances())
    assert PAGE.read_text() == page(found), "run `python docs/extensions/tolerances.py`"
    assert len(found) > 100
    assert [name for name, count in Counter(t.name for t in found).items() if count > 1] == []
    assert [f"{t.file}: {t.name}" for t in found if not t.reason] == []
