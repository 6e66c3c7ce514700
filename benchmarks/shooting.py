"""How many iterations DDP needs with exact second derivatives and without: a leg with a parallel ankle.

Each motion is found from several first efforts, and by Crocoddyl from the same ones where it is installed. An
iteration is one backward pass whose step is taken.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any, NamedTuple

import numpy as np

import hybridyn
from benchmarks.cases import ROOT
from benchmarks.ddp import Problem, fly, solve
from benchmarks.results import Row
from hybridyn.optimal_control.closed_model import ClosedModel
from hybridyn.spatial import Array

#: Where hip, knee and the motors of the ankle go [rad], by the motion.
MOTIONS = {
    "lift": (-0.9, 1.3, 0.3, 0.1),
    "kick": (-1.2, 1.0, -0.2, -0.4),
    "back": (0.6, 0.5, 0.4, 0.3),
}
#: Number and length of steps [s], efforts that cost alike [N m], costs at the end of positions and of rates.
STEPS, STEP, SIZE, PLACE, RATE = 25, 0.02, (20.0, 20.0, 8.0, 8.0), 10.0, 1.0
#: First efforts hold the leg, and have noise of this share of `SIZE` from the second start on.
NOISE = 0.02
#: Difference from the efforts that exact DDP ends with, over `SIZE`, that is small, and the most iterations.
SMALL, MOST = 1e-6, 60
#: Difference after which the path of a solution tells no more.
TOLD = 1e-9
EFFECTS = "model"
FDDP = "Crocoddyl FDDP"


class _Run(NamedTuple):
    """A solution.

    Attributes:
        cost: The last one.
        efforts: The first efforts, and those after each iteration.
        seconds: Processor time [s].
    """

    cost: float
    efforts: list[Array]
    seconds: float


def leg_problem(goal: tuple[float, ...]) -> Problem:
    """Return the problem of a motion of the leg."""
    robot = hybridyn.load(ROOT / "benchmarks" / "robots" / "leg.urdf.xacro")
    m = len(robot.motors)
    at_end = np.repeat([PLACE, RATE], m)
    ends = np.append(robot.home[robot.motor_q], np.zeros(m)), np.append(goal, np.zeros(m))
    return Problem(ClosedModel(robot, "ddm", EFFECTS), *ends, np.array(SIZE), STEP, STEPS, at_end)


def first_efforts(problem: Problem, start: int) -> Array:
    """Return the first efforts of a start, shape (T, m)."""
    robot = problem.model.robot
    still = np.zeros(robot.nv)
    hold = np.tile(hybridyn.idm(robot, robot.home, still, still, effects=EFFECTS), (problem.steps, 1))
    noise = np.random.default_rng(start).normal(size=hold.shape) * problem.size
    return hold + (NOISE * noise if start else 0.0)


def measure(motion: str, starts: int = 5) -> list[Row]:
    """Find a motion from several starts by each method.

    Returns:
        A row for each start, and for the first one the error after each iteration; a note where Crocoddyl
        is not installed.
    """
    problem = leg_problem(MOTIONS[motion])
    methods: dict[str, Callable[[Array], _Run]] = {
        "exact": partial(_ours, problem, exact=True),
        "Gauss-Newton": partial(_ours, problem, exact=False),
    }
    there = importlib.util.find_spec("crocoddyl") is not None
    if there:
        methods[FDDP] = partial(_crocoddyl, problem)
    first = [first_efforts(problem, start) for start in range(starts)]
    fly(problem, first[0])  # builds what is compiled
    solve(problem, first[0], exact=True)
    found = {method: [call(u) for u in first] for method, call in methods.items()}
    best = found["exact"][0].efforts[-1]
    rows = [] if there else [Row("leg", motion, FDDP, note="crocoddyl is not installed")]
    for method, runs in found.items():
        for start, run in enumerate(runs):
            off = [float(np.abs((u - best) / problem.size).max()) for u in run.efforts]
            needed = next((float(k) for k, error in enumerate(off) if error <= SMALL), np.nan)
            row = Row("leg", motion, method, f"start {start}", iterations=needed, error=off[-1])
            rows.append(row._replace(seconds=run.seconds, value=run.cost))
            if start == 0:
                told = next((k for k, error in enumerate(off) if error <= TOLD), len(off))
                rows += [
                    Row("leg", motion, method, "path", at=k, error=error)
                    for k, error in enumerate(off[: told + 1])
                ]
    return rows


def _ours(problem: Problem, u: Array, *, exact: bool) -> _Run:
    before = process_time()
    flights = solve(problem, u, exact=exact, most=MOST).flights
    return _Run(flights[-1].cost, [one.u for one in flights], process_time() - before)


def _crocoddyl(problem: Problem, u: Array) -> _Run:
    """Solve the problem by FDDP, from the motion of the first efforts."""
    import crocoddyl

    from hybridyn.optimal_control.crocoddyl_model import MotorAction

    robot, m = problem.model.robot, len(problem.size)
    state = crocoddyl.StateVector(2 * m)
    running, end = crocoddyl.CostModelSum(state, m), crocoddyl.CostModelSum(state, m)
    for costs, weights, residual in (
        (running, problem.size**-2.0, crocoddyl.ResidualModelControl(state, m)),
        (end, problem.at_end, crocoddyl.ResidualModelState(state, problem.goal, m)),
    ):
        activation = crocoddyl.ActivationModelWeightedQuad(weights)
        costs.addCost("cost", crocoddyl.CostModelResidual(state, activation, residual), 1.0)
    steps, last = (MotorAction(robot, costs, EFFECTS) for costs in (running, end))
    euler = [crocoddyl.IntegratedActionModelEuler(steps, problem.step)] * problem.steps
    whole = crocoddyl.ShootingProblem(problem.start, euler, crocoddyl.IntegratedActionModelEuler(last, 0.0))
    solver, flight = crocoddyl.SolverFDDP(whole), fly(problem, u)
    efforts = [u]

    class Kept(crocoddyl.CallbackAbstract):  # type: ignore[misc]
        """Keeps the efforts after each iteration."""

        def __call__(self, now: Any) -> None:
            efforts.append(np.array([*now.us]))

    solver.setCallbacks([kept := Kept()])
    solver.th_stop = 1e-30  # it goes on as long as it can
    before = process_time()
    solver.solve([*flight.x], [*u], MOST, True)
    del kept
    return _Run(float(solver.cost), efforts, process_time() - before)
