"""Searches by gradients and DDP: right slopes, quadratic ends, and the same way as Crocoddyl's."""

from importlib.util import find_spec

import numpy as np
import pytest

import hybridyn
from benchmarks import descents, searches, shooting
from benchmarks.ddp import Problem, fly, solve
from benchmarks.results import Row
from hybridyn.optimal_control.closed_model import ClosedModel
from tests.support.comparing import close_to
from tests.support.extras import needs

#: Of central differences of a cost around one: rounding over STEP, and STEP^2.
DIFFERENCES, STEP = 1e-8, 1e-5
#: Derivative at which DDP ends; its curvature is of order one.
DONE = 1e-7
#: Relative; FDDP begins with a regularization of 1e-9, and the least curvature over an effort is 5e-5.
REGULARIZED = 2e-3
#: Orders of convergence that are quadratic and linear: they are 2 and 1 at the end itself.
QUADRATIC, LINEAR = 1.7, 1.1


def five_bar_swing() -> tuple[Problem, np.ndarray]:
    """Return a short motion of a five-bar, and efforts that hold it at home."""
    robot = hybridyn.load("five_bar")
    still, home = np.zeros(robot.nv), robot.home[robot.motor_q]
    ends = np.append(home, [0.0, 0.0]), np.append(home + np.array([0.6, 0.5]), [0.0, 0.0])
    at_end = np.array([10.0, 10.0, 1.0, 1.0])
    problem = Problem(ClosedModel(robot, "ddm"), *ends, np.array([5.0, 5.0]), 0.09, 3, at_end)
    return problem, np.tile(hybridyn.idm(robot, robot.home, still, still), (3, 1))


def order(errors: list[float]) -> float:
    """Return the order of convergence that the last three errors show."""
    first, second, third = np.log(errors[-3:])
    return float((third - second) / (second - first))


def test_ddp_ends_quadratically_with_exact_second_derivatives_alone(interpreted: None) -> None:
    """CasADi runs the models: that C agrees with it is shown elsewhere."""
    problem, u = five_bar_swing()
    exact, approximate = (solve(problem, u, exact=curved, done=DONE) for curved in (True, False))
    assert len(exact.flights) < len(approximate.flights)
    assert order(exact.gradients) > QUADRATIC
    assert order(approximate.gradients) < LINEAR
    close_to(exact.flights[-1].cost, approximate.flights[-1].cost, DONE)  # the square of DONE, and rounding

    def slope(k: int) -> float:
        """Return the derivative of the cost over a first effort, which moves the robot farthest."""
        step = np.zeros(u.shape)
        step[0, k] = STEP * problem.size[k]
        return (fly(problem, u + step).cost - fly(problem, u - step).cost) / (2 * STEP)

    largest = max(abs(slope(k)) for k in range(2)) / problem.step
    close_to(exact.gradients[0], largest, DIFFERENCES)


def test_the_slope_of_an_energy_is_its_derivative() -> None:
    random = np.random.default_rng(0)
    p, change, G = random.uniform(5.0, 20.0, 7), random.normal(size=7), random.normal(size=(3, 7))
    at = np.array([5.0, 6.0, 8.0])

    def energy(step: float) -> float:
        return searches.energy(tuple(at + step * G @ change), (p + step * change)[searches.RATIOS])

    wanted = (energy(STEP) - energy(-STEP)) / (2 * STEP)
    close_to(searches.slope(tuple(at), G, p[searches.RATIOS]) @ change, wanted, DIFFERENCES)


def test_a_solver_that_is_absent_is_no_line_of_the_table() -> None:
    measured = Row("leg", "lift", "exact", "start 0", iterations=9.0, seconds=0.02)
    absent = Row("leg", "lift", shooting.FDDP, note="crocoddyl is not installed")
    _, lines = descents.iterated({"shooting": [measured, absent]})
    assert lines == [["lift", "DDP, exact", "9", "9", "20"]]


@pytest.mark.slow
def test_searches_of_a_leg_follow_their_gradients() -> None:
    needs("bench", "cma")
    rows = searches.searches(0, (30, 48))
    reached = {(row.method, row.at): row.value for row in rows}
    assert reached["SLSQP", 48] < reached["SLSQP", 30] < 14.0  # the start needs 14.26 J
    assert reached["CMA-ES", 48] <= reached["CMA-ES", 30]


@pytest.mark.slow
def test_ddp_of_a_leg_goes_the_way_of_crocoddyl() -> None:
    rows = shooting.measure("lift", 1)
    assert [row.method for row in rows if row.note] == ([] if find_spec("crocoddyl") else [shooting.FDDP])
    needed = {row.method: row.iterations for row in rows if row.setting != "path"}
    assert needed["exact"] < needed["Gauss-Newton"]
    needs("crocoddyl", "crocoddyl")
    ways = [[row.error for row in rows if row.setting == "path" and row.method == method][:8]
            for method in ("Gauss-Newton", "Crocoddyl FDDP")]  # fmt: skip
    np.testing.assert_allclose(ways[0], ways[1], rtol=REGULARIZED)
