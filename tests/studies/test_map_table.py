"""Postures on a grid of joint positions, for the table of a joint map."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.studies.map_table import postures_on_grid
from tests.comparing import ROUNDING, SOLVED, close_to
from tests.quantities.ankle import JOINTS, ankle, closed_form, leg


def test_a_grid_keeps_to_the_branch_of_home(tmp_path: Path) -> None:
    robot = leg(tmp_path)
    values = {"pitch": np.array([-0.3, 0.1, 0.4]), "roll": np.array([-0.1])}
    found = list(postures_on_grid(robot, values))
    assert [tuple(at) for at, _ in found] == [(p, r) for p in values["pitch"] for r in values["roll"]]
    for at, q in found:
        assert q is not None
        there = hybridyn.joint_map(robot, q, JOINTS)
        close_to(there.joint_positions, at, SOLVED)
        assert np.abs(closed_form(*at, there.motor_positions)[0]).max() < ROUNDING


def test_points_behind_a_gap_are_reached_around_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The points inside a hook are reached by a way that leads back towards home."""
    robot = ankle(tmp_path)
    wall = {(1, -2), (1, -1), (1, 0), (1, 1), (1, 2), (2, 2), (3, 2), (3, 1)}

    def posture(_: hybridyn.HybridRobot, at: dict[str, float], near: np.ndarray | None = None) -> np.ndarray:
        if (round(at["pitch"]), round(at["roll"])) in wall:
            raise hybridyn.AssemblyError("out of reach")
        return robot.home

    monkeypatch.setattr("hybridyn.studies.map_table.posture_at", posture)
    values = {"pitch": np.arange(-4.0, 5.0), "roll": np.arange(-4.0, 5.0)}
    missed = {tuple(map(round, at)) for at, q in postures_on_grid(robot, values) if q is None}
    assert missed == wall
