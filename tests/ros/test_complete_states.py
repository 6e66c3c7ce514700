"""States from any joints that determine the posture; what is wrong is refused and the last state held."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import HybridynError
from hybridyn.ros import ros_model
from hybridyn.ros.complete_states import CompleteStates
from hybridyn.ros.health import Health
from hybridyn.ros.joint_numbers import JointNumbers
from hybridyn.ros.ros_model import RosModel
from tests.quantities.ankle import MOTORS, ankle, leg
from tests.ros.conftest import no_compiler
from tests.ros.judge import open_by

#: Loops close to rounding; what is built of arms of a metre and angles of a radian adds some of it.
CLOSED = 1e-12
LEFT, RIGHT = "m1_left_drive", "m1_right_drive"


@pytest.fixture(scope="module")
def model() -> RosModel:
    with no_compiler():
        return RosModel(hybridyn.load("five_bar"))


@pytest.fixture
def states(slowly: None, model: RosModel) -> CompleteStates:
    return CompleteStates(model)


def of(found: JointNumbers, name: str, what: str = "position") -> float:
    return float(np.asarray(getattr(found, what))[list(found.names).index(name)])


def test_the_motors_in_any_order_give_all_joints(states: CompleteStates) -> None:
    robot = states.model.robot
    found = states.complete(JointNumbers([RIGHT, LEFT], [0.2, -0.1], [1.0, 2.0], [3.0, 4.0]), 1)
    assert tuple(found.names) == robot.joints
    assert (of(found, LEFT), of(found, RIGHT)) == (-0.1, 0.2)
    assert open_by(robot, found.names, found.position) < CLOSED
    assert [of(found, name, "effort") for name in robot.joints] == [4.0, 0.0, 3.0, 0.0]


def test_rates_are_those_of_the_positions(states: CompleteStates) -> None:
    h = 1e-5  # the quotient is wrong by h^2 and by rounding over h: 1e-10 both
    rates = np.array([0.7, -0.4])
    before, after = (
        np.array(states.complete(JointNumbers([LEFT, RIGHT], [0.1, 0.2] + s * h * rates), 1).position)
        for s in (-1, 1)
    )
    now = states.complete(JointNumbers([LEFT, RIGHT], [0.1, 0.2], rates), 1)
    np.testing.assert_allclose(now.velocity, (after - before) / (2 * h), rtol=0, atol=1e-8)


@pytest.mark.parametrize("measured", [(LEFT, "m1_left_elbow"), ("m1_right_elbow", "m1_left_elbow")])
def test_other_joints_determine_the_posture_too(states: CompleteStates, measured: tuple[str, ...]) -> None:
    whole = states.complete(JointNumbers([LEFT, RIGHT], [0.1, 0.2], [1.0, -1.0]), 1)
    chosen = [list(whole.names).index(name) for name in measured]
    assert whole.velocity is not None
    part = JointNumbers(measured, np.array(whole.position)[chosen], np.array(whole.velocity)[chosen])
    found = CompleteStates(states.model).complete(part, 1)
    # Newton's method ends at rounding, times the condition of these joints, below 100 here.
    np.testing.assert_allclose(found.position, whole.position, rtol=0, atol=1e-11)
    np.testing.assert_allclose(found.velocity, whole.velocity, rtol=0, atol=1e-11)


def test_models_of_few_sets_of_joints_are_kept(slowly: None, monkeypatch: pytest.MonkeyPatch) -> None:
    model = RosModel(hybridyn.load("five_bar"))
    monkeypatch.setattr(ros_model, "SETS", 1)
    sets = [(LEFT, "m1_left_elbow"), (RIGHT, "m1_right_elbow"), (LEFT, "m1_left_elbow")]
    made = [model.closing(one) for one in sets]
    assert made[0] is not made[2]
    assert set(model._closings) == {model.robot.motors, sets[2]}
    assert model.closing(sets[2]) is made[2]


def test_a_driver_may_call_joints_otherwise(slowly: None, model: RosModel) -> None:
    states = CompleteStates(model, {"axis_1": LEFT, "axis_2": RIGHT})
    found = states.complete(JointNumbers(["axis_2", "axis_1"], [0.2, 0.1]), 1)
    assert (of(found, LEFT), of(found, RIGHT), found.velocity, found.effort) == (0.1, 0.2, None, None)


#: Rates that a driver does not measure, as it writes them.
@pytest.mark.parametrize("none", [None, [], [np.nan, np.nan]])
def test_what_is_not_measured_does_not_go_out(states: CompleteStates, none: list[float] | None) -> None:
    found = states.complete(JointNumbers([LEFT, RIGHT], [0.1, 0.2], none, none), 1)
    assert found.velocity is None
    assert found.effort is None


def test_what_is_not_read_may_not_be_measured(states: CompleteStates) -> None:
    """As joint_state_broadcaster says it of a joint that has no such interface."""
    names, none = [LEFT, "m1_left_elbow", RIGHT], np.nan
    found = states.complete(JointNumbers(names, [0.1, none, 0.2], [1.0, none, 2.0], [3.0, none, none]), 1)
    same = states.complete(JointNumbers(BOTH, [0.1, 0.2], [1.0, 2.0], [3.0, 0.0]), 1)
    for one, other in zip(found[1:], same[1:], strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=CLOSED)


BOTH = [LEFT, RIGHT]
WRONG: dict[str, tuple[JointNumbers, str]] = {
    "not a number": (JointNumbers(BOTH, [0.1, np.nan]), f"nan is among the positions, of joint '{RIGHT}'"),
    "infinite": (JointNumbers(BOTH, [np.inf, 0.0]), f"inf is among the positions, of joint '{LEFT}'"),
    "a rate": (JointNumbers(BOTH, [0.0, 0.0], [np.nan, 1.0]), "nan is among the velocities"),
    "unknown": (JointNumbers([LEFT, "m1_right_drve"], [0.0, 0.0]), f"did you mean '{RIGHT}'"),
    "twice": (JointNumbers([LEFT, LEFT], [0.0, 0.0]), f"joint '{LEFT}' is named twice"),
    "too few": (JointNumbers(BOTH, [0.0]), "there are 1 positions of 2 joints"),
    "too many rates": (JointNumbers(BOTH, [0.0, 0.0], [1.0] * 3), "there are 3 velocities of 2 joints"),
    "efforts": (JointNumbers(BOTH, [0.0, 0.0], None, [1.0]), "there are 1 efforts of 2 joints"),
    "an effort": (JointNumbers(BOTH, [0.0, 0.0], None, [1.0, np.inf]), "inf is among the efforts"),
    "one motor": (JointNumbers([LEFT], [0.0]), "could still move"),
    "nothing": (JointNumbers([], []), "could still move"),
    "huge": (JointNumbers(BOTH, [1e300, 0.0]), "1e+300"),
}


@pytest.mark.parametrize(("message", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_message_is_refused_and_the_last_state_held(
    states: CompleteStates, message: JointNumbers, said: str
) -> None:
    right = JointNumbers([LEFT, RIGHT], [0.1, 0.2])
    before, q = states.complete(right, 1), states.q
    with pytest.raises(HybridynError) as error:
        states.complete(message, 2)
    assert said in str(error.value)
    assert "\n" not in Health().refuse("motor_states", error.value)
    np.testing.assert_array_equal(states.q, q)
    np.testing.assert_allclose(states.complete(right, 3).position, before.position, rtol=0, atol=CLOSED)


def test_what_legs_do_not_reach_is_refused(slowly: None) -> None:
    states = CompleteStates(RosModel(hybridyn.load("rps3")))
    motors, home = states.model.robot.motors, states.model.motor_positions(states.q)
    before = states.complete(JointNumbers(motors, home), 1)
    with pytest.raises(HybridynError, match="module"):
        states.complete(JointNumbers(motors, home + np.array([5.0, 0.0, 0.0])), 2)  # one leg of metres
    after = states.complete(JointNumbers(motors, home), 3)
    np.testing.assert_allclose(after.position, before.position, rtol=0, atol=CLOSED)


def test_a_joint_that_nothing_drives_is_measured(tmp_path: Path, slowly: None) -> None:
    """A leg's toe: the motors do not determine it."""
    states, names = CompleteStates(RosModel(leg(tmp_path))), ["toe_hinge", "hip", "knee", *MOTORS]
    found = states.complete(JointNumbers(names, [0.3, 0.1, 0.2, 0.05, -0.05]), 1)
    assert (of(found, "toe_hinge"), of(found, "knee")) == (0.3, 0.2)
    assert open_by(states.model.robot, found.names, found.position) < CLOSED
    with pytest.raises(HybridynError, match="'toe_hinge'"):
        states.complete(JointNumbers(names[1:], [0.1, 0.2, 0.05, -0.05]), 2)


def test_time_that_goes_back_is_refused_once(states: CompleteStates) -> None:
    right = JointNumbers([LEFT, RIGHT], [0.1, 0.2])
    states.complete(right, 10**9)
    with pytest.raises(HybridynError, match="before that of the last one"):
        states.complete(right, 5)
    assert states.q is states.model.robot.home
    states.complete(right, 6)  # the clock has started again


@pytest.mark.slow
def test_compiled_models_give_the_same_numbers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = ankle(tmp_path)
    quick = CompleteStates(RosModel(robot))
    assert quick.model.compiled is not None
    monkeypatch.setattr(ros_model, "compile", lambda *_, **__: 1 / 0)
    monkeypatch.setattr(ros_model, "_compiled", lambda *_: None)
    slow = CompleteStates(RosModel(robot))
    for t in range(1, 20):
        message = JointNumbers(MOTORS, [0.01 * t, -0.005 * t], [0.5, -0.25])
        one, other = quick.complete(message, t), slow.complete(message, t)
        np.testing.assert_allclose(one.position, other.position, rtol=0, atol=CLOSED)
        np.testing.assert_allclose(one.velocity, other.velocity, rtol=0, atol=CLOSED)
        np.testing.assert_allclose(
            quick.model.efforts(quick.q, quick.v, quick.a), slow.model.efforts(slow.q, slow.v, slow.a),
            rtol=0, atol=1e-10,
        )  # fmt: skip
    assert quick.model.compiled.recomputed == 0


def test_health_tells_the_last_refusal_once(states: CompleteStates) -> None:
    health = Health(completed=1)
    health.refuse("motor_states", HybridynError("two\nlines"))
    well, line, values = health.told(states)
    assert (well, line) == (False, "motor_states: refused, the last right state is held: two lines")
    assert values["messages refused"] == "1"
    assert float(values["closure residual over size"]) < CLOSED
    assert health.told(states)[:2] == (True, "closed")
    assert Health().told(states)[:2] == (True, "no state yet")


def test_health_warns_near_a_singular_posture(
    states: CompleteStates, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert min(states.model.distances(states.q)) > 0.1
    monkeypatch.setattr(RosModel, "distances", lambda *_: (0.5, 9e-4))
    assert Health().told(states)[:2] == (False, "near a singular posture")
