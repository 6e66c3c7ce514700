"""Through postures where closures lose rank and several motions part: the one that is smooth is followed.

A row of rhombic loops (linear along its regular motion) and an antiparallelogram (not), started at, near and
before the posture in which all bars lie in one line, by every method.

Bounds: an adaptive run adds up the errors of some fifty steps; fixed steps have their order's error, which
the same method has away from such postures. Accelerations are those of the integrated limits, to the
square of the distance, within `branch.NEAR`. Rates between steps are projected, which loses two powers of the
distance down to `branch.LOST`.
"""

from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import hybridyn
from hybridyn.manifold.branch import LOST_ACCELERATIONS, LOST_RATES
from hybridyn.simulation.motion_law import MotionLaw
from tests import ROOT
from tests.hard.benchmark_references import all_bars, n_four_bar
from tests.hard.claims import Claim
from tests.hard.one_freedom import REFERENCE, OneFreedom
from tests.hard.redundant_loops import crossed_bars, loaded
from tests.support.comparing import refused
from tests.support.samples import slow, some

BARS = ROOT / "urdf" / "benchmarks" / "n_four_bar.urdf.xacro"
DISTANCES = (0.0, 1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 2e-2)
FEW = (0.0, 1e-9, 1e-3)
METHODS = {
    "dopri5": ({"rtol": 1e-8}, 5e-7),
    "loose": ({"rtol": 1e-4, "atol": 1e-5}, 5e-3),
    "rk4": ({"method": "rk4", "step": 0.02}, 1e-5),
    "conserving": ({"method": "conserving", "step": 0.01}, 1e-3),
    "implicit": ({"method": "implicit", "rtol": 1e-5, "atol": 1e-6}, 5e-4),
}
SPAN = 0.08
PROJECTED = np.finfo(float).eps / LOST_RATES**2
SIDES = 1e-9  # two loops of a row are told apart by rounding over the distance only


@pytest.fixture(scope="module")
def bars() -> hybridyn.HybridRobot:
    return hybridyn.load(str(BARS), gravity=(0, -9.81, 0), xacro_args={"n": 2})


@pytest.fixture(scope="module")
def crossed(tmp_path_factory: pytest.TempPathFactory) -> OneFreedom:
    linkage = crossed_bars()
    return OneFreedom(loaded(tmp_path_factory.mktemp("crossed"), linkage), linkage.law)


def by_method(*default: str) -> list[Any]:
    """Return methods and distances: by default few distances for some methods, as slow cases all for all."""
    return [*((method, FEW) for method in default), *(slow(method, DISTANCES) for method in METHODS)]


@pytest.mark.parametrize(("method", "distances"), by_method("dopri5", "rk4", "conserving"))
def test_rhombic_loops(
    claim: Claim, bars: hybridyn.HybridRobot, method: str, distances: tuple[float, ...]
) -> None:
    options, bound = METHODS[method]
    rng = np.random.default_rng(7)
    worst, apart = 0.0, 0.0
    for distance in distances:
        rate = -rng.uniform(1.0, 5.0)
        start = all_bars(distance - np.pi / 2, bars.joints), all_bars(rate, bars.joints)
        result = hybridyn.simulate(bars, *start, (0, SPAN), **options)
        assert result.status == "finished", (distance, result.message)
        exact, _ = n_four_bar(2, result.t, distance, rate)
        feet = result.q * all_bars(1.0, bars.joints)
        worst = max(worst, np.abs(feet[:, 0] + np.pi / 2 - exact).max())
        apart = max(apart, np.abs(feet - feet[:, :1]).max())
    claim(f"row of rhombic loops, {method}", "theta [rad]", worst, bound)
    claim(f"row of rhombic loops, {method}", "angle between uprights [rad]", apart, SIDES)


@pytest.mark.parametrize(("method", "distances"), by_method("dopri5", "conserving"))
def test_antiparallelogram(
    claim: Claim, crossed: OneFreedom, method: str, distances: tuple[float, ...]
) -> None:
    options, bound = METHODS[method]
    rng = np.random.default_rng(8)
    worst = 0.0
    for distance in distances:
        rate = -rng.uniform(1.0, 3.0)
        q, v, _ = crossed.state(distance, rate)
        result = hybridyn.simulate(crossed.robot, q, v, (0, SPAN), **options)
        assert result.status == "finished", (distance, result.message)
        exact = np.array([crossed.state(*x)[0] for x in crossed.motion(distance, rate, result.t)])
        worst = max(worst, np.abs(result.q - exact).max())
    claim(f"antiparallelogram, {method}", "angles [rad]", worst, bound)


def test_accelerations_near_and_at_the_posture(claim: Claim, crossed: OneFreedom) -> None:
    """What the direct model gives the integrator, from 1e-1 to 1e-12 and at the posture."""
    law = MotionLaw(crossed.robot)
    worst = 0.0
    for distance in (0.0, *np.geomspace(1e-12, 1e-1, 12)):
        s_ddot = crossed.acceleration(distance, -2.0)
        q, v, a = crossed.state(distance, -2.0, s_ddot)
        worst = max(worst, np.abs(law.acceleration(0.0, q, v) - a).max() / np.abs(a).max())
    claim("antiparallelogram", "accelerations, 1e-12 to 1e-1 from the posture", worst, LOST_ACCELERATIONS**2)


@pytest.mark.parametrize("method", some(("rk4", "conserving", "implicit"), ("conserving",)))
@pytest.mark.parametrize("part", [0.0, 0.5], ids=["end", "stage"])
def test_steps_that_end_at_or_next_to_the_posture(
    claim: Claim, crossed: OneFreedom, method: str, part: float
) -> None:
    """Fixed steps whose ends, or stages halfway, fall on it or miss it by 1e-9 to 1e-3 to either side."""
    step, bound = 0.02, METHODS[method][1]
    worst = 0.0
    for miss in (0.0, 1e-9, -1e-6, 1e-5, -1e-3):
        back, rate = crossed.motion(miss, 2.0, np.array([0.0, (1 + part) * step]))[-1]
        start = back, -rate
        q, v, _ = crossed.state(*start)
        result = hybridyn.simulate(crossed.robot, q, v, (0, 3 * step), method=method, step=step)
        assert result.status == "finished", (miss, result.message)
        exact = crossed.motion(*start, np.array([0.0, 3 * step]))[-1]
        worst = max(worst, np.abs(result.q[-1] - crossed.state(*exact)[0]).max())
    claim(f"antiparallelogram, {method}, {part:g} of a step", "angles [rad]", worst, bound)


def test_output_times_at_and_next_to_the_posture(claim: Claim, crossed: OneFreedom) -> None:
    """Rows of a result are states like any other, wherever their times fall."""
    start = (0.06, -2.0)
    past = solve_ivp(
        lambda t, x: [x[1], crossed.acceleration(*x)], (0, 0.1), start, events=lambda t, x: x[0], **REFERENCE
    ).t_events[0]
    off = np.geomspace(1e-10, 1e-3, 8)
    times = np.concatenate([past - off[::-1], past, past + off])
    q, v, _ = crossed.state(*start)
    options, bound = METHODS["dopri5"]
    result = hybridyn.simulate(crossed.robot, q, v, (0, 0.1), output_times=times, **options)
    assert result.status == "finished"
    path = crossed.motion(*start, np.concatenate([[0.0], times]))[1:]
    exact = [crossed.state(*x, crossed.acceleration(*x)) for x in path]
    for name, got, wanted, most in zip(
        "qva", (result.q, result.v, result.a), map(np.array, zip(*exact, strict=True)),
        (bound, PROJECTED, PROJECTED), strict=True,
    ):  # fmt: skip
        claim(
            "antiparallelogram, rows",
            name,
            np.abs(got - wanted).max() / np.abs(wanted).max(),
            most,
        )


def test_a_velocity_on_no_branch_is_refused(crossed: OneFreedom) -> None:
    """Half on one branch, half on the other: it keeps the loops closed to first order, and leads nowhere."""
    parallel = np.array([1.0, -1.0, 1.0])  # drive, elbow, swing of the parallelogram
    for distance in (0.0, 1e-9, 1e-8):
        q, v, _ = crossed.state(distance, 1.0)
        refused(
            partial(
                hybridyn.simulate, crossed.robot, q, (v + parallel) / 2, (0, 0.1), method="rk4", step=0.01
            ),
            hybridyn.SingularityError,
            "on none of the branches",
        )


def test_at_rest_there_the_motion_is_not_defined(crossed: OneFreedom) -> None:
    q, v, _ = crossed.state(0.0, 0.0)
    refused(
        lambda: hybridyn.simulate(crossed.robot, q, v, (0, 0.1)),
        hybridyn.SingularityError,
        "closures lose rank",
    )
