"""Random mechanisms as a strategy of hypothesis, which shrinks what fails: fewer parts, freedoms and gears.

for_all(mechanisms(5), judge, 32)
for_all(mechanisms(5, keep=one_freedom), judge, 32)
"""

from collections.abc import Callable

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from tests.robots.generated import BASES, PARTS, Case, Layout, case_of
from tests.support.waiting import must_end


def clear_rank(case: Case) -> bool:
    """Keep mechanisms of clear rank."""
    return case.mobility is not None


def one_freedom(case: Case) -> bool:
    """Keep mechanisms with one freedom, on any base but a free one."""
    return case.mobility == 1


@st.composite
def mechanisms(
    draw: st.DrawFn, freedoms: int = 9, keep: Callable[[Case], bool] = clear_rank, first: int = 0
) -> Case:
    """Draw mechanisms whose trees have up to so many freedoms.

    Args:
        draw: Draws numbers and names; smaller ones where a failure is shrunk.
        freedoms: Of the tree, at most.
        keep: Which mechanisms are tried.
        first: Least seed of the geometry, masses and names.
    """
    seed = draw(st.integers(first, first + 10_000))
    layout = Layout(np.random.default_rng(seed), draw(st.integers(1, freedoms)))
    parts = draw(st.lists(st.sampled_from(PARTS), min_size=1, max_size=freedoms))
    for part in parts:
        if layout.left > 0:
            getattr(layout, part)()
    for _ in range(draw(st.sampled_from((0, 0, 1, 2)))):
        layout.couple()
    case = case_of(layout, draw(st.sampled_from(BASES)), seed, parts)
    assume(keep(case))
    return case


def for_all(strategy: st.SearchStrategy[Case], check: Callable[[Case], object], count: int) -> None:
    """Check so many drawn mechanisms, always the same ones; what fails is shrunk and told."""

    def within_time(case: Case) -> None:
        with must_end(case):
            check(case)

    few = settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=[*HealthCheck],
    )
    few(given(strategy)(within_time))()
