"""Long runs without friction: energy, closures and quaternions stay, as far as each method promises."""

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import Spring
from hybridyn.simulation.result import SimulationResult
from tests.hard.claims import Claim
from tests.robots.posing import position

STEP = 0.004  # [s], of the conserving method: 20 steps in the fastest swing
KEPT = (
    1e-9  # energy, of the peak kinetic energy, over any number of steps: what the conserving method promises
)
CLOSED = 1e-10  # closure residual, of the module's size: 10 times what Newton leaves on four modules
UNIT = 1e-12  # of quaternions and cosines from unit length, renewed at every step
RTOL = 1e-8  # of the adaptive method
STIFFNESS = 60e3  # of the slides' springs [N/m], those of the shipped scene's controller


def on_springs(robot: hybridyn.HybridRobot, away: float = 0.0) -> list[object]:
    """Return effects with springs instead of motors, so far from rest at home [m], without friction."""
    rest = {motor: float(position(robot, motor, robot.home)) + away for motor in robot.motors}
    return ["default", Spring(dict.fromkeys(robot.motors, STIFFNESS), rest)]


def judged(
    claim: Claim, case: str, robot: hybridyn.HybridRobot, result: SimulationResult, drift: float
) -> None:
    """Hold a run to its claims."""
    assert result.status == "finished", result.message
    change = np.abs(result.energy - result.energy[0]).max() / result.kinetic.max()
    claim(case, "change of energy over peak kinetic energy", change, drift)
    claim(case, "closure residual", hybridyn.closure_residual(robot, result.q).max(), CLOSED)
    off = []
    for kind, at in zip(robot.kinds, robot.q_slices, strict=True):
        if kind in ("continuous", "spherical", "floating"):
            part = result.q[:, at][:, -4:]
            off.append(np.abs(np.linalg.norm(part, axis=1) - 1).max())
    if off:  # the LX4 has only hinges with ends, and slides
        claim(case, "quaternions and cosines from unit length", max(off), UNIT)


@pytest.mark.parametrize(
    ("method", "end"),
    [
        ("conserving", 0.02),
        ("dopri5", 0.004),
        pytest.param("conserving", 100.0, marks=pytest.mark.slow),
        pytest.param("dopri5", 0.2, marks=pytest.mark.slow),
    ],
)
def test_undamped_lx4(claim: Claim, method: str, end: float) -> None:
    """Springs in the place of motors, released at home: it swings and never rests.

    Closures and quaternions hold at any time. Energy: the conserving method promises it over any number of
    steps; the adaptive one promises rtol a step, held to 100 rtol over the run. The slow runs are what a few
    minutes allow of the hour (100 s are 25,000 steps: ten minutes).
    """
    robot = hybridyn.load("lx4")
    step = STEP if method == "conserving" else None
    times = np.linspace(0, end, 6)
    result = hybridyn.simulate(
        robot,
        robot.home,
        np.zeros(robot.nv),
        times,
        method=method,
        step=step,
        effects=on_springs(robot),
        rtol=RTOL,
    )
    judged(claim, f"undamped LX4, {end:g} s, {method}", robot, result, KEPT if step else 100 * RTOL)


@pytest.mark.slow
@pytest.mark.parametrize("end", [0.4, 20.0])
def test_a_platform_afloat(claim: Claim, end: float) -> None:
    """The same on a free base without weight: its quaternion is kept at unit length by the retraction.

    Energy is the conserving method's promise; the base starts turning at 1 rad/s, so its quaternion moves.
    """
    robot = hybridyn.load("gough_stewart", base="floating", gravity=(0.0, 0.0, 0.0))
    v = np.zeros(robot.nv)
    v[3:6] = 0.6, -0.5, 0.6
    times = np.linspace(0, end, 11)
    result = hybridyn.simulate(
        robot, robot.home, v, times, method="conserving", step=STEP, effects=on_springs(robot, 0.01)
    )
    assert np.abs(result.q[-1, 3:7] - robot.home[3:7]).max() > 0.1
    judged(claim, f"gough_stewart afloat on springs, {end:g} s, conserving", robot, result, KEPT)
