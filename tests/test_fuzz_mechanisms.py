"""Mechanisms go the whole way: models, compiled models and simulation, or a refusal of one line.

Mechanisms of any rank: the states are those that the library draws for itself. What it computes is judged
as `tests.robots.any_mechanism` allows: by the oracle to 1e-7, compiled models by the general path.

Mechanisms of clear rank: both models to rounding, or a refusal whose reason the oracle finds. Their blocks
are the tests, so that `--part` spreads them. A case is one state of one mechanism.
"""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import moving_states
from hybridyn.compiled.verifying import verify
from hybridyn.description import Description
from hybridyn.effects.choice import choose
from hybridyn.structure.building import build_robot
from tests.judges.generated_judge import judge
from tests.oracle import Base, Oracle
from tests.robots.any_mechanism import any_mechanism
from tests.robots.generated import Case, generated
from tests.robots.strategies import clear_rank, for_all, mechanisms, one_freedom
from tests.robots.swings import still_base
from tests.support.samples import fuzz, slow
from tests.support.waiting import outcome
from tests.support.written_out import Interpreted

CLOSED = 1e-9  # of states that the library draws or reaches, relative to its size
WORK = 1e-7  # of the largest term
ROUNDING = 1e-12  # of rows, whose factors are lengths below a metre
FASTEST = 1e12  # accelerations that only a quotient of roundings reaches
STEP, STEPS = 1e-3, 2


def went_through(seed: int, what: str) -> str:
    """Send a mechanism so far; say how far it came."""
    description, base = any_mechanism(seed)
    case = f"seed {seed}, base {base}"
    return outcome(case, lambda: go(description, base, seed, what, case))[1] or "through"


def go(description: Description, base: Base, seed: int, what: str, case: str) -> None:
    """Build a mechanism, and compile, simulate or judge it."""
    robot = build_robot(description, base=base)
    states = moving_states(robot, 2, seed)
    if what == "compile":
        verify(Interpreted(robot), robot, choose(robot, None))
    elif what == "simulate":
        simulated(robot, *states, case)
    else:
        judged(robot, *states, case)


def judged(robot: hybridyn.HybridRobot, q: np.ndarray, v: np.ndarray, tau: np.ndarray, case: str) -> None:
    """Compare both models with the oracle: loops, accelerations that keep them closed, and work."""
    oracle = Oracle(robot.description, robot.base)
    a = hybridyn.ddm(robot, q, v, tau)
    assert np.isfinite(a).all(), case
    efforts = None
    if robot.base != "floating" or len(robot.motors):
        efforts, _ = outcome(case, lambda: hybridyn.idm(robot, q, v, a))
    for t in range(len(q)):
        posture = oracle.posture(q[t])
        assert np.abs(oracle.residual(q[t])).max(initial=0.0) <= CLOSED * oracle.unit.max(), case
        if len(posture.K) and np.abs(posture.K).max() <= ROUNDING:
            continue  # rows that no freedom moves: the oracle counts the largest of them as one
        again = oracle.consistent_acceleration(q[t], v[t], a[t])
        size = np.abs(a[t]).max(initial=0.0) + np.abs(v[t]).max(initial=0.0) ** 2
        assert size < FASTEST, (case, "accelerations of rounding")
        assert np.abs(again - a[t]).max(initial=0.0) <= WORK * max(size, 1.0), (case, "accelerations")
        if efforts is None:
            continue
        expected, _ = oracle.idm_and_missing(q[t], v[t], a[t])
        B = oracle.motor_map(posture)
        terms = np.abs(B) @ (np.abs(expected) + np.abs(efforts[t]) + np.abs(tau[t]))
        for found in (expected, tau[t]):
            off = np.abs(B @ (efforts[t] - found)).max(initial=0.0)
            assert off <= WORK * max(terms.max(initial=0.0), 1.0), (case, "efforts", off)


def simulated(robot: hybridyn.HybridRobot, q: np.ndarray, v: np.ndarray, tau: np.ndarray, case: str) -> None:
    """Take some steps; loops stay closed."""
    moving = {}
    if robot.base == "moving":
        q, v = q.copy(), v.copy()
        q[:, :7], v[:, :6] = [0, 0, 0, 0, 0, 0, 1], 0.0
        moving["effects"] = ["default", still_base()]
    result = hybridyn.simulate(
        robot, q[0], v[0], (0, STEPS * STEP), method="rk4", step=STEP, initial_velocity="project", **moving
    )
    assert np.isfinite(result.q).all(), case
    assert result.residual.max() <= CLOSED, case
    if result.status == "finished":
        assert len(result.t) == STEPS + 1, case


@pytest.mark.parametrize("what", ["models", "compile"])
def test_a_motion_without_inertia_is_no_rounding_over_rounding(what: str) -> None:
    """Two massless slides, geared so that one goes as the other comes: accelerations were 1e19."""
    assert went_through(53, what) == "through"


MANY = [("models", 700), ("compile", 100), ("simulate", 200)]


@pytest.mark.parametrize(
    ("what", "count", "first"),
    [
        ("models", 16, 0),
        ("compile", 2, 0),
        ("simulate", 4, 0),
        slow("models", 160, 0),
        slow("compile", 35, 0),
        slow("simulate", 40, 0),
        *(fuzz(*case, 1000 * part) for case in MANY for part in range(1, 101)),
    ],
)
def test_generated_mechanisms(what: str, count: int, first: int) -> None:
    came = Counter(went_through(seed, what) for seed in range(first, first + count))
    assert came["through"] > count / 4, came


@pytest.mark.parametrize(("seed", "what"), [(85197, "models"), (38107, "simulate")])
def test_gears_that_lock_endless_joints_do_not_look_rounded(seed: int, what: str) -> None:
    """Starts between two sheets of an odd gear stop nearly closed; the file is exact all the same."""
    description, base = any_mechanism(seed)
    (module,) = build_robot(description, base=base).modules
    assert module.mechanism.rounding < ROUNDING
    assert went_through(seed, what) == "through"


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
