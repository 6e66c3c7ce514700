"""Losses of gears in compiled models: the general path's numbers, its refusal, and the same runs."""

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled import torque_models
from hybridyn.effects import GearEfficiency, choose
from hybridyn.errors import ActuationError, ModelError
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import HybridRobot
from tests.robots.mechanisms import random_mechanism
from tests.robots.shipped import shipped
from tests.support.comparing import close_to
from tests.support.engines import written_agrees
from tests.support.samples import slow

AGREES = 1e-10  # as of all compiled models
SAME_RUN = 1e-8  # a hundred times the tolerance of the steps


def geared(robot: HybridRobot, back: float = 0.7) -> list[object]:
    """Return the default effects with gears of every second motor, which lose."""
    motors = robot.motors[::2]
    return ["default", GearEfficiency(dict.fromkeys(motors, 0.8), dict.fromkeys(motors, back), width=0.1)]


@pytest.mark.parametrize("name", ["five_bar", "rps3", *map(slow, ("delta", "gough_stewart", "lx4"))])
def test_shipped_robots_agree_with_the_general_path(name: str) -> None:
    robot = build_robot(shipped(name))
    written_agrees(robot, effects=geared(robot), within=AGREES)


@pytest.mark.parametrize("kind", ["planar_rpr", slow("branched"), slow("star_four")])
@pytest.mark.parametrize("seed", [0, *map(slow, range(1, 7))])
def test_random_mechanisms_agree_with_the_general_path(kind: str, seed: int) -> None:
    robot = build_robot(random_mechanism(seed, kind=kind))
    written_agrees(robot, effects=geared(robot), within=AGREES)


def test_models_compute_them_and_leave_gears_that_lock_themselves_to_the_general_path(by: str) -> None:
    robot = build_robot(shipped("five_bar"))
    effects = geared(robot, back=-0.2)
    fast = hybridyn.compile(robot, effects, wait=by == "c")
    q, v, a = hybridyn.assemble(robot, motors=([0.1, 0.2], [1.0, -0.5], [0.3, 0.1]))
    tau = fast.idm(q, v, a)
    close_to(tau, hybridyn.idm(robot, q, v, a, effects=effects), AGREES)
    assert fast.recomputed == 0
    close_to(fast.ddm(q, 1e-3 * v, tau), hybridyn.ddm(robot, q, 1e-3 * v, tau, effects=effects), AGREES)
    assert fast.recomputed == 0  # slowly, friction is smoothed: it does not lock yet
    with pytest.raises(ActuationError, match="locks itself at sample 1"):
        fast.ddm(np.array([q, q]), np.array([1e-3 * v, v]), np.array([tau, tau]))
    given = {"effort": tau, "effects": effects, "rtol": 1e-10}
    one, other = (
        hybridyn.simulate(robot, q, 1e-3 * v, np.array([0.0, 0.0005]), compiled=compiled, **given)
        for compiled in (fast, None)
    )
    close_to(one.q, other.q, SAME_RUN)
    with pytest.raises(ModelError, match="the mass matrix does not take the effect 'gear_efficiency'"):
        fast.mass_matrix(q)


@pytest.mark.slow
def test_computed_torque_does_not_invert_a_direct_model_that_is_not_linear_in_efforts() -> None:
    """Of a robot with fewer motors than motions."""
    robot = hybridyn.load("five_bar", motors=["m1_left_drive"])
    on = choose(robot, geared(robot))
    fast = hybridyn.compile(robot, on, wait=True)
    assert torque_models(fast, choose(robot, None)) is not None
    assert torque_models(fast, on) is None
