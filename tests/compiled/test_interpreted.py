"""Models that CasADi runs: at once, without a compiler, as the general path computes, with its verdicts."""

import pickle
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled import interpreted
from hybridyn.compiled.comparing import random_states
from tests.support.comparing import close_to, refused, same_words

#: Largest difference from the general path, over the largest number: a hundred roundings of `MODEL_AGREES`.
AGREES = 1e-10


pytestmark = pytest.mark.usefixtures("interpreted", "empty_cache")


@pytest.fixture
def model() -> hybridyn.CompiledRobot:
    """Return the models of a robot that CasADi runs."""
    return hybridyn.compile(hybridyn.load("five_bar"), wait=False)


def test_models_are_there_without_a_compiler(model: hybridyn.CompiledRobot) -> None:
    """Single samples and batches; each program is written when it is first called."""
    robot = model.robot
    q, v, tau, a = random_states(robot)
    assert set(model._models.current.models.programs) == {"idm"}
    close_to(model.idm(q, v, a), hybridyn.idm(robot, q, v, a), AGREES)
    assert np.array_equal(model.idm(q[3], v[3], a[3]), model.idm(q, v, a)[3])
    assert set(model._models.current.models.programs) == {"idm"}
    close_to(model.ddm(q, v, tau), hybridyn.ddm(robot, q, v, tau), AGREES)
    close_to(
        model.kinematics(q, v, a)["m1_tool"].pose, hybridyn.kinematics(robot, q, v, a)["m1_tool"].pose, AGREES
    )
    close_to(model.mass_matrix(q), hybridyn.mass_matrix(robot, q), AGREES)
    assert model.closure_residual(q) is not None
    assert set(model._models.current.models.programs) == {"idm", "ddm", "kinematics", "lift"}
    assert model.interpreted
    assert "run by CasADi" in repr(model)


def test_they_simulate(model: hybridyn.CompiledRobot) -> None:
    robot = model.robot
    start = robot.home, np.zeros(robot.nv), (0.0, 0.01)
    own, right = (hybridyn.simulate(robot, *start, compiled=one) for one in (model, None))
    assert model.steps is None
    close_to(own.q[-1], right.q[-1], AGREES)


def test_they_close_loops_by_the_general_path(model: hybridyn.CompiledRobot) -> None:
    motors = {name: np.array([0.1, 0.12]) for name in model.robot.motors}
    close_to(model.assemble(motors=motors)[0], hybridyn.assemble(model.robot, motors=motors)[0], AGREES)


def test_single_precision_and_parameters_are_those_of_the_library() -> None:
    robot = hybridyn.load("five_bar")
    single = hybridyn.compile(robot, dtype="float32", wait=False)
    q, v, _, a = random_states(robot)
    found = single.idm(q, v, a)
    assert found.dtype == np.float32
    close_to(found, hybridyn.idm(robot, q, v, a), 1e-6)  # rounded to seven digits
    heavy = hybridyn.compile(robot, parameters=["mass:m1_tool"], wait=False)
    other = robot.with_parameters({"mass:m1_tool": 3.0})
    close_to(heavy.idm(q, v, a, parameters=[3.0]), hybridyn.idm(other, q, v, a), AGREES)


def test_what_is_in_doubt_is_handed_over(model: hybridyn.CompiledRobot) -> None:
    robot = model.robot
    q, v, _, a = random_states(robot)
    q[0, 0] += 1e-9  # open by more than rounding, and closed enough for the general path
    close_to(model.idm(q, v, a), hybridyn.idm(robot, q, v, a), AGREES)
    assert model.recomputed == 1
    for wrong in (q + 0.1, q * np.nan):
        same_words(lambda x=wrong: model.idm(x, v, a), lambda x=wrong: hybridyn.idm(robot, x, v, a))  # type: ignore[misc]


def test_a_library_needs_a_compiler(model: hybridyn.CompiledRobot) -> None:
    words = "the compiler that CC names, 'no-such-compiler', does not exist"
    refused(lambda: model.library, hybridyn.CompileError, words)
    refused(lambda: hybridyn.compile(model.robot, wait=True), hybridyn.CompileError, words)


def test_they_go_to_other_processes(model: hybridyn.CompiledRobot) -> None:
    q, v, _, a = random_states(model.robot)
    there = pickle.loads(pickle.dumps(model))
    assert there.interpreted
    assert np.array_equal(there.idm(q, v, a), model.idm(q, v, a))


def test_maps_of_joints_go_to_other_processes_with_the_models_that_bend_them(
    model: hybridyn.CompiledRobot,
) -> None:
    found = model.joint_map(model.robot.home, ["m1_left_elbow", "m1_right_elbow"])
    assert np.array_equal(pickle.loads(pickle.dumps(found)).curvature, found.curvature)


def test_models_that_are_wrong_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first one, and all others where it serves nowhere, at once; another one at its first call."""
    robot, refuses = hybridyn.load("five_bar"), {"idm"}
    asked, verify = [], interpreted.verify

    def judge(models: Any, *given: Any, **options: Any) -> None:
        """Refuse some models."""
        asked.append((list(models.programs), options["required"]))
        if refuses & set(models.programs):
            raise hybridyn.CompileError("it is wrong")
        verify(models, *given, **options)

    monkeypatch.setattr(interpreted, "verify", judge)
    refused(lambda: hybridyn.compile(robot, wait=False), hybridyn.CompileError, "it is wrong")
    assert asked == [(["idm"], True), (["idm", "ddm", "kinematics", "lift"], True)]
    refuses = {"ddm"}
    model = hybridyn.compile(robot, wait=False)
    still = np.zeros(robot.nv)
    model.idm(robot.home, still, still)
    refused(lambda: model.ddm(robot.home, still, np.zeros(2)), hybridyn.CompileError, "it is wrong")
    assert asked[-1] == (["ddm"], False)
