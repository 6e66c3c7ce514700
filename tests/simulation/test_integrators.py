"""Steps: order measured against step size, stiff stability, closures at every stage.

Runs of generated mechanisms: accelerations, energy, and runs that stop and go on. A case is one run.
"""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.task import closure_residual
from hybridyn.effects import Damper, Spring
from hybridyn.errors import AssemblyError
from hybridyn.simulation.conserving import Conserving
from hybridyn.simulation.result import SimulationResult
from hybridyn.simulation.runge_kutta import DOPRI5, RK4, Implicit
from hybridyn.simulation.system import State, System
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.judges.generated_judge import condition, natural_acceleration
from tests.robots.generated import Case
from tests.robots.strategies import for_all, mechanisms
from tests.robots.swings import begin, chain, equal_bits, hinge, rod, still_base, swing
from tests.support.comparing import refused
from tests.support.samples import fuzz, slow, some

#: Time span by robot, so that errors of the coarsest step are small and those of the finest above rounding.
SPANS = {"five_bar": 0.12, "gough_stewart": 0.08, "serial_all:fixed": 0.06}
ORDER = 0.35  # how far a measured order may fall short
CLOSED = 1e-10  # the project's claim


def steps(system: System, state: State, method: object, span: float, count: int) -> State:
    """Take equal steps."""
    for _ in range(count):
        state = method.step(system, state, span / count).state  # type: ignore[attr-defined]
        assert system.manifold.residual(state.q)[0] <= CLOSED
        assert system.manifold.opening(state.q, state.v)[0] <= CLOSED
    return state


def apart(system: System, x: State, y: State) -> float:
    """Return how far two states are apart in q and v, without units."""
    dq = system.manifold.retraction.difference(x.q, y.q)
    return float(np.abs(np.concatenate([dq, x.v - y.v]) / np.tile(system.manifold.unit, 2)).max())


@pytest.fixture(scope="module", params=some(SPANS, ("five_bar", "gough_stewart")))
def reference(request: pytest.FixtureRequest) -> tuple[System, State, float, State]:
    system, state = begin(swing(request.param))
    span = SPANS[request.param]
    return system, state, span, steps(system, state, DOPRI5, span, 16)


@pytest.mark.parametrize(("name", "order", "counts"), [
    ("rk4", 4, (3, 6)), ("dopri5", 5, (2, 4)), ("implicit", 3, (8, 16)), ("conserving", 2, (4, 8)),
])  # fmt: skip
def test_order(
    reference: tuple[System, State, float, State], name: str, order: int, counts: tuple[int, int]
) -> None:
    system, state, span, exact = reference
    methods = {"rk4": RK4, "dopri5": DOPRI5, "implicit": Implicit()}
    method = methods.get(name) or Conserving(system.law)
    finer = 2 if span == SPANS["five_bar"] else 1  # it moves fast: the asymptote begins later
    coarse, fine = (apart(system, steps(system, state, method, span, finer * n), exact) for n in counts)
    assert fine < 1e-2
    assert np.log2(coarse / fine) > order - ORDER


def test_error_estimate_tells_the_error_and_a_step_out_of_reach_says_so() -> None:
    system, state = begin(swing("five_bar"))
    exact = steps(system, state, DOPRI5, 0.04, 4)
    for method in (DOPRI5, Implicit()):
        stepped = method.step(system, state, 0.04)
        estimate = max(np.abs(x / system.manifold.unit).max() for x in (stepped.error_q, stepped.error_v))
        error = apart(system, stepped.state, exact)
        assert 0.3 * error < estimate < 1000 * error  # it is the error of the lower order
    fast = State(0.0, state.q, 40 * state.v, state.a)  # 30 rad along free motions in the first stage
    for method in (RK4, DOPRI5, Implicit(), Conserving(system.law)):
        refused(lambda: method.step(system, fast, 2.0), AssemblyError, "out of reach")  # noqa: B023


@pytest.fixture
def stiff(tmp_path: Path) -> tuple[System, State]:
    """Return a mass on a spring of 1e6 N/m and a damper of 1e6 N s/m, out of its rest by 1 mm."""
    text = rod("mass", 1.0, "0 0 0", (0.1, 0.1, 0.1)), hinge("slide", "base", "mass", kind="prismatic")
    robot = chain(tmp_path, *text)
    effects = ["inertia", "leg_inertia", "velocity", Spring({"slide": 1e6}), Damper({"slide": 1e6})]
    return begin((robot, np.array([1e-3]), np.zeros(1)), effects=effects)


def test_implicit_steps_are_stable_where_explicit_ones_are_not(stiff: tuple[System, State]) -> None:
    system, state = stiff
    # Overdamped: the slow root of s^2 + c s + k is -1/s to 1e-6, the fast one -1e6/s; steps of 0.05 s.
    slow = -(1e6 - np.sqrt(1e12 - 4e6)) / 2
    explicit, implicit = state, state
    for _ in range(2):
        explicit = RK4.step(system, explicit, 0.05).state
    for _ in range(20):
        implicit = Implicit().step(system, implicit, 0.05).state
    assert abs(explicit.q[0]) > 1e3
    assert implicit.q[0] == pytest.approx(1e-3 * np.exp(slow * 1.0), rel=1e-5)
    assert implicit.v[0] == pytest.approx(slow * implicit.q[0], rel=1e-4)  # the fast part is gone: L-stable


STEP = 1e-3  # of the runs [s]
FORWARD = 1e-12  # of the condition number
ENERGY = 1e-8  # of what is exchanged: a step's error is its fifth power


def moved(
    case: Case, state: tuple[np.ndarray, ...], robot: HybridRobot, steps: int, **options: object
) -> SimulationResult:
    """Simulate so many steps; a base that is prescribed rests."""
    (q, v, _, tau), more = state, {}
    if case.base == "moving":
        v = case.oracle.project_velocity(q, np.concatenate([np.zeros(6), v[6:]]))
        more = {"effects": ["default", still_base(q[:7])]}
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
    assert equal_bits(again, run)


@pytest.mark.parametrize(
    ("freedoms", "first", "count"),
    [(4, 0, 4), slow(9, 0, 50), *(fuzz(9, 10_000 * block, 50) for block in range(1, 20))],
)
def test_runs(freedoms: int, first: int, count: int) -> None:
    for_all(mechanisms(freedoms, first=first), judge_run, count)
