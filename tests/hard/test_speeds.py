"""Speeds of 1e4 rad/s and far beyond, accelerations that cancel to twelve digits, and to none.

Claims (the issue's): backward error at most 1e-13 per module and forward error at most 100 eps times the
condition number at every speed, by `extended_judge`. Where centrifugal terms cancel against inertial ones the
condition number is their size over what is left: at 5e6 rad/s the efforts of a 3-RPS are twelve digits below
the terms that they are summed from, and three digits of them are right. Where none is left the result is the
rounding of those terms, and a message says so.
"""

from functools import lru_cache

import mpmath
import numpy as np
import pytest

from hybridyn import HybridRobot, ddm, idm
from hybridyn.structure.building import build_robot
from tests.hard.claims import FORWARD, Claim, apart
from tests.hard.extended_judge import Judge
from tests.hard.test_masses import arm, efforts, judged
from tests.oracle import Extended, Oracle
from tests.robots.shipped import shipped, states_near_home

TWELVE = 1e-12  # efforts over the terms that they are summed from
NO_DIGIT = "have no correct digit"


@lru_cache
def posed(name: str) -> tuple[HybridRobot, np.ndarray]:
    """Return a shipped robot and a posture, shape (nq,)."""
    return build_robot(shipped(name)), states_near_home(shipped(name), "fixed", 9, 1)[0][0]


@pytest.mark.parametrize("name", ["rps3", "five_bar", pytest.param("delta", marks=pytest.mark.slow)])
def test_any_speed(name: str, claim: Claim, caplog: pytest.LogCaptureFixture) -> None:
    """Accelerations under ordinary efforts, and back to the efforts; speeds per scaled coordinate."""
    robot, q = posed(name)
    for speed in (1.0, 1e2, 1e4, 1e6):
        judged(robot.description, q, f"{name}, {speed:.0e} rad/s", claim, speed)
    assert NO_DIGIT not in caplog.text


def test_efforts_that_cancel_to_twelve_digits(claim: Claim) -> None:
    """A 3-RPS at 5e6 rad/s whose accelerations leave the motors next to nothing to do."""
    robot, q = posed("rps3")
    judge, tau = Judge(robot.description, q, speed=5e6), efforts(robot.description)
    a = ddm(robot, q, judge.v, tau)
    exact = judge.efforts(a).astype(float)
    share = float(np.abs(exact).max() / np.abs((judge.force(a) - judge.h).astype(float)).max())
    case = "rps3, 5e6 rad/s"
    claim(case, "efforts over the terms that they are summed from", share, TWELVE)
    claim(case, "forward error of idm", apart(idm(robot, q, judge.v, a), exact), FORWARD / share)


def test_efforts_of_which_no_digit_is_left_are_reported(caplog: pytest.LogCaptureFixture) -> None:
    """The message names module, sample, the terms and their rounding; the sample beside it is not meant."""
    robot, q = posed("rps3")
    slow, fast = (Judge(robot.description, q, speed=speed).v for speed in (1.0, 1e9))
    state = np.stack([q, q]), np.stack([slow, fast])
    a = ddm(robot, *state, np.tile(efforts(robot.description), (2, 1)))
    idm(robot, *state, a)
    (message,) = [record.getMessage() for record in caplog.records if NO_DIGIT in record.getMessage()]
    assert message.startswith(
        "module 'm1_platform': its efforts have no correct digit at 1 samples (worst: sample 1)"
    )
    assert "Slow the motion down" in message


def test_accelerations_that_cancel_against_centrifugal_forces(
    claim: Claim, caplog: pytest.LogCaptureFixture
) -> None:
    """An arm of two links: efforts that balance 1e12 N m but for 1 N m; then 1e17 N m but for 1 N m."""
    description = arm(2)
    robot, q = build_robot(description), np.array([0.4, 1.0])
    with mpmath.workdps(50):
        exact = Oracle(description, arithmetic=Extended(mpmath.mp))
        for speed in (1e2, 1e6):
            v = speed * np.array([1.0, -2.0])
            tau = idm(robot, q, v, np.ones(2))
            wanted = exact.ddm(q, v, tau).astype(float)
            condition = 20 * np.abs(tau).max() / np.abs(wanted).max()  # cond(M) = 20, |M| = 1 kg m^2
            error = apart(ddm(robot, q, v, tau), wanted)
            case = f"two links, {speed:.0e} rad/s, 1 rad/s^2 (condition {condition:.0e})"
            claim(case, "forward error of ddm", error, FORWARD * condition)
    assert NO_DIGIT not in caplog.text
    v = 1e9 * np.array([1.0, -2.0])
    ddm(robot, q, v, idm(robot, q, v, np.ones(2)))
    assert "its accelerations have no correct digit at 1 samples" in caplog.text


@pytest.mark.parametrize("name", ["rps3", "five_bar", "gough_stewart"])
def test_rest_is_no_loss_of_digits(name: str, caplog: pytest.LogCaptureFixture) -> None:
    """Held still, accelerations are rounding of nothing that matters, and nothing is said."""
    robot, q = posed(name)
    still = np.zeros(robot.nv)
    ddm(robot, q, still, idm(robot, q, still, still))
    assert NO_DIGIT not in caplog.text
