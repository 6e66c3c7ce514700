"""Both models to rounding at states of mechanisms of clear rank, or a refusal whose reason the oracle finds.

Blocks of mechanisms are the tests, so that `--part` spreads them. A case is one state of one mechanism.
"""

import pytest

from tests.generated import Case, generated
from tests.generated_judge import judge
from tests.samples import fuzz, slow
from tests.strategies import for_all, mechanisms, one_freedom

SMALL, LARGE = 5, 9  # freedoms of the tree, at most: by default, and in the slow suite
STATES = 10  # of each mechanism
#: Found by the slow suite: gears of odd ratio, and weak rows, that lock a module.
FOUND = (2259, 5266)
FOUND_TOO = (1809, 2389, 2470, 2639, 2813, 3018, 3034, 3135)


def judge_models(case: Case) -> None:
    judge(case, case.states(STATES))


@pytest.mark.parametrize("freedoms", [2, SMALL])
def test_models(freedoms: int) -> None:
    for_all(mechanisms(freedoms), judge_models, 12)


def test_models_of_one_freedom() -> None:
    for_all(mechanisms(SMALL, one_freedom), judge_models, 6)


@pytest.mark.parametrize("seed", [*FOUND, *map(slow, FOUND_TOO)])
def test_models_that_were_refused(seed: int) -> None:
    judge_models(generated(seed, LARGE))


@pytest.mark.parametrize("block", [slow(0), *(fuzz(block) for block in range(1, 80))])
def test_models_of_many(block: int) -> None:
    for_all(mechanisms(LARGE, first=10_000 * block), judge_models, 100)
