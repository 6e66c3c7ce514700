"""The page of tolerances: written from the code, each with a name of its own and a reason."""

from __future__ import annotations

from collections import Counter

from docs.extensions.tolerances import PAGE, page, tolerances


def test_the_page_is_that_of_the_code() -> None:
    assert PAGE.read_text() == page(), "run `python docs/extensions/tolerances.py`"


def test_each_tolerance_has_a_name_of_its_own_and_a_reason() -> None:
    found = list(tolerances())
    assert len(found) > 100
    assert [name for name, count in Counter(t.name for t in found).items() if count > 1] == []
    assert [f"{t.file}: {t.name}" for t in found if not t.reason] == []
