"""Limits that a motion leaves, and numbers that look like another unit, are told: first row, worst, count."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import AssemblyError
from hybridyn.streams.departures import Departures, departures, position_limits
from hybridyn.structure.building import build_robot
from tests.robots.shipped import shipped
from tests.support.command_line import call, table_text
from tests.support.comparing import refused
from tests.support.files import save

LOWER, UPPER, SPEED, EFFORT, MASS = -0.1, 0.2, 0.6, 4.0, 2.0


def robot_text(upper: float = UPPER, joint: str = "slide", damping: float = 0.0) -> str:
    """Return a mass on a horizontal slide, a joint whose range is empty on it, and a passive follower."""
    mass = (
        f'<inertial><mass value="{MASS / 2}"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    return f"""<robot name="single"><link name="ground"/><link name="sled">{mass}</link>
      <link name="second">{mass}</link>
      <joint name="{joint}" type="prismatic"><parent link="ground"/><child link="sled"/><axis xyz="1 0 0"/>
      <limit lower="{LOWER}" upper="{upper}" effort="{EFFORT}" velocity="{SPEED}"/>
      <dynamics damping="{damping}"/></joint>
      <joint name="follower" type="prismatic"><parent link="ground"/><child link="second"/><axis xyz="1 0 0"/>
      <limit lower="-1" upper="0.15" effort="0" velocity="0"/><mimic joint="{joint}"/></joint>
      <transmission name="t"><joint name="{joint}"/><actuator name="m"/></transmission></robot>"""


def motion() -> np.ndarray:
    t = np.linspace(0.0, math.pi / 2, 101)
    x = 0.285 * np.sin(t)  # 0.285 m of 0.2 m, in a quarter of a turn
    return np.column_stack([t, x, 0.285 * np.cos(t), -x])


HEADER = ["time", "slide/position", "slide/velocity", "slide/acceleration"]


def files(folder: Path, table: np.ndarray, **words: float) -> tuple[Path, Path]:
    robot = save(folder, robot_text(**words), "single.urdf")
    return robot, save(folder, table_text(HEADER, table), "motion.csv")


def first(limit: float) -> int:
    """Return the first row of the motion beyond a position."""
    return int(np.flatnonzero(motion()[:, 1] > limit)[0]) + 1


def test_a_stroke_that_is_left_is_told_and_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = files(tmp_path, motion())
    efforts = call(capsys, "idm", *paths, "-o", tmp_path / "efforts.csv")
    sized = call(capsys, "idm", "--loads", *paths, "-o", tmp_path / "report.json", status=1)
    row = first(UPPER)
    time = motion()[row - 1, 0]
    line = (
        f"joint 'slide' leaves its limits: position of 0.285 m, limit 0.2 m, by 0.085 m; first at row {row} "
        f"({time:.6g} s), {102 - row} samples"
    )
    assert line in efforts.err
    assert line in sized.out
    assert "joint 'follower' leaves its limits: position of 0.285 m, limit 0.15 m" in sized.out
    assert "velocity" not in efforts.err.split("effects on")[0]  # a speed limit of 0 is none
    (facts,) = json.loads((tmp_path / "report.json").read_text())
    assert (facts["lower_limit"], facts["upper_limit"]) == (LOWER, UPPER)
    assert facts["over_position"] == 102 - row


def test_speed_and_effort_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = motion() * [1, 0.1, 0.1, 0.1]
    table[7, 2] = -0.7  # m/s
    table[9, 3] = 3.0  # m/s^2: 6 N
    said = call(capsys, "idm", *files(tmp_path, table, upper=1.0), "-o", tmp_path / "efforts.csv")
    assert "speed of -0.7 m/s, limit -0.6 m/s, by 0.1 m/s; first at row 8" in said.err
    assert "effort of 6 N, limit 4 N, by 2 N; first at row 10" in said.err
    assert said.err.count("leaves its limits") == 2


def test_what_the_files_state_and_idm_leaves_out_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = motion() * [1, 0.1, 0.1, 0.1]
    paths, target = files(tmp_path, table, damping=5.0), tmp_path / "efforts.csv"
    plain = call(capsys, "idm", *paths, "-o", target).err
    assert "the robot's files state viscous_friction: not computed; '--effects model' computes all" in plain
    assert "not computed" not in call(capsys, "idm", *paths, "-o", target, "--effects", "model").err
    assert "not computed" not in call(capsys, "idm", *files(tmp_path, table), "-o", target).err


def test_a_scene_that_leaves_a_range_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files(tmp_path, motion())
    text = (
        'duration = 1.0\n[robot]\nfile = "single.urdf"\n[initial]\nrates.joints = { slide = 0.5 }\n'
        '[solver]\nmethod = "rk4"\nstep = 0.1\n[output]\nrate = 10\n'
    )
    said = call(capsys, "simulate", save(tmp_path, text, "scene.toml"), "-o", tmp_path / "run.csv")
    assert (
        "joint 'slide' leaves its limits: position of 0.5 m, limit 0.2 m, by 0.3 m; first at row 6"
        in said.err
    )


def test_blocks_give_what_one_gives(tmp_path: Path) -> None:
    robot = hybridyn.load(files(tmp_path, motion())[0])
    rng = np.random.default_rng(3)
    q, v = rng.normal(size=(2, 500, robot.nv))
    tau = 4 * rng.normal(size=(500, 1))
    whole, parts = Departures(), Departures()
    whole.add(departures(robot, q, v, tau), 1, None)
    for start in range(0, 500, 7):
        rows = slice(start, start + 7)
        parts.add(departures(robot, q[rows], v[rows], tau[rows]), start + 1, None)
    assert sorted(parts.lines()) == sorted(whole.lines())
    (slide,) = [d for d in whole if d.joint == "slide" and d.quantity == "position"]
    column = q[:, robot.q_slices[robot.joint_index["slide"]].start]
    assert slide.count == int(((column > UPPER) | (column < LOWER)).sum())
    assert slide.by == pytest.approx(max(column.max() - UPPER, LOWER - column.min()), rel=1e-12)


def test_touching_is_not_leaving(tmp_path: Path) -> None:
    robot = hybridyn.load(files(tmp_path, motion())[0])
    q = np.full((1, robot.nq), 0.15)
    q[0, robot.q_slices[robot.joint_index["slide"]].start] = UPPER * (1 + 1e-9)
    assert departures(robot, q, np.zeros((1, robot.nv)), np.full((1, 1), EFFORT * (1 + 1e-12))) == ()
    empty = hybridyn.load(files(tmp_path, motion(), upper=LOWER)[0])
    joint = next(j for j in empty.description.joints if j.name == "slide")
    assert position_limits(joint) is None


@pytest.mark.parametrize("words", [[], ["--loads"]])
def test_a_robot_without_mass_is_refused(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot, rows = files(tmp_path, motion())
    text = robot_text()
    inertial = text[text.index("<inertial>") : text.index("</inertial>") + len("</inertial>")]
    robot.write_text(text.replace(inertial, ""))
    said = call(capsys, "idm", robot, rows, *words, status=1)
    assert said.out == ""
    assert "nothing has mass, so that every effort would be zero" in said.err


TIME = np.linspace(0.0, 1.0, 21)
ARMS = ["time", "m1_left_drive/position", "m1_right_drive/position"]
TOOL = ["time", "m1_tool/pose/x", "m1_tool/pose/z"]
SWING = np.column_stack([-0.2 + 0.5 * np.sin(TIME), 0.2 + 0.3 * np.sin(TIME)])  # rad
PLACE = np.column_stack([0.1 * TIME, np.full(21, -0.45)])  # m


@pytest.mark.parametrize(
    ("header", "values", "status", "words"),
    [
        (
            ARMS,
            SWING * 180 / np.pi,
            0,
            "limit 1.2 rad, by 24.7 rad; first at row 1 (0 s), 21 samples: degrees?",
        ),
        (ARMS, SWING, 0, ""),
        (TOOL, PLACE * 1000, 1, "'m1_tool' goes to 450 m, and the robot's size is 0.25 m: millimetres?"),
        (TOOL, PLACE - 1.0, 1, ""),
    ],
)
def test_tables(
    header: list[str], values: np.ndarray, status: int, words: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    (tmp_path / "motion.csv").write_text(table_text(header, np.column_stack([TIME, values])))
    said = call(capsys, "idm", "five_bar", tmp_path / "motion.csv", "-o", tmp_path / "out.csv", status=status)
    asked = [line for line in said.err.splitlines() if line.endswith("?")]
    assert bool(asked) == bool(words)
    assert words in said.err


@pytest.mark.slow
def test_a_slide_in_millimetres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    names = [f"m1_leg{i}_slide/position" for i in range(1, 7)]
    rows = np.column_stack([TIME, *[50.0 + TIME] * 6])
    (tmp_path / "motion.csv").write_text(table_text(["time", *names], rows))
    said = call(capsys, "idm", "gough_stewart", tmp_path / "motion.csv", status=1)
    assert said.err.endswith("'m1_leg1_slide' goes to 51 m (limits -0.2 and 0.2): millimetres?\n")


def test_a_frame_of_a_closure() -> None:
    d = shipped("five_bar")
    frame = d.closures[0].frame_b.copy()
    frame[:3, 3] *= 1000
    far = replace(d, closures=(replace(d.closures[0], frame_b=frame),))
    words = "The frame of 'm1_tip' on 'm1_right_lower' is 400 m from its link, and no .*: millimetres\\?$"
    refused(lambda: build_robot(far), AssemblyError, words)
