"""Both models to rounding at states of mechanisms of clear rank, or a refusal whose reason the oracle finds.

Blocks of mechanisms are the tests, so that `--part` spreads them. A case is one state of one mechanism.
"""

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.verifying import MODEL_AGREES
from hybridyn.structure.building import build_robot
from tests.generated import Case, generated
from tests.generated_judge import judge, natural_acceleration, states_of
from tests.samples import fuzz, slow
from tests.strategies import for_all, mechanisms, one_freedom
from tests.written_out import Interpreted

SMALL, LARGE = 5, 9  # freedoms of the tree, at most: by default, and in the slow suite
TRUSTED = 1.0  # guards of written-out models above this hand a state to the general path
STATES = 10  # of each mechanism
#: Found by the slow suite: gears of odd ratio, and weak rows, that lock a module.
FOUND = (2259, 5266)
FOUND_TOO = (1809, 2389, 2470, 2639, 2813, 3018, 3034, 3135)
WRITTEN_OUT = 4  # states of each mechanism whose models are written out


def judge_models(case: Case) -> None:
    judge(case, case.states(STATES))


def judge_written_out(case: Case) -> int:
    """Compare the written-out direct model with the general path; return the number of trusted samples."""
    robot = build_robot(case.description, base=case.base)
    q, v, _, tau = states_of(case.states(WRITTEN_OUT))
    base = [np.zeros((len(q), 6))] if case.base == "moving" else []
    a = hybridyn.ddm(robot, q, v, tau)
    (got,), guard = Interpreted(robot, ("ddm",)).batch("ddm", q, v, tau, *base)
    size = np.abs(a / robot.unit).max(axis=1, initial=0.0) + natural_acceleration(case, v)
    off = np.abs((got - a) / robot.unit).max(axis=1, initial=0.0) / size
    assert (off[guard <= TRUSTED] <= MODEL_AGREES["float64"]).all(), off
    return int((guard <= TRUSTED).sum())


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


@pytest.mark.parametrize(
    ("block", "freedoms", "count"),
    [(0, 4, 3), slow(1, LARGE, 25), *(fuzz(block, LARGE, 25) for block in range(2, 20))],
)
def test_written_out_models(block: int, freedoms: int, count: int) -> None:
    trusted: list[int] = []
    strategy = mechanisms(freedoms, first=10_000 * block)
    for_all(strategy, lambda case: trusted.append(judge_written_out(case)), count)
    assert sum(trusted) > 0
