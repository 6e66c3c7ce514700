"""Targets at and beyond the edge of reach, ways that brush it: the right posture, or a message that helps."""

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.building import build_robot
from tests.assembly.test_assembly import stretched
from tests.dynamics.test_idm import symmetric_five_bar
from tests.hard import dietmaier
from tests.hard.claims import EPS, Claim
from tests.robots.posing import of_link, position
from tests.support.comparing import refused

CRANK, ROD, BASE = 0.4, 0.55, 0.5  # of the five-bar [m]
CLOSED = 1e-13  # closure residual, of the module's size: the suite's general claim for one module
FORWARD = 100.0  # eps times the condition number, likewise
MEND = "out of reach, or contradicts another one; move it, or give a better guess"


@pytest.mark.parametrize("excess", [1e-9, 1e-6, 1.0])
def test_five_bar_out_of_reach(claim: Claim, excess: float) -> None:
    """By 1e-9 m, under the file's closure tolerance of 1e-4, and by as far as cranks reach: an error each.

    The residual it reports is what is missing: half the excess at each rod's end, over the module's length.
    """
    robot = build_robot(symmetric_five_bar())
    excess = min(excess, 2 * (CRANK + BASE / 2 - ROD) * (1 - 1e-6))
    error = refused(
        lambda: hybridyn.assemble(robot, motors=stretched(robot, excess)), hybridyn.AssemblyError, MEND
    )
    said = str(error)
    assert "closure_tolerance" not in said  # raising it would take an open loop for rounding
    assert ("limit" in said) == (float(error.residual or 0) > robot.closure_tolerance)
    missing = excess / robot.modules[0].mechanism.length
    case = f"five-bar out of reach by {excess:.2g} m"
    claim(case, "reported residual over what is missing", float(error.residual or 0) / missing, 1 + 1e-6)
    claim(case, "what is missing over reported residual", missing / float(error.residual or 0), 4.0)


@pytest.mark.parametrize("left", [1e-3, 1e-6, 1e-9, 1e-12])
def test_five_bar_just_within_reach(claim: Claim, left: float) -> None:
    """Down to 1e-12 m from the edge postures close, on the guess's side; the height is the exact one.

    Forward error: the height is the root of what is left, so eps counts 1 / root(left) times.
    """
    robot = build_robot(symmetric_five_bar())
    found = hybridyn.assemble(robot, motors=stretched(robot, -left))[0]
    claim(
        f"five-bar {left:g} m within reach",
        "closure residual",
        hybridyn.closure_residual(robot, found),
        CLOSED,
    )
    up = [position(robot, joint, found) for joint in ("left", "left_elbow")]
    B = CRANK * np.array([np.cos(up[0]), np.sin(up[0])])
    tip = B + ROD * np.array([np.cos(sum(up)), np.sin(sum(up))])
    half = (BASE - 2 * CRANK * np.cos(up[0])) / 2
    height = np.sqrt(max(ROD**2 - half**2, 0.0))
    condition = 1 + ROD / np.sqrt(ROD * left)
    error = abs(abs(tip[1] - B[1]) - height) / (EPS * condition * ROD)
    claim(f"five-bar {left:g} m within reach", "error of the height over eps times condition", error, FORWARD)


@pytest.mark.slow
def test_dietmaier_out_of_reach(claim: Claim) -> None:
    """A leg a metre longer than base, first leg and platform in line: no posture passes for one.

    Restarts find nothing either: where rows lose rank a step of zero is no convergence.
    """
    robot = dietmaier.robot()
    start = hybridyn.assemblies(robot, motors=dietmaier.motors()).q[0]
    lengths = np.tile(dietmaier.LENGTHS, (2, 1))
    lengths[1, 1] = dietmaier.BASE[1, 0] + dietmaier.LENGTHS[0] + dietmaier.PLATFORM[1, 0] + 1.0
    error = refused(
        lambda: hybridyn.assemble(robot, motors=dietmaier.motors(lengths), guess=start),
        hybridyn.AssemblyError,
        MEND,
    )
    claim("Dietmaier, a leg 1 m too long", "samples from the error's", abs(1 - (error.sample or 0)), 0)


@pytest.mark.parametrize("name", ["rps3", "delta", "gough_stewart", "lx4"])
def test_platforms_one_metre_out_of_reach(claim: Claim, name: str) -> None:
    """The motors' joints a metre beyond, where they are slides, or the platform: module, sample, mend."""
    robot = hybridyn.load(name)
    error = refused(lambda: hybridyn.assemble(robot, **far(robot)), hybridyn.AssemblyError, "")
    text = str(error)
    named = error.module in {m.name for m in robot.modules} and "sample 1" in text and "better guess" in text
    claim(f"{name}, one metre out of reach", "things that the message does not name", int(not named), 0)


def far(robot: hybridyn.HybridRobot) -> dict[str, dict[str, object]]:
    """Return a platform's pose at home and a metre further, or a partial one where it has few freedoms."""
    module = robot.modules[0]
    zero, platform = np.zeros((1, robot.nv)), module.outputs[0]
    pose = of_link(robot, robot.home[None], zero, zero, platform, robot.description.root)[0]
    if robot.name.startswith(("delta", "rps3")):
        return {"platforms": {platform: np.concatenate([pose, pose + np.eye(7)[0]])}}
    slides = {m: np.tile(position(robot, m, robot.home), 2) for m in robot.motors}
    slides[module.motors[0]] = slides[module.motors[0]] + np.array([0.0, 5.0])
    return {"motors": slides}


@pytest.mark.parametrize("left", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("steps", [200, 20])
def test_five_bar_brushes_its_edge(claim: Claim, left: float, steps: int) -> None:
    """Cranks spread until the rods are stretched but for some distance, and come back: the side is kept.

    Finely and in steps ten times too long; such steps to 1e-8 m are refused, with the mend.
    """
    robot = build_robot(symmetric_five_bar())
    time = np.linspace(-1, 1, steps + 1)
    motors = stretched(robot, -(left + 0.1 * time**2))
    if left < 1e-6 and steps < 100:
        refused(
            lambda: hybridyn.assemble(robot, motors=motors),
            hybridyn.AssemblyError,
            "Move the trajectory away from the singularity|Go there by a way that avoids the singularity",
        )
        return
    q = hybridyn.assemble(robot, motors=motors)[0]
    case = f"five-bar brushing its edge by {left:g} m, {steps} steps"
    claim(case, "closure residual", hybridyn.closure_residual(robot, q).max(), CLOSED)
    side = np.sin(position(robot, "left", q) + position(robot, "left_elbow", q))
    claim(case, "samples on the other side", (np.sign(side) != np.sign(side[0])).sum(), 0)


def test_five_bar_driven_through_its_edge(claim: Claim) -> None:
    """The same, past the edge by 1e-6 m between two samples that are within reach themselves: not judged.

    A sample that is beyond is an error at that sample.
    """
    robot = build_robot(symmetric_five_bar())
    time = np.linspace(-1, 1, 21)
    error = refused(
        lambda: hybridyn.assemble(robot, motors=stretched(robot, 1e-6 - 0.1 * time**2)),
        hybridyn.AssemblyError,
        MEND,
    )
    claim("five-bar driven past its edge", "samples from the error's", abs(10 - (error.sample or 0)), 0)
