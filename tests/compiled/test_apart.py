"""Samples that each start from their own posture: closed together, they are those closed alone."""

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly import walk
from hybridyn.compiled.library.closed_rows import BLOCK
from hybridyn.compiled.programs.closing.apart import Apart
from hybridyn.compiled.programs.closing.own_requests import requests_of_motors
from hybridyn.structure.building import build_robot
from tests.robots.shipped import shipped
from tests.support.comparing import close_to, refused
from tests.support.samples import slow

#: Rounding, and the condition of the loops.
SAME = 1e-10
#: One sample more than lanes take at once.
COUNT = BLOCK + 1


def drawn(name: str, threads: int = 1) -> tuple[hybridyn.CompiledRobot, np.ndarray, list[np.ndarray]]:
    """Return models, postures close to home, and a motion of the motors from there to other ones."""
    robot = build_robot(shipped(name))
    random = np.random.default_rng(0)
    home, away = robot.home[robot.motor_q], random.normal(size=(4, COUNT, len(robot.motors)))
    fast = hybridyn.compile(robot, threads=threads)
    starts = np.array([fast.close(home + 0.005 * x)[0] for x in away[0]])
    return fast, starts, [home + 0.01 * away[1], away[2], away[3]]


@pytest.mark.parametrize("name", ["five_bar", slow("gough_stewart"), slow("lx4")])
def test_they_are_those_that_are_closed_alone(name: str) -> None:
    fast, starts, motion = drawn(name, threads=2)
    alone = [fast.close(*(x[t] for x in motion), last=starts[t]) for t in range(COUNT)]
    found = fast.close(*motion, last=starts)
    for one, rows in zip(found, zip(*alone, strict=True), strict=True):
        close_to(one, np.array(rows), SAME)
    _, doubtful = Apart(fast.robot).close(requests_of_motors(fast.robot, motion[0], (None, None)), starts, 1)
    assert len(doubtful) == 0  # C closed all of them


def test_those_in_doubt_are_closed_alone_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """A start whose loops are open; one that leaves its branch; one that is no number."""
    monkeypatch.setattr(walk, "FINEST", 16)  # a shorter search for a way that is not there
    fast, starts, (position, *levels) = drawn("five_bar")
    starts[3] += 1e-6
    few = fast.close(position[:4], *(x[:4] for x in levels), last=starts[:4])
    for one, rows in zip(fast.close(position, *levels, last=starts), few, strict=True):
        close_to(one[:4], rows, 1e-8)  # as far as the loops were open
    for number, error, words in (
        (
            [-1.5, 1.5],
            hybridyn.AssemblyError,
            "at sample 5 straight from the guess: it would jump to another assembly branch",
        ),
        (np.nan, hybridyn.TrajectoryError, "position is not finite at sample 5"),
    ):
        wrong = position.copy()
        wrong[5] += number
        refused(lambda wrong=wrong: fast.close(wrong, *levels, last=starts), error, words, sample=5)
    refused(
        lambda: fast.close(position[:4], last=starts), hybridyn.TrajectoryError, "position, last have 4, 17"
    )
    refused(lambda: fast.close(position, last=starts[:, :2]), hybridyn.TrajectoryError, "last has shape")
