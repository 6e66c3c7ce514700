"""What the node is told: parameters as ROS gives them; and what it does with many wrong messages."""

from array import array
from typing import Any

import pytest

from hybridyn.errors import ModelError, TrajectoryError
from tests.support.extras import needs

needs("ros")

from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory  # noqa: E402

from hybridyn.ros.health import Health  # noqa: E402
from hybridyn.ros.node import RosNode  # noqa: E402
from hybridyn.ros.settings import RosSettings, checked  # noqa: E402

#: Far more states than are refused in the time in which one is.
COUNT = 1000
RIGHT: list[tuple[str, Any, Any]] = [
    ("rate", 500, 500.0),
    ("payload_mass", 2, 2.0),
    ("payload_centre", array("q", [0, 0, 1]), [0.0, 0.0, 1.0]),
    ("payload_centre", array("d", [0.0, 0.0, 0.1]), [0.0, 0.0, 0.1]),
    ("motors", ["a", "b"], ["a", "b"]),
    ("trajectory_efforts", True, True),
]
WRONG: list[tuple[str, Any, str]] = [
    ("rate", True, "a number"),
    ("rate", "500 Hz", "a number"),
    ("payload_centre", array("d", [0.1]), "three numbers"),
    ("payload_centre", 0.1, "three numbers"),
    ("motors", "a,b", r"as in \[a, b\]"),
    ("motors", array("q", [1, 2]), r"as in \[a, b\]"),
    ("robot", 5, "a word"),
    ("robot", ["a"], "a word"),
    ("trajectory_efforts", 1, "true or false"),
]


@pytest.mark.parametrize(("name", "given", "value"), RIGHT)
def test_whole_numbers_are_numbers(name: str, given: Any, value: Any) -> None:
    assert checked(name, given) == value
    assert type(checked(name, given)) is type(value)


@pytest.mark.parametrize(("name", "given", "said"), WRONG)
def test_a_value_of_another_kind_is_refused(name: str, given: Any, said: str) -> None:
    with pytest.raises(ModelError, match=f"'{name}' is .*; it is .*{said}"):
        checked(name, given)


@pytest.mark.parametrize("names", [["m1"], ["=a"], ["m1=a", "m1=b"], ["m1=a", "m2=a"]])
def test_names_are_told_apart(names: list[str]) -> None:
    with pytest.raises(ModelError, match="parameter 'names'"):
        assert RosSettings(names=names).renamed


def test_states_that_are_refused_slowly_do_not_pile_up(monkeypatch: pytest.MonkeyPatch) -> None:
    node, said, asked = RosNode.__new__(RosNode), list[str](), list[int]()
    node._health = Health()
    monkeypatch.setattr(node, "_say", said.append)

    def answer(_: JointState) -> None:
        """Need far more processor time than 0.02 s to refuse a state."""
        asked.append(sum(range(2_000_000)))
        raise TrajectoryError("out of reach")

    guarded = node._guarded("motor_states", answer)
    for _ in range(COUNT):
        guarded(JointState())
    assert node._health.refused == COUNT
    assert 2 <= len(asked) == len(said) < COUNT / 2
    before, guarded = len(asked), node._guarded("trajectory", answer)
    for _ in range(4):  # of plans, each is read
        guarded(JointTrajectory())
    assert len(asked) == before + 4
