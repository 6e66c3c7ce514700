"""What the general path computes is counted with its reason, and told where it would be most samples."""

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.programs.general import NOT_FINITE, OPEN, SMALL, reasons
from hybridyn.compiled.verifying import verify
from hybridyn.effects.choice import choose
from hybridyn.structure.building import build_robot
from tests.compiled import rods
from tests.support.written_out import Interpreted


class Doubtful(Interpreted):
    """A library that does not trust some samples of its inverse model: all of them by default."""

    doubted = slice(None)

    def batch(self, name: str, *inputs: np.ndarray) -> tuple[tuple[np.ndarray, ...], np.ndarray]:
        """Run one model; guards of "idm" are above their limit."""
        parts, guard = super().batch(name, *inputs)
        guard[self.doubted] += 2.0 * (name == "idm")
        return parts, guard


def test_a_model_that_hands_most_samples_over_says_so(caplog: pytest.LogCaptureFixture) -> None:
    robot = hybridyn.load("five_bar")
    effects = choose(robot, None)
    verify(Interpreted(robot, ("idm", "ddm")), robot, effects)
    assert not caplog.text
    verify(Doubtful(robot, ("idm", "ddm")), robot, effects)
    assert "the compiled 'idm' hands 96 of 96 random states to the general path" in caplog.text
    assert "'ddm'" not in caplog.text


def test_states_that_the_general_path_refuses_do_not_count(caplog: pytest.LogCaptureFixture) -> None:
    """No motor drives a rod whose mass is beside its line: that is the robot's, and not the model's fault.

    Every other sample has the accelerations of the direct model; one of these is handed over, too.
    """
    robot = build_robot(rods.crank(3, beside=0.02))
    library = Doubtful(robot, ("idm", "ddm"))
    library.doubted = slice(1)
    verify(library, robot, choose(robot, None))
    assert not caplog.text


def test_the_reasons_are_told_apart() -> None:
    robot = hybridyn.load("five_bar")
    q = np.tile(robot.home, (3, 1))
    q[1, 0] += 1e-3
    q[2, 0] = np.nan
    assert reasons(robot, q, np.array([2.0, 1e9, np.nan])) == {SMALL: 1, OPEN: 1, NOT_FINITE: 1}


def test_a_model_shows_what_it_handed_over() -> None:
    robot = hybridyn.load("five_bar")
    model = hybridyn.compile(robot)
    assert "handed" not in repr(model)
    q, still = np.tile(robot.home, (3, 1)), np.zeros((3, robot.nv))
    q[1, 0] += 1e-7
    model.idm(q, still, still)
    assert model.recomputed == 1
    assert repr(model).endswith(f"\nhanded to the general path: 1 of idm ({OPEN})")


def test_a_first_table_that_is_mostly_handed_over_is_warned_of(caplog: pytest.LogCaptureFixture) -> None:
    """Once for each call, and by the first table alone: later ones tell the log."""
    robot = hybridyn.load("five_bar")
    q, still = np.tile(robot.home, (3, 1)), np.zeros((3, robot.nv))
    opened = q.copy()
    opened[1:, 0] += 1e-7
    model = hybridyn.compile(robot)
    model.idm(opened[1], still[1], still[1])  # no table
    for _ in range(2):
        model.idm(opened, still, still)
    model.ddm(q, still, still[:, :2])
    model.ddm(opened, still, still[:, :2])
    model.gravity(q)
    model.gravity(opened)
    (said,) = caplog.messages
    assert said == "robot 'five_bar', idm: 2 of 3 samples computed by the general path"
    assert model.handed_over["gravity"] == 2


@pytest.mark.slow
def test_a_new_model_is_asked(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """`compile` asks when it builds; a library from the cache was asked before."""
    asked: list[str] = []
    monkeypatch.setattr(
        "hybridyn.compiled.interpreted.verify", lambda library, robot, on, **_: asked.append(robot.name)
    )
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path_factory.mktemp("cache")))
    robot = hybridyn.load("five_bar")
    for _ in range(2):
        hybridyn.compile(robot)
    assert asked == [robot.name]
