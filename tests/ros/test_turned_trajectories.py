"""Trajectories of an ankle's pitch and roll to its motors, and back, judged by its closed form."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import TrajectoryError
from hybridyn.ros.ros_model import RosModel
from hybridyn.ros.turned_trajectories import JointPoint, turned
from hybridyn.structure.bodies import Payload
from tests.quantities.ankle import JOINTS, MOTORS, ankle, closed_form, leg
from tests.ros.conftest import no_compiler


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> RosModel:
    with no_compiler():
        return RosModel(ankle(tmp_path_factory.mktemp("ankle")), JOINTS)


def swing(t: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return pitch and roll, their rates and accelerations."""
    size, w = np.array([0.2, 0.1]), 3.0
    return size * np.sin(w * t), size * w * np.cos(w * t), -size * w**2 * np.sin(w * t)


def points(*times: float, levels: int = 3) -> list[JointPoint]:
    return [JointPoint(round(t * 1e9), *(list(x) for x in swing(t)[:levels])) for t in times]


def test_the_motors_follow_pitch_and_roll(model: RosModel, slowly: None) -> None:
    h = 1e-4  # accelerations are quotients of rates: wrong by h^2 w^3, 3e-7
    times = [0.1, 0.1 + h, 0.1 + 2 * h, 0.3]
    names, found = turned(model, JOINTS, points(*times), model.robot.home)
    assert names == MOTORS
    for t, point in zip(times, found, strict=True):
        miss, H = closed_form(*swing(t)[0], np.array(point.positions))
        assert np.abs(miss).max() < 1e-13  # squares of lengths of 0.2 m, to rounding
        np.testing.assert_allclose(point.velocities, H @ swing(t)[1], rtol=1e-10)
    before, _, after = (np.array(point.velocities) for point in found[:3])
    np.testing.assert_allclose(found[1].accelerations, (after - before) / (2 * h), rtol=1e-5)
    assert [point.time for point in found] == [round(t * 1e9) for t in times]


def test_efforts_are_those_of_the_inverse_model(tmp_path: Path, slowly: None) -> None:
    model = RosModel(ankle(tmp_path), JOINTS, payload_link="foot")
    model.load(3.0, [0.1, 0.0, 0.0])
    _, found = turned(model, JOINTS, points(0.1, 0.2), model.robot.home, efforts=True)
    carrying = hybridyn.with_effects(ankle(tmp_path), ["default", Payload("foot", 3.0, (0.1, 0, 0))])
    motion = [
        np.array([getattr(p, what) for p in found]) for what in ("positions", "velocities", "accelerations")
    ]
    tau = hybridyn.idm(carrying, *hybridyn.assemble(carrying, motors=tuple(motion)))
    np.testing.assert_allclose([p.effort for p in found], tau, rtol=1e-9)


def test_there_and_back_is_the_same(model: RosModel, slowly: None) -> None:
    wanted = points(0.1, 0.2, 0.4)
    motors, there = turned(model, JOINTS, wanted, model.robot.home)
    assert not there[0].effort
    joints, back = turned(model, motors, there, model.robot.home)
    assert joints == JOINTS
    for one, other in zip(back, wanted, strict=True):
        for what in ("positions", "velocities", "accelerations"):
            np.testing.assert_allclose(getattr(one, what), getattr(other, what), rtol=0, atol=1e-10)
        assert not one.effort


@pytest.mark.parametrize("levels", [1, 2])
def test_what_is_not_given_is_not_turned(model: RosModel, slowly: None, levels: int) -> None:
    _, (point,) = turned(model, JOINTS, points(0.1, levels=levels), model.robot.home)
    lengths = [len(x) for x in (point.positions, point.velocities, point.accelerations, point.effort)]
    assert lengths == [2, 2 * (levels > 1), 0, 0]


def test_modules_that_are_not_named_stay(tmp_path: Path, model: RosModel, slowly: None) -> None:
    whole = RosModel(leg(tmp_path), JOINTS)
    names, found = turned(whole, JOINTS, points(0.1), whole.robot.home)
    assert names == MOTORS
    _, same = turned(model, JOINTS, points(0.1), model.robot.home)
    np.testing.assert_allclose(found[0].positions, same[0].positions, rtol=0, atol=1e-12)


WRONG: dict[str, tuple[tuple[str, ...], list[JointPoint], str]] = {
    "no joint": ((), points(0.1), "has no joint"),
    "no point": (JOINTS, [], "has no point"),
    "unknown": (("pitch", "rol"), points(0.1), "did you mean 'roll'"),
    "twice": (("pitch", "pitch"), points(0.1), "named twice"),
    "not a number": (JOINTS, [JointPoint(0, [0.0, np.nan])], "nan is among the positions, of joint 'roll'"),
    "too few": (JOINTS, [JointPoint(0, [0.0])], "1 positions of 2 joints"),
    "rates of some": (JOINTS, [*points(0.1, levels=1), *points(0.2)], "0 velocities of 2 joints"),
    "time goes back": (JOINTS, points(0.2, 0.1), "the time of point 2 is not after"),
    "beyond a limit": (JOINTS, [JointPoint(0, [0.0, 0.41])], "position of 0.416721 rad, limit 0.4 rad"),
    "too fast": (JOINTS, [JointPoint(0, [0.0, 0.0], [10.1, 0.0])], "speed of 11.2285 rad/s, limit 10 rad"),
}  # fmt: skip


@pytest.mark.parametrize(("names", "given", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_trajectory_is_refused(
    model: RosModel, slowly: None, names: tuple[str, ...], given: list[JointPoint], said: str
) -> None:
    with pytest.raises(TrajectoryError) as error:
        turned(model, names, given, model.robot.home)
    assert said in str(error.value)


def test_motors_without_outputs_are_refused(tmp_path: Path, slowly: None) -> None:
    model = RosModel(ankle(tmp_path))
    with pytest.raises(TrajectoryError, match="name outputs in the parameter 'joints'"):
        turned(model, MOTORS, points(0.1), model.robot.home)


def test_a_payload_without_link_is_refused(tmp_path: Path, slowly: None) -> None:
    with pytest.raises(hybridyn.ModelError, match="payload_link"):
        RosModel(ankle(tmp_path)).load(1.0, [0.0, 0.0, 0.0])
