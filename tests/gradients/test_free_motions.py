"""Gradients of robots with motions that have no motor, whose accelerations follow the parameters."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import GearEfficiency
from hybridyn.errors import ModelError, SingularityError, TrajectoryError
from hybridyn.gradients.gradient import MeasureBars
from hybridyn.structure.building import build_robot
from tests.gradients.by_differences import AGREE, agrees, design, differences, near_home, numbers_of
from tests.robots.mechanisms import random_mechanism, random_states
from tests.robots.robot_texts import DOOR
from tests.support.comparing import close_to
from tests.support.files import save
from tests.support.samples import slow


@pytest.fixture(scope="module")
def floating() -> hybridyn.DesignGradients:
    """Return the gradients of a five-bar on a floating base."""
    return hybridyn.DesignGradients(
        hybridyn.load("five_bar", base="floating"), ["upper_length", "mass:m1_tool"]
    )


def test_accelerations_of_free_motions_follow_those_of_motors(floating: hybridyn.DesignGradients) -> None:
    """Motors keep their accelerations; the base moves as their efforts demand."""
    gradients, robot = floating, floating.robot
    q, v, a = near_home(robot)
    p, still = gradients.parameters.nominal, np.zeros((1, robot.nv))
    each = [MeasureBars(still, still, one[None], np.zeros((1, 2)), {}) for one in np.eye(robot.nv)]
    found = gradients.of_measures((q[None], v[None], a[None]), p, np.eye(len(p)), each)
    along = p * [0.5, 0.4]
    wanted, errors = differences(robot, gradients.parameters, along, q, design(robot, q, v, a))
    size = AGREE * np.abs(wanted.found).max()
    assert (np.abs(found.over @ along - wanted.found) <= size + errors.found).all()


def test_solved_accelerations_are_those_of_no_effort(floating: hybridyn.DesignGradients) -> None:
    """Those of a floating base, and of joints that follow the motors, are not read."""
    gradients, robot = floating, floating.robot
    (q, v, a), other = near_home(robot), np.full(robot.nv, 7.0)
    other[robot.motor_v] = a[robot.motor_v]
    found, known = gradients.idm(q, v, other, passive="solved"), gradients.idm(q, v, a)
    close_to(found.value, hybridyn.idm(robot, q, v, other, passive="solved"), AGREE)
    close_to(found.over, known.over, AGREE)
    with pytest.raises(SingularityError, match=r'needs an effort.*or pass passive="solved"'):
        gradients.idm(q, v, other)
    with pytest.raises(TrajectoryError, match="passive must be 'given' or 'solved', not 'free'"):
        gradients.idm(q, v, a, passive="free")


def test_without_motors_there_are_accelerations_alone(tmp_path: Path) -> None:
    """Efforts are empty, and so are their derivatives."""
    text = f'<robot name="door">{DOOR}</robot>'
    robot = hybridyn.load(save(tmp_path, text, "door.urdf"), motors=[])
    gradients = hybridyn.DesignGradients(robot, ["mass:leaf"], keep=["hinge"])
    q, v, a = np.full((3, 1), 0.3)
    assert gradients.idm(q, v, a, passive="solved").over.shape == (0, 1)
    found = gradients.ddm(q, v, [])
    one, other = (
        hybridyn.ddm(robot.with_parameters({"mass:leaf": 2.0 + h}), q, v, []) for h in (1e-4, -1e-4)
    )
    close_to(found.over[:, 0], (one - other) / 2e-4, 1e-7)  # the square of the step


@pytest.mark.parametrize(("seed", "base"), [*(slow(seed, "fixed") for seed in range(4)), (1, "moving")])
def test_joints_without_motors_may_stay_beside_motors(seed: int, base: Any) -> None:
    """Also where the base has an acceleration of its own."""
    description = random_mechanism(seed, kind="five_bar_one_motor", base=base)
    robot = build_robot(description, base=base)
    q, v, a = (x[0] for x in random_states(description, base, seed, count=1))
    of_base = {"base_acceleration": a[:6]} if base == "moving" else {}
    a = hybridyn.ddm(robot, q, v, np.ones(len(robot.motors)), **of_base)
    free = [x for x in robot.joints if x not in (*robot.motors, "root_joint")]
    names = [*robot.motors, free[0]]
    agrees(robot, numbers_of(description, seed), (q, v, a), seed, keep=names)


def test_efforts_beside_free_motions_hold_the_motors_accelerations_behind_gears() -> None:
    """Efforts follow parameters so that accelerations of motors stay."""
    robot = hybridyn.load("five_bar", base="floating")
    gears = ["default", GearEfficiency(dict.fromkeys(robot.motors, 0.7), width=0.05)]
    q, v, _ = hybridyn.assemble(robot, motors=([0.1, 0.2], [0.5, -0.4], [0.0, 0.0]))
    tau = np.array([1.0, -0.6])
    gradients = hybridyn.DesignGradients(robot, ["mass:m1_tool"], effects=gears)
    a, over = gradients.ddm(q, v, tau)[:2]
    sides = [
        [hybridyn.ddm(robot, q, v, tau + sign * 1e-6 * e, effects=gears)[robot.motor_v] for e in np.eye(2)]
        for sign in (1, -1)
    ]
    by_tau = (np.array(sides[0]) - sides[1]).T / 2e-6
    moved = by_tau @ gradients.idm(q, v, a).over[:, 0]
    close_to(moved, -over[robot.motor_v, 0], 1e-7)  # rounding over the step
    with pytest.raises(ModelError, match="mass matrix does not take the effect 'gear_efficiency'"):
        gradients.mass_matrix(q)
    elbows = hybridyn.DesignGradients(robot, ["mass:m1_tool"], keep=["m1_left_elbow", "m1_right_drive"])
    with pytest.raises(ModelError, match="name all motors in 'keep'"):
        elbows.idm(q, v, a)
    with pytest.raises(ModelError, match="where every motion has one motor"):
        hybridyn.DesignGradients(robot, ["mass:m1_tool"]).mass_matrix(q)
