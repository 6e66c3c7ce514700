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


def geared(model: pin.Model) -> None:
    model.rotorInertia[0] = 0.5


def renamed(model: pin.Model) -> None:
    model.names[1] = "other"


@pytest.mark.parametrize(
    ("change", "part"),
    [
        (heavier, "inertias"), (moon, "gravity"), (shifted, "jointPlacements"), (armed, "armature"),
        (geared, "rotorInertia"), (renamed, "names"),
    ],
)  # fmt: skip
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
    "assemblies": lambda robot, v, tau: hybridyn.assemblies(
        robot, motors=dict.fromkeys(robot.motors, 0.0), starts=1
    ),
    "closure_residual": lambda robot, v, tau: hybridyn.closure_residual(robot, robot.home),
    "joint_map": lambda robot, v, tau: hybridyn.joint_map(robot, robot.home, robot.motors),
    "delassus": lambda robot, v, tau: hybridyn.delassus(robot, robot.home, "m1_tool"),
    "geometry_model": lambda robot, v, tau: hybridyn.geometry_model(robot),
    "with_effects": lambda robot, v, tau: hybridyn.with_effects(robot, "model"),
    "with_parameters": lambda robot, v, tau: robot.with_parameters({}),
    "centre_of_mass": lambda robot, v, tau: hybridyn.centre_of_mass(robot, robot.home),
    "momentum": lambda robot, v, tau: hybridyn.momentum(robot, robot.home, v),
    "power": lambda robot, v, tau: hybridyn.power(robot, robot.home, v, tau),
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


OF_COMPILED: dict[str, Callable[[hybridyn.CompiledRobot, Any, Any], object]] = {
    "idm": lambda compiled, v, tau: compiled.idm(compiled.robot.home, v, v),
    "ddm": lambda compiled, v, tau: compiled.ddm(compiled.robot.home, v, tau),
    "batch": lambda compiled, v, tau: compiled.idm(compiled.robot.home[None], v[None], v[None]),
    "close": lambda compiled, v, tau: compiled.close([0.8, 0.8]),
    "idm_from_motors": lambda compiled, v, tau: compiled.idm_from_motors([0.8, 0.8]),
    "assemble": lambda compiled, v, tau: compiled.assemble(motors=dict.fromkeys(compiled.robot.motors, 0.8)),
    "kinematics": lambda compiled, v, tau: compiled.kinematics(compiled.robot.home, v),
    "gravity": lambda compiled, v, tau: compiled.gravity(compiled.robot.home),
    "programs": lambda compiled, v, tau: compiled.programs,
}


@pytest.mark.parametrize(
    "names", [("idm", "ddm", "batch"), pytest.param(tuple(OF_COMPILED), marks=pytest.mark.slow)]
)
def test_compiled_robots_refuse(names: tuple[str, ...]) -> None:
    """Also single calls, whose C looks at no robot: when somebody took the model, they look at it first."""
    robot = hybridyn.load("five_bar")
    v, tau = np.zeros(robot.nv), np.zeros(len(robot.motors))
    compiled, calls = hybridyn.compile(robot), [OF_COMPILED[name] for name in names]
    for call in calls:
        call(compiled, v, tau)
    inertia = robot.model.inertias[1]
    for call in calls:
        call(compiled, v, tau)
    mass, inertia.mass = inertia.mass, 77.0  # long after the model was taken
    for call in calls:
        with pytest.raises(ModelError, match=r"robot\.model was changed \(inertias\)"):
            call(compiled, v, tau)
    inertia.mass = mass
    del inertia
    for call in calls:
        call(compiled, v, tau)
    assert not robot.model_is_held
    assert compiled._idm_at_once is compiled._single_calls[0]  # nobody can change it: C answers at once again


def test_a_changed_copy_is_the_users_own() -> None:
    robot = hybridyn.load("five_bar")
    copy = robot.model.copy()
    heavier(copy)
    hybridyn.energy(robot, robot.home, np.zeros(robot.nv))
