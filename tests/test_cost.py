"""What accuracy costs: fronts, advice, and the two studies on a small robot."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from compiled_toys import own_cache
from shipped import shipped

import hybridyn
from hybridyn.cost.models import Trajectory, study_models
from hybridyn.cost.points import Point, Study, advice, cheapest, front, timed
from hybridyn.cost.runs import distance
from hybridyn.effects import choose
from hybridyn.robot import build_robot

__all__ = ["own_cache"]

ROOT = Path(__file__).parents[1]
EXACT = 1e-12


def point(setting: str, error: float, seconds: float, failure: str = "") -> Point:
    return Point("line", setting, error, seconds, f"--{setting}", failure)


POINTS = [
    point("slow (usual)", 1e-9, 8.0),
    point("fast", 1e-3, 1.0),
    point("middling", 1e-3, 2.0),
    point("no", 0.0, 0.1, "broken"),
]


def test_the_front_is_what_nothing_beats() -> None:
    assert [p.setting for p in front(POINTS)] == ["fast", "slow (usual)"]
    assert cheapest(POINTS, 1e-2) == POINTS[1]
    assert cheapest(POINTS, 1e-6) == POINTS[0]
    assert cheapest(POINTS, 1e-12) is None


def test_advice_names_the_way_and_what_it_saves() -> None:
    study = Study("question", POINTS, "reference", 1e-16, "per sample")
    assert "take line, fast: 8 times as fast" in advice(study, 1e-2)
    assert "keep the usual way" in advice(study, 1e-6)
    assert "the best error is 1e-09" in advice(study, 1e-12)


def test_a_time_is_the_least_of_several() -> None:
    calls = []
    result, seconds = timed(lambda: calls.append(1) or len(calls))  # type: ignore[func-returns-value]
    assert result == len(calls) == 5
    assert 0 < seconds < 1


def test_distances_are_joint_displacements() -> None:
    robot = build_robot(shipped("five_bar"))
    q = robot.home.copy()
    q[0] += 0.25
    assert distance(robot, robot.home, q) == pytest.approx(0.25, abs=EXACT)


def test_models_of_a_small_robot(own_cache: None) -> None:
    robot = hybridyn.load("five_bar")
    time = np.linspace(0, 1, 130)
    motors = {}
    for i, motor in enumerate(robot.motors):
        home, wave = robot.home[robot.q_slices[robot.joint_index[motor]].start], 2 * time + i
        motors[motor] = (home + 0.2 * np.sin(wave), 0.4 * np.cos(wave), -0.8 * np.sin(wave))
    q, v, a = hybridyn.assemble(robot, motors=motors)
    study = study_models(robot, Trajectory(q, v, a, time), choose(robot, "model"), lambda what: None)
    found = {(p.line, p.setting): p for p in study.points}
    assert not [p for p in study.points if p.failure]
    assert 0 < study.own_error < 1e-13
    usual = next(p for p in study.points if p.setting.endswith("(usual)"))
    assert usual.error < EXACT
    assert found["C in float64", "+ coulomb friction"].error < EXACT
    assert 1e-9 < found["C in float32", "+ coulomb friction"].error < 1e-3
    closing = [p.error for p in study.points if p.line.startswith("loops")]
    assert closing[0] > closing[-1]
    assert closing[-1] < 1e-10
    # Leaving out an effect costs just what it adds, told by another call.
    without = hybridyn.idm(robot, q, v, a, effects=["gravity", "inertia", "leg_inertia", "velocity"])
    whole = hybridyn.idm(robot, q, v, a, effects="model")
    off = (np.abs(without - whole).max(axis=0) / np.abs(whole).max(axis=0)).max()
    assert found["effects", "+ velocity"].error == pytest.approx(off, rel=1e-9)
    spline, differences = (
        found["rates of the trajectory", x].error for x in ("quintic spline", "central differences")
    )
    assert spline < 1e-6 < differences


def test_a_scene_on_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from hybridyn.cost import runs

    monkeypatch.setattr(runs, "STEPS", (8e-3, 4e-3))
    monkeypatch.setattr(runs, "TOLERANCES", (1e-3, 1e-7))
    table, figure = tmp_path / "cost.csv", tmp_path / "cost.svg"
    scene = str(ROOT / "models/five_bar/swing.toml")
    out = call(capsys, "cost", scene, "--until", "0.05", "-o", str(table), "--plot", str(figure))
    assert out.status == 0, out.err
    assert "its own error" in out.out
    rows = list(csv.DictReader(table.read_text().splitlines()))
    rk4 = [float(row["error"]) for row in rows if row["line"] == "rk4"]
    assert 8 < rk4[0] / rk4[1] < 40  # fourth order: 16, when steps are halved
    assert figure.read_text().startswith("<?xml")
    out = call(capsys, "cost", scene, "--until", "0.05", "--target", "1e-3")
    assert "[solver]\nmethod =" in out.out


def test_wrong_use_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    out = call(
        capsys, "cost", str(ROOT / "models/five_bar/swing.toml"), str(ROOT / "models/five_bar/traj.csv")
    )
    assert out.status == 2
    assert "a robot and a trajectory, or a scene alone" in out.err
