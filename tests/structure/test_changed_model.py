"""`robot.model` is for reading: whoever changes it is told at the next call, by every function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.errors import ModelError


def heavier(model: pin.Model) -> None:
    model.inertias[1].mass = 77.0


def moon(model: pin.Model) -> None:
    model.gravity.linear = np.array([0, 0, -1.62])


def shifted(model: pin.Model) -> None:
    model.jointPlacements[2].translation[0] += 0.1


def armed(model: pin.Model) -> None:
    model.armature[0] = 0.5


@pytest.mark.parametrize(
    ("change", "part"),
    [(heavier, "inertias"), (moon, "gravity"), (shifted, "jointPlacements"), (armed, "armature")],
)
def test_a_change_is_named(change: Callable[[pin.Model], None], part: str) -> None:
    robot = hybridyn.load("five_bar")
    rest = np.zeros(robot.nv)
    change(robot.model)
    with pytest.raises(ModelError, match=rf"robot\.model was changed \({part}\)"):
        hybridyn.idm(robot, robot.home, rest, rest)


CALLS: dict[str, Callable[[hybridyn.HybridRobot, Any, Any], object]] = {
    "ddm": lambda robot, v, tau: hybridyn.ddm(robot, robot.home, v, tau),
    "assemble": lambda robot, v, tau: hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, 0.0)),
    "kinematics": lambda robot, v, tau: hybridyn.kinematics(robot, robot.home, v, v),
    "energy": lambda robot, v, tau: hybridyn.energy(robot, robot.home, v),
    "mass_matrix": lambda robot, v, tau: hybridyn.mass_matrix(robot, robot.home),
    "simulate": lambda robot, v, tau: hybridyn.simulate(robot, robot.home, v, (0, 1e-3)),
    "compile": lambda robot, v, tau: hybridyn.compile(robot),
}


@pytest.mark.parametrize("name", CALLS)
def test_every_function_refuses(name: str) -> None:
    robot = hybridyn.load("five_bar")
    v, tau = np.zeros(robot.nv), np.zeros(len(robot.motors))
    if name != "compile":
        CALLS[name](robot, v, tau)  # looking at the model changes nothing
    heavier(robot.model)
    with pytest.raises(ModelError, match=r"robot\.model was changed"):
        CALLS[name](robot, v, tau)


def test_a_changed_copy_is_the_users_own() -> None:
    robot = hybridyn.load("five_bar")
    copy = robot.model.copy()
    heavier(copy)
    hybridyn.energy(robot, robot.home, np.zeros(robot.nv))
