"""Both models to rounding at states of mechanisms of clear rank, or a refusal whose reason the oracle finds.

Blocks of mechanisms are the tests, so that `--part` spreads them. A case is one state of one mechanism.
"""

from collections.abc import Callable

import pytest

from tests.generated import Case, generated
from tests.generated_judge import judge
from tests.samples import fuzz, slow
from tests.strategies import clear_rank, for_all, mechanisms, one_freedom

SMALL, LARGE = 5, 9  # freedoms of the tree, at most: by default, and in the slow suite
STATES = 10  # of each mechanism
#: Found by the slow suite: gears of odd ratio, and weak rows, that lock a module.
FOUND = (2259, 5266)
FOUND_TOO = (1809, 2389, 2470, 2639, 2813, 3018, 3034, 3135)


def judge_models(case: Case) -> None:
    judge(case, case.states(STATES))


@pytest.mark.parametrize(
    ("freedoms", "keep", "first", "count"),
    [
        (2, clear_rank, 0, 12),
        (SMALL, clear_rank, 0, 12),
        (SMALL, one_freedom, 0, 6),
        slow(LARGE, clear_rank, 0, 100),
        *(fuzz(LARGE, clear_rank, 10_000 * block, 100) for block in range(1, 80)),
    ],
)
def test_models(freedoms: int, keep: Callable[[Case], bool], first: int, count: int) -> None:
    for_all(mechanisms(freedoms, keep, first), judge_models, count)


@pytest.mark.parametrize("seed", [*FOUND, *map(slow, FOUND_TOO)])
def test_models_that_were_refused(seed: int) -> None:
    judge_models(generated(seed, LARGE))
