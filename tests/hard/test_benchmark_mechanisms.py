"""The multibody community's benchmark mechanisms, as robots and scenes, against references derived by hand.

Bounds: a step's error is held to rtol, and the errors of the steps add up: some thirty times rtol over the
first second or hundred steps, three hundred times over ten seconds; in energy less, since it is level along
the motion. The references are good to 1e-12 (`benchmark_references.py`, `one_freedom.py`). The scenes of
`models/benchmarks/` at their full length are slow; the default tests run the same mechanisms for a shorter
time or at a looser tolerance.
"""

import numpy as np
import pytest

import hybridyn
from hybridyn.scenes.stage import SceneStage, stage
from hybridyn.simulation.result import SimulationResult
from tests import ROOT
from tests.hard.benchmark_references import (
    ANDREWS,
    ANGLES,
    all_bars,
    andrews,
    flyball_governor,
    heavy_top,
    n_four_bar,
)
from tests.hard.claims import Claim
from tests.hard.one_freedom import OneFreedom
from tests.hard.redundant_loops import bricard_law
from tests.support.samples import slow

SCENES = {
    name: ROOT / "models" / "benchmarks" / name / f"{scene}.toml"
    for name, scene in {
        "n_four_bar": "passage",
        "andrews": "squeeze",
        "bricard": "fall",
        "flyball_governor": "settle",
        "heavy_top": "spin",
    }.items()
}
CLOSED = 1e-11  # loops, relative to the module's length: what every method that projects promises
ADDED_UP = (30.0, 300.0)  # over a second or a hundred steps, over ten seconds
ENERGY = 30.0
PUBLISHED = (3e-10, 5.5e-8, 1.05e-7)  # of Andrews' published q, v, a: how far off they are, two digits kept
GAIN = 3.0  # errors of accelerations over those of rates, each relative to its largest
ALIKE = 1e-11  # loops of a row: no error of a step tells them apart, only closing does

long_run = pytest.mark.slow


def run(ready: SceneStage, duration: float, **options: object) -> SimulationResult:
    """Simulate a scene from its start on; options replace those of its solver."""
    solver = ready.source.scene.solver
    chosen = {"method": solver.method, "rtol": solver.rtol, "atol": solver.atol, **options}
    return hybridyn.simulate(
        ready.robot,
        ready.q0,
        ready.v0,
        np.linspace(0, duration, 21),
        effort=ready.effort,
        effects=ready.effects,
        **chosen,
    )


def added_up(duration: float) -> float:
    """Return how often the tolerance of a step adds up."""
    return ADDED_UP[duration > 2]


def claim_run(claim: Claim, case: str, result: SimulationResult, rtol: float | None) -> None:
    """Claim what every run must hold: it ends, loops are closed, energy stays where nothing takes it."""
    assert result.status == "finished", result.message
    claim(case, "closure residual", result.residual.max(), CLOSED)
    if rtol is not None:
        lost = np.ptp(result.energy) / result.kinetic.max()
        claim(case, "change of energy over peak kinetic energy", lost, ENERGY * rtol)


FOUR_BARS = [
    pytest.param(2, np.pi / 2, -1.0, 1.2, 1e-8, id="2", marks=pytest.mark.slow),
    pytest.param(8, 0.12, -5.5, 0.06, 1e-6, id="8", marks=pytest.mark.slow),
    pytest.param(2, np.pi / 2, -1.0, 10.0, 1e-10, id="2-10s", marks=long_run),
    pytest.param(40, np.pi / 2, -1.0, 10.0, 1e-8, id="40-10s", marks=long_run),
]


@pytest.mark.parametrize(("n", "theta", "rate", "duration", "rtol"), FOUR_BARS)
def test_n_four_bar(claim: Claim, n: int, theta: float, rate: float, duration: float, rtol: float) -> None:
    """Through the postures where mobility jumps from 1 to N + 1, on the regular motion of one freedom."""
    ready = stage(SCENES["n_four_bar"])
    robot = hybridyn.load(str(ready.robot.description.source), gravity=(0, -9.81, 0), xacro_args={"n": n})
    assert robot.mobility == 1
    start = all_bars(theta - np.pi / 2, robot.joints), all_bars(rate, robot.joints)
    result = hybridyn.simulate(
        robot, *start, np.linspace(0, duration, 5 if duration < 1 else 41), rtol=rtol, atol=rtol / 10
    )
    case = f"N-four-bar, N = {n}, {duration:g} s"
    claim_run(claim, case, result, rtol)
    exact, exact_rate = n_four_bar(n, result.t, theta, rate)
    assert np.ptp(np.sign(np.sin(exact))) > 0  # it passes
    feet = result.q * all_bars(1.0, robot.joints)
    claim(case, "angle between uprights", np.abs(feet - feet[:, :1]).max(), ALIKE)
    claim(case, "theta [rad]", np.abs(result.q[:, 0] + np.pi / 2 - exact).max(), added_up(duration) * rtol)
    claim(case, "rate over the largest", np.abs(result.v[:, 0] - exact_rate).max() / np.abs(exact_rate).max(),
          added_up(duration) * rtol)  # fmt: skip


@pytest.mark.parametrize(
    ("rtol", "end"), [(1e-7, 0.001), slow(1e-7, 0.03), pytest.param(1e-12, 0.03, marks=long_run)]
)
def test_andrews(claim: Claim, rtol: float, end: float) -> None:
    """Andrews' squeezing mechanism, to 0.03 s: against its own equations, and the published solution."""
    ready = stage(SCENES["andrews"])
    i = [ready.robot.joints.index(name) for name in ANGLES]
    result = run(ready, end, rtol=rtol, atol=rtol)
    case = f"Andrews' mechanism, {end:g} s, rtol {rtol:g}"
    claim_run(claim, case, result, None)
    exact = andrews(end)
    got = np.array([result.q[-1, i], result.v[-1, i], result.a[-1, i]])
    for name, x, y, gain in zip("qva", got, exact, (1.0, 1.0, GAIN), strict=True):
        claim(
            case, f"{name} over the largest", np.abs(x - y).max() / np.abs(y).max(), gain * ADDED_UP[0] * rtol
        )
    if rtol < 1e-9:
        q, v, a = (np.abs(x - y) for x, y in zip(got, ANDREWS, strict=True))
        claim(case, "q, each relative, published", (q / np.abs(ANDREWS[0])).max(), PUBLISHED[0])
        claim(case, "v, each relative, published", (v / np.abs(ANDREWS[1])).max(), PUBLISHED[1])
        claim(case, "a over the largest, published", a.max() / np.abs(ANDREWS[2]).max(), PUBLISHED[2])


def test_andrews_winds_up() -> None:
    """The first angle passes 2 pi and is not wrapped; the accelerations at the start are those stated."""
    ready = stage(SCENES["andrews"])
    a = hybridyn.ddm(ready.robot, ready.q0, ready.v0, np.array([0.033]), effects=ready.effects)
    stated = {"beta": 14222.4439199541, "theta": -10666.8329399656, "gamma": 0.0}
    for name, value in stated.items():
        assert a[ready.robot.joints.index(name)] == pytest.approx(value, abs=1e-7)
    assert all(kind == "revolute" for kind in ready.robot.kinds[:7])


@pytest.mark.parametrize(("duration", "rtol"), [(0.1, 1e-8), pytest.param(10.0, 1e-10, marks=long_run)])
def test_bricard(claim: Claim, duration: float, rtol: float) -> None:
    """Five closing rows of rank four all the way; against the closed form of its angles."""
    ready = stage(SCENES["bricard"])
    (module,) = ready.robot.modules
    report = module.mechanism.reduction.report
    assert (ready.robot.mobility, report.rows, report.rank) == (1, 5, 4)
    result = run(ready, duration, rtol=rtol, atol=rtol / 10)
    case = f"Bricard's linkage, {duration:g} s"
    claim_run(claim, case, result, rtol)
    mechanism = OneFreedom(ready.robot, bricard_law)
    exact = np.array([mechanism.state(*x)[:2] for x in mechanism.motion(np.pi / 2, 0.0, result.t)])
    claim(case, "angles [rad]", np.abs(result.q - exact[:, 0]).max(), added_up(duration) * rtol)
    size = np.abs(exact[:, 1]).max()
    claim(
        case, "rates over the largest", np.abs(result.v - exact[:, 1]).max() / size, added_up(duration) * rtol
    )


@pytest.mark.parametrize(
    ("duration", "method", "rtol"),
    [
        (0.015, "implicit", 1e-5),
        (0.1, "implicit", 1e-5),
        slow(0.03, "dopri5", None),
        pytest.param(10.0, "implicit", 1e-7, marks=long_run),
        pytest.param(10.0, "dopri5", None, marks=long_run),
    ],
)
def test_flyball_governor(claim: Claim, duration: float, method: str, rtol: float | None) -> None:
    """Springs and dampers of 2e4 1/s and 20 1/s; None: as the scene is shipped, to the 1e-7 of its page."""
    ready = stage(SCENES["flyball_governor"])
    joints = list(ready.robot.joints)
    compiled = hybridyn.compile(ready.robot, ready.effects) if duration > 1 or rtol is None else None
    solver = {} if rtol is None else {"method": method, "rtol": rtol, "atol": rtol / 10}
    result = run(ready, duration, compiled=compiled, **solver)
    assert result.method == method
    case = f"flyball governor, {duration:g} s" + (", as shipped" if rtol is None else "")
    rtol = rtol or 1e-7 / (2 * np.pi * added_up(duration))
    claim_run(claim, case, result, None)
    exact = flyball_governor(result.t)
    lift, spin, left, right = (joints.index(n) for n in ("lift", "spin", "left_hinge", "right_hinge"))
    claim(case, "slider height [m]", np.abs(result.q[:, lift] - exact[:, 0]).max(), added_up(duration) * rtol)
    claim(
        case,
        "shaft rate [rad/s]",
        np.abs(result.v[:, spin] - exact[:, 1]).max(),
        2 * np.pi * added_up(duration) * rtol,
    )
    for rod in (left, right):
        claim(
            case, "rod angle [rad]", np.abs(result.q[:, rod] - exact[:, 2]).max(), added_up(duration) * rtol
        )
    assert np.ptp(exact[:, 0]) > (0.1 if duration > 1 else 3e-4)  # it moves


@pytest.mark.parametrize("duration", [0.005, slow(0.2)])
def test_heavy_top(claim: Claim, duration: float) -> None:
    """Orientation while the spin turns by three quarters of a radian, and by thirty radians."""
    ready = stage(SCENES["heavy_top"])
    result = run(ready, duration)
    rtol = ready.source.scene.solver.rtol
    case = f"heavy top, {duration:g} s"
    claim_run(claim, case, result, rtol)
    top = hybridyn.kinematics(ready.robot, result.q, result.v, links=["top"])["top"].pose[:, 3:]
    x, y, z, w = top.T
    R = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    ).transpose(2, 0, 1)
    claim(case, "orientation [rad]", np.abs(R - heavy_top(result.t)).max(), ADDED_UP[0] * rtol)
