"""Both models to rounding at states of mechanisms of clear rank, or a refusal whose reason the oracle finds.

Blocks of seeds are the tests, so that `--part` spreads them. A case is one state of one mechanism.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.verifying import MODEL_AGREES
from hybridyn.errors import HybridynError
from hybridyn.structure.building import build_robot
from tests.generated import Case, State, generated
from tests.generated_judge import judge, natural_acceleration, states_of
from tests.samples import fuzz, slow
from tests.waiting import must_end
from tests.written_out import Interpreted

SMALL, LARGE = 5, 9  # freedoms of the tree, at most: by default, and in the slow suite
TRUSTED = 1.0  # guards of written-out models above this hand a state to the general path
STATES = 10  # of each mechanism
#: Found by the slow suite: gears of odd ratio, and weak rows, that lock a module.
FOUND = (2259, 5266)
FOUND_TOO = (1809, 2389, 2470, 2639, 2813, 3018, 3034, 3135)
WRITTEN_OUT = 4  # states of each mechanism whose models are written out


def drawn(first: int, count: int, freedoms: int, states: int) -> Iterator[tuple[Case, list[State]]]:
    """Yield mechanisms with their states, each bounded in time."""
    for seed in range(first, first + count):
        with must_end(f"seed {seed}"):
            case = generated(seed, freedoms)
            yield case, case.states(states)


def judge_all(first: int, count: int, freedoms: int) -> None:
    for case, states in drawn(first, count, freedoms, STATES):
        try:
            judge(case, states)
        except (AssertionError, HybridynError) as error:
            pytest.fail(f"seed {case.seed}, {freedoms} freedoms, {case.base}: {error}")


def judge_written_out(first: int, count: int, freedoms: int) -> int:
    """Compare written-out models with the general path; return the number of trusted samples."""
    trusted = 0
    for case, states in drawn(first, count, freedoms, WRITTEN_OUT):
        robot = build_robot(case.description, base=case.base)
        q, v, _, tau = states_of(states)
        base = [np.zeros((len(q), 6))] if case.base == "moving" else []
        library = Interpreted(robot, ("idm", "ddm"))
        a = hybridyn.ddm(robot, q, v, tau)
        (got,), guard = library.batch("ddm", q, v, tau, *base)
        size = np.abs(a / robot.unit).max(axis=1, initial=0.0) + natural_acceleration(case, v)
        off = np.abs((got - a) / robot.unit).max(axis=1, initial=0.0) / size
        trusted += int((guard <= TRUSTED).sum())
        assert (off[guard <= TRUSTED] <= MODEL_AGREES["float64"]).all(), (
            f"seed {case.seed}: ddm differs by {off.max():.1e}"
        )
    return trusted


@pytest.mark.parametrize("block", range(4))
def test_models(block: int) -> None:
    judge_all(8 * block, 8, SMALL)


@pytest.mark.parametrize("seed", FOUND)
def test_models_that_were_refused(seed: int) -> None:
    judge_all(seed, 1, LARGE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", FOUND_TOO)
def test_more_models_that_were_refused(seed: int) -> None:
    judge_all(seed, 1, LARGE)


@pytest.mark.parametrize("block", [slow(0), *(fuzz(block) for block in range(1, 80))])
def test_models_of_many(block: int) -> None:
    judge_all(1000 + 100 * block, 100, LARGE)


def test_written_out_models() -> None:
    assert judge_written_out(0, 3, 4) > 0


@pytest.mark.parametrize("block", [slow(0), *(fuzz(block) for block in range(1, 20))])
def test_written_out_models_of_many(block: int) -> None:
    assert judge_written_out(1000 + 25 * block, 25, LARGE) > 0
