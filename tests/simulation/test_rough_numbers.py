"""Numbers that are rounding, or that no robot has, and runs that stop after one row."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.effects import Payload, Spring
from hybridyn.errors import ModelError, SingularityError, TrajectoryError
from tests.comparing import refused
from tests.robot_texts import door, save
from tests.swings import chain, hinge, rod

FIXED = {"method": "rk4", "step": 1e-3}
BITS = ("t", "q", "v", "a", "tau", "kinetic", "potential", "residual", "pivot")


def test_rounding_as_rates_of_a_locked_loop(tmp_path: Path) -> None:
    """A hinge that a second one across it locks: its rate is zero to rounding, which any solver gives."""
    text = door(2).replace('<axis xyz="0 1 0"/>\n  </loop>', '<axis xyz="1 0 0"/>\n  </loop>')
    robot = hybridyn.load(save(tmp_path, text, "door.urdf"))
    assert robot.mobility == 0
    run = hybridyn.simulate(robot, robot.home, np.array([3e-16]), (0, 2e-3), **FIXED)
    assert run.status == "finished"
    assert np.abs(run.v).max() <= 3e-16


def test_a_run_that_stops_after_one_row_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    path = save(tmp_path, door(1).replace("revolute", "continuous"), "door.urdf")
    robot = hybridyn.load(path)
    for angle in np.linspace(0.1, 2.0, 7):
        start = np.array([np.cos(angle), np.sin(angle)]), np.array([0.3 + angle])
        whole = hybridyn.simulate(robot, *start, (0, 2e-3), **FIXED)
        half = hybridyn.simulate(robot, *start, (0, 1e-3), **FIXED)
        again = hybridyn.simulate(robot, None, None, (0, 2e-3), resume=half, **FIXED)
        for name in BITS:
            assert getattr(again, name).tobytes() == getattr(whole, name).tobytes(), name


def test_an_effort_on_a_massless_base_is_refused(tmp_path: Path) -> None:
    """A free base without mass turns about its only hinge: its inertia there is rounding squared."""
    robot = hybridyn.load(save(tmp_path, door(1), "door.urdf"), base="floating")
    rng = np.random.default_rng(0)
    q = np.array([*rng.normal(size=3), 0.5, 0.5, 0.5, 0.5, 0.3])
    with pytest.raises(SingularityError, match="has no inertia"):
        hybridyn.ddm(robot, q, rng.normal(size=robot.nv), np.array([0.4]))


@pytest.mark.parametrize("size", [1e51, 1e300])
def test_numbers_that_no_robot_has(tmp_path: Path, size: float) -> None:
    bodies = rod("arm", 1.0, "0 0 -0.5", (0.1, 0.1, 0.1))
    robot = chain(tmp_path, bodies, hinge("q1", "base", "arm"))
    for call, error, words in (
        (
            lambda: hybridyn.ddm(robot, np.zeros(1), np.array([size]), np.zeros(0)),
            TrajectoryError,
            "v has the number",
        ),
        (lambda: Payload("arm", size, (1.0, 0.0, 0.0)), ModelError, "at most 1e\\+50"),
    ):
        refused(call, error, words)
    for spring in (Spring({"q1": size}), Spring({"q1": 1.0}, {"q1": size})):
        with pytest.raises(ModelError, match="spring: joint 'q1' has"):
            hybridyn.energy(robot, np.zeros(1), np.zeros(1), effects=[spring])
    for call, error, words in (
        (
            lambda: hybridyn.simulate(
                robot, np.zeros(1), np.zeros(1), (0, 1), projection="never", baumgarte=size
            ),
            TrajectoryError,
            "baumgarte must be",
        ),
        (
            lambda: chain(tmp_path, bodies, hinge("q1", "base", "arm"), gravity=(size, 0.0, 0.0)),
            ModelError,
            "gravity must be three finite numbers",
        ),
    ):
        refused(call, error, words)
