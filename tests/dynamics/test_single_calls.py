"""A loop of single calls is advised to compile: once, and for single samples only."""

import itertools
import warnings

import numpy as np
import pytest

import hybridyn
from hybridyn.dynamics import results


def test_many_single_calls_are_warned_of_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(results, "MANY_CALLS", 3)
    monkeypatch.setattr(results, "_calls", itertools.count(1))
    robot = hybridyn.load("five_bar")
    still, tau = np.zeros(robot.nv), np.zeros(2)
    hybridyn.idm(robot, *np.zeros((3, 9, robot.nv)) + robot.home * np.array([1, 0, 0])[:, None, None])
    hybridyn.idm(robot, robot.home, still, still)
    hybridyn.ddm(robot, robot.home, still, tau)
    with pytest.warns(hybridyn.PerformanceWarning, match=r"hybridyn\.compile\(robot\)") as caught:
        hybridyn.ddm(robot, robot.home, still, tau)
    assert caught[0].filename == __file__  # the line of the caller, not of hybridyn
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hybridyn.ddm(robot, robot.home, still, tau)
