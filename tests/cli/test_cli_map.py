"""`--map` of `idm` and `workspace`: the table of the map between motors and output joints."""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.tables.signals import WRENCH
from tests import ROOT
from tests.quantities.ankle import JOINTS, MOTORS, ankle_text, closed_form
from tests.support.command_line import call, read_table, table_text
from tests.support.comparing import SOLVED, close_to
from tests.support.files import save

FIVE_BAR_MOTORS = ("m1_left_drive", "m1_right_drive")
RATES = [f"{motor}/per/{joint}" for motor in MOTORS for joint in JOINTS]


def words(folder: Path, *more: object) -> list[object]:
    """Return the words of a call for the ankle."""
    path = save(folder, ankle_text(), "ankle.urdf")
    command = "workspace" if str(more[0]).startswith("--grid") else "idm"
    return [command, path, "--motors", ",".join(MOTORS), "--map", ",".join(JOINTS), *more]


def judge(table: dict[str, np.ndarray]) -> None:
    """Compare every row's map with closed form."""
    for t in range(len(table["pitch/position"])):
        motors = np.array([table[f"{motor}/position"][t] for motor in MOTORS])
        H = closed_form(table["pitch/position"][t], table["roll/position"][t], motors)[1]
        close_to(np.array([table[name][t] for name in RATES]), H.reshape(-1), SOLVED)


def test_over_a_grid(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, *words(tmp_path, "--grid=-0.2:0.3:3,-0.1:0.1:2"))
    table = read_table(said.out)
    close_to(table["pitch/position"], np.repeat([-0.2, 0.05, 0.3], 2), SOLVED)
    close_to(table["roll/position"], np.tile([-0.1, 0.1], 3), SOLVED)
    judge(table)
    assert said.err.startswith("ankle: pitch, roll of motor_left, motor_right; 6 postures, condition number")


def test_motors_that_the_map_leaves_out_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lines = (ROOT / "models/tanev/traj.csv").read_text().splitlines()
    table = save(tmp_path, "\n".join([line for line in lines if line[0] != "#"][:9]), "traj.csv")
    slides = ",".join(f"m1_leg{i}_slide" for i in (1, 2, 3))
    said = call(capsys, "idm", "tanev", table, "--map", slides, "--effects", "none")
    others = "'m2_leg1_slide', 'm2_leg2_slide', 'm2_leg3_slide'"
    assert f"not in the map, other motors: {others}\n" in said.err
    assert "m2_leg1_slide" not in said.out


def test_points_out_of_reach_are_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "map.csv"
    said = call(capsys, *words(tmp_path, "--grid", "0:1.8:2,0.1:0.2:1", "-o", target))
    assert said.out == ""
    assert said.err.splitlines()[1:] == ["left out: 1 point out of reach"]
    assert len(read_table(target.read_text())["roll/position"]) == 1


def test_along_a_trajectory(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t = np.linspace(0.0, 1.0, 9)
    pitch, roll = 0.2 * np.sin(t), 0.1 * t**2
    source = save(
        tmp_path,
        table_text(["time", "pitch/position", "roll/position"], np.stack([t, pitch, roll], axis=1)),
        "motion.csv",
    )
    said = call(capsys, *words(tmp_path, source))
    table = read_table(said.out)
    close_to(table["time"], t, SOLVED)
    judge(table)
    power = [
        sum(table[f"{name}/velocity"] * table[f"{name}/effort"] for name in side) for side in (JOINTS, MOTORS)
    ]
    close_to(power[0], power[1], SOLVED)
    back = tmp_path / "motors.csv"
    names = [f"{motor}/{what}" for motor in MOTORS for what in ("position", "velocity", "acceleration")]
    back.write_text(table_text(["time", *names], np.stack([t, *(table[name] for name in names)], axis=1)))
    again = read_table(call(capsys, *words(tmp_path, back)).out)
    close_to(again["roll/position"], roll, SOLVED)
    close_to(again["pitch/acceleration"], table["pitch/acceleration"], SOLVED)


def test_efforts_carry_the_wrenches_of_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A held load of 100 N is in the efforts, as `idm` computes them; here along the shipped five-bar."""
    table = tmp_path / "held.csv"
    header = [
        "time",
        *(f"{motor}/position" for motor in FIVE_BAR_MOTORS),
        *(f"m1_tool/wrench/{w}" for w in WRENCH),
    ]
    rows = np.array([[t, 0.05 * t, 0.02 * t, 0, 0, -100.0, 0, 0, 0] for t in np.linspace(0.0, 1.0, 9)])
    table.write_text(table_text(header, rows))
    elbows = "m1_left_elbow,m1_right_elbow"
    along = read_table(call(capsys, "idm", "five_bar", "--map", elbows, table).out)
    wanted = read_table(call(capsys, "idm", "five_bar", table).out)
    for motor in FIVE_BAR_MOTORS:
        close_to(along[f"{motor}/effort"], wanted[f"{motor}/effort"], SOLVED)
        assert np.abs(wanted[f"{motor}/effort"]).min() > 5.0  # N m; the weight alone takes less than 1


def test_rotors_of_the_file_at_the_joints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, *words(tmp_path, "--grid=0:0:1,0:0:1"))
    assert "inertia" not in said.out
    (tmp_path / "ankle.model.toml").write_text(
        "[joints.motor_left]\nrotor_inertia = 1e-4\ngear_ratio = 50.0\n"
    )
    table = read_table(call(capsys, *words(tmp_path, "--grid=0:0:1,0:0:1")).out)
    H = np.array([table[name][0] for name in RATES]).reshape(2, 2)
    wanted = H.T @ np.diag([0.25, 0.0]) @ H
    found = [
        table[f"{name}/inertia/{other}"][0]
        for name, other in (("pitch",) * 2, ("pitch", "roll"), ("roll",) * 2)
    ]
    close_to(np.array(found), wanted[[0, 0, 1], [0, 1, 1]], SOLVED)
