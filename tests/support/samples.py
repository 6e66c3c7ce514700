"""What the default suite tries of many robots; the others are under the mark `slow`."""

from collections.abc import Iterable, Sequence
from typing import Any

import pytest

#: Of the recipes of `KINDS` one for each thing that a recipe can have: trees, closures of few and many rows,
#: couplings, as many motors as freedoms, more and fewer, wrists that are cut, motions without mass, stacks.
CHOSEN = (
    "serial_all", "loop_fixed", "loop_planar", "four_bar_two_motors", "five_bar_one_motor", "gough_gimbals",
    "star_four", "delta_bars", "gear_three", "stack", "on_leg",
)  # fmt: skip


def slow(*values: Any) -> Any:
    """Return the parameters of a slow case."""
    return pytest.param(*values, marks=pytest.mark.slow)


def fuzz(*values: Any) -> Any:
    """Return the parameters of a case that takes hours with its like."""
    return pytest.param(*values, marks=pytest.mark.fuzz)


def some(values: Iterable[str], chosen: Sequence[str] = CHOSEN) -> list[Any]:
    """Return parameters: the chosen ones as they are, all others as slow cases."""
    return [value if value in chosen else slow(value) for value in values]


def in_turn(values: Iterable[str], others: Sequence[Any], chosen: Sequence[str] | None = CHOSEN) -> list[Any]:
    """Return all pairs of parameters; by default each chosen value with one of the others, which take turns.

    Args:
        values: Names.
        others: What each is combined with: bases, say.
        chosen: Those that are tried by default; all where None.
    """
    values = list(values)
    kept = [value for value in values if chosen is None or value in chosen]
    turn = {(value, others[i % len(others)]) for i, value in enumerate(kept)}
    pairs = [(value, other) for value in values for other in others]
    return [pair if pair in turn else slow(*pair) for pair in pairs]


def each(first: Any, cases: Iterable[Any]) -> list[Any]:
    """Return cases with one more value before theirs; slow ones stay slow."""
    return [
        pytest.param(first, *getattr(case, "values", case), marks=getattr(case, "marks", ()))
        for case in cases
    ]
