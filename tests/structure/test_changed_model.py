"""`robot.model` is the caller's own copy: edits of it change nothing, in no function."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from tests.support.comparing import same_bits


def change(model: pin.Model) -> None:
    """Change a model in every way: masses, gravity, places, armature, rotors, names."""
    model.inertias[1].mass = 77.0
    model.gravity.linear = np.array([0, 0, -1.62])
    model.jointPlacements[2].translation[0] += 0.1
    model.armature[0] = 0.5
    model.rotorInertia[0] = 0.5
    model.names[1] = "other"


def edited() -> hybridyn.HybridRobot:
    """Return a robot whose model was changed in every way."""
    robot = hybridyn.load("five_bar")
    change(robot.model)
    return robot


CALLS: dict[str, Callable[[hybridyn.HybridRobot, Any, Any], object]] = {
    "idm": lambda robot, v, tau: hybridyn.idm(robot, robot.home, v, v),
    "ddm": lambda robot, v, tau: hybridyn.ddm(robot, robot.home, v, tau),
    "assemble": lambda robot, v, tau: hybridyn.assemble(robot, motors=dict.fromkeys(robot.motors, 0.0)),
    "kinematics": lambda robot, v, tau: hybridyn.kinematics(robot, robot.home, v, v),
    "energy": lambda robot, v, tau: hybridyn.energy(robot, robot.home, v),
    "mass_matrix": lambda robot, v, tau: hybridyn.mass_matrix(robot, robot.home),
    "simulate": lambda robot, v, tau: hybridyn.simulate(robot, robot.home, v, (0, 1e-3)),
    "assemblies": lambda robot, v, tau: hybridyn.assemblies(
        robot, motors=dict.fromkeys(robot.motors, 0.0), starts=1
    ),
    "closure_residual": lambda robot, v, tau: hybridyn.closure_residual(robot, robot.home),
    "joint_map": lambda robot, v, tau: hybridyn.joint_map(robot, robot.home, robot.motors).motors_per_joints,
    "delassus": lambda robot, v, tau: hybridyn.delassus(robot, robot.home, "m1_tool"),
    "geometry_model": lambda robot, v, tau: hybridyn.geometry_model(robot),
    "with_effects": lambda robot, v, tau: hybridyn.idm(
        hybridyn.with_effects(robot, "model"), robot.home, v, v
    ),
    "with_parameters": lambda robot, v, tau: hybridyn.idm(robot.with_parameters({}), robot.home, v, v),
    "centre_of_mass": lambda robot, v, tau: hybridyn.centre_of_mass(robot, robot.home),
    "momentum": lambda robot, v, tau: hybridyn.momentum(robot, robot.home, v),
    "power": lambda robot, v, tau: hybridyn.power(robot, robot.home, v, tau),
}


@pytest.mark.parametrize("name", CALLS)
def test_edits_change_no_result(name: str) -> None:
    plain, robot = hybridyn.load("five_bar"), edited()
    v, tau = np.ones(robot.nv) * 0.0, np.ones(len(robot.motors))
    expected, found = CALLS[name](plain, v, tau), CALLS[name](robot, v, tau)
    assert str(found) == str(expected)
    same_bits(found, expected)


OF_COMPILED: dict[str, Callable[[hybridyn.CompiledRobot, Any, Any], object]] = {
    "idm": lambda compiled, v, tau: compiled.idm(compiled.robot.home, v, v),
    "ddm": lambda compiled, v, tau: compiled.ddm(compiled.robot.home, v, tau),
    "batch": lambda compiled, v, tau: compiled.idm(compiled.robot.home[None], v[None], v[None]),
    "close": lambda compiled, v, tau: compiled.close([0.8, 0.8]),
    "idm_from_motors": lambda compiled, v, tau: compiled.idm_from_motors([0.8, 0.8]),
    "assemble": lambda compiled, v, tau: compiled.assemble(motors=dict.fromkeys(compiled.robot.motors, 0.8)),
    "kinematics": lambda compiled, v, tau: compiled.kinematics(compiled.robot.home, v),
    "gravity": lambda compiled, v, tau: compiled.gravity(compiled.robot.home),
}


def calls_at_once(compiled: hybridyn.CompiledRobot) -> list[Callable[..., int]]:
    models, postures = compiled._models, compiled._postures
    return [models.idm_at_once, models.ddm_at_once, postures._close_at_once, models.control_at_once]


@pytest.mark.parametrize(
    "names", [("idm", "ddm", "batch"), pytest.param(tuple(OF_COMPILED), marks=pytest.mark.slow)]
)
def test_edits_change_no_compiled_result(names: tuple[str, ...]) -> None:
    """Neither before nor after the model was taken, whose holding changes no call either."""
    robot = hybridyn.load("five_bar")
    v, tau = np.zeros(robot.nv), np.ones(len(robot.motors))
    compiled = hybridyn.compile(robot)
    for name in names:  # the first postures come from Newton's method, the next ones from C
        OF_COMPILED[name](compiled, v, tau)
    expected = [OF_COMPILED[name](compiled, v, tau) for name in names]
    at_once = calls_at_once(compiled)
    model = robot.model
    change(model)
    for name, before in zip(names, expected, strict=True):
        same_bits(OF_COMPILED[name](compiled, v, tau), before)
    assert calls_at_once(compiled) == at_once
    same_bits(
        OF_COMPILED["idm"](hybridyn.compile(robot), v, tau), expected[0]
    )  # also where it was changed before


def test_the_model_is_one_copy() -> None:
    robot = hybridyn.load("five_bar")
    assert robot.model is robot.model
    assert robot.model == robot.unchanged_model
    change(robot.model)
    assert robot.model != robot.unchanged_model
    assert robot.unchanged_model == hybridyn.load("five_bar").model
