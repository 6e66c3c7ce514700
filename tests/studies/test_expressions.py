"""Expressions over columns, compared with Python's own numbers, row by row."""

import numpy as np
import pytest

from hybridyn.studies.sweep.expressions import Expression

COLUMNS = {"a": [0.5, 1.5, 2.5, 1.0], "b": [2.0, 0.0, 3.0, 1.0]}


@pytest.mark.parametrize(
    "text",
    [
        "-(a > 1)", "+(a > 1)", "(a > 1) - (b > 1)", "(a > 1) + (b > 1)", "(a > 1) * (b > 1)", "-(not a > 1)",
        "abs((a > 1) - 2)", "abs(a > 1)", "(a > 1) ** 2", "(a > 1) / 2 > 0", "1 - (a > 1 and b > 1)",
    ],
)  # fmt: skip
def test_what_is_true_counts_one(text: str) -> None:
    found = Expression(text, ["a", "b"], "--where")({name: np.array(x) for name, x in COLUMNS.items()})
    rows = zip(*COLUMNS.values(), strict=True)
    wanted = [eval(text, {"__builtins__": {"abs": abs}}, {"a": a, "b": b}) for a, b in rows]
    assert np.array_equal(found, wanted)
    assert Expression("sqrt(a > 1)", ["a", "b"], "--where")({"a": np.array([2.0])}).dtype == float
