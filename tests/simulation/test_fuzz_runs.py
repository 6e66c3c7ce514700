"""Runs of generated mechanisms: accelerations, energy, and runs that stop and go on. A case is one run."""

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.task import closure_residual
from hybridyn.simulation.result import Result
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.generated import Case
from tests.generated_judge import condition, natural_acceleration
from tests.samples import fuzz, slow
from tests.strategies import for_all, mechanisms

STEP = 1e-3  # of the runs [s]
CLOSED = 1e-10  # the project's claim on closures
FORWARD = 1e-12  # of the condition number
ENERGY = 1e-8  # of what is exchanged: a step's error is its fifth power
BITS = ("t", "q", "v", "a", "tau", "kinetic", "potential", "residual", "pivot")


def moved(
    case: Case, state: tuple[np.ndarray, ...], robot: HybridRobot, steps: int, **options: object
) -> Result:
    """Simulate so many steps; a base that is prescribed rests."""
    (q, v, _, tau), more = state, {}
    if case.base == "moving":
        v = case.oracle.project_velocity(q, np.concatenate([np.zeros(6), v[6:]]))
        pose, rest = q[:7].copy(), np.zeros(6)
        more = {"base_motion": lambda t: (pose, rest, rest)}
    return hybridyn.simulate(
        robot, q, v, (0.0, steps * STEP), method="rk4", step=STEP, effort=tau, **more, **options
    )  # type: ignore[arg-type]


def judge_run(case: Case) -> None:
    """Check a run from home under constant efforts by the oracle, its energy, and one that stopped."""
    state, robot = case.states(1)[0], build_robot(case.description, base=case.base)
    run = moved(case, state, robot, 2)
    assert run.status == "finished", run.message
    assert closure_residual(robot, run.q).max() <= CLOSED
    q, v, a = run.q[-1], run.v[-1], run.a[-1]
    wanted = case.oracle.ddm(q, v, state[-1])
    unit = case.oracle.unit
    size = np.abs(wanted / unit).max() + natural_acceleration(case, v[None])[0]
    off = np.abs((a - wanted) / unit).max() / size
    assert off <= FORWARD * condition(case, q), f"accelerations differ by {off:.1e}"
    work = np.trapezoid(np.sum(run.tau * run.v[:, case.oracle.motors], axis=1), run.t)
    gained = run.energy[-1] - run.energy[0]
    exchanged = np.abs(run.tau * run.v[:, case.oracle.motors]).sum() * STEP + np.ptp(run.kinetic)
    curved = (
        (size * STEP) * np.abs(run.tau).sum() * np.abs(v / unit).max(initial=1.0) * STEP
    )  # of the trapezoids
    assert abs(gained - work) <= ENERGY * (exchanged + np.abs(run.energy).max()) + curved, "energy is lost"
    half = moved(case, state, robot, 1)
    again = moved(case, state, robot, 2, resume=half)
    assert all(getattr(again, name).tobytes() == getattr(run, name).tobytes() for name in BITS)


@pytest.mark.parametrize(
    ("freedoms", "first", "count"),
    [(4, 0, 4), slow(9, 0, 50), *(fuzz(9, 10_000 * block, 50) for block in range(1, 20))],
)
def test_runs(freedoms: int, first: int, count: int) -> None:
    for_all(mechanisms(freedoms, first=first), judge_run, count)
