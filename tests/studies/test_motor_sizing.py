"""Motor loads over a motion, against closed forms: a mass on a slide, a pendulum, a closed cycle."""

import csv
import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.colours import ALARM
from hybridyn.effects import DcMotors, choose
from hybridyn.figures.as_matplotlib import figure_of_chart
from hybridyn.figures.as_page import page_of_chart
from hybridyn.figures.reports import chart_of_sizing
from hybridyn.streams import one_pass
from hybridyn.streams.departures import departures
from hybridyn.studies.sizing import CLOUD, Sizing, motor_rows
from tests.support.command_line import call, table_text
from tests.support.files import beginning, save

MASS, LENGTH, GRAVITY = 2.5, 0.4, 9.81
EFFORT_LIMIT, SPEED_LIMIT = 20.0, 1.0
RATIO = 50.0
EXACT = 1e-12  # values at samples: rounding
QUADRATURE = 3e-5  # trapezoids over half waves of 200 samples: (pi / 200)^2 / 12 = 2.1e-5


def robot_text(kind: str) -> str:
    """Return a point mass on a horizontal slide, or at the end of a rod that swings about y."""
    com = f"0 0 {-LENGTH}" if kind == "revolute" else "0 0 0"
    axis = "0 1 0" if kind == "revolute" else "1 0 0"
    return f"""<robot name="single"><link name="ground"/><link name="bob"><inertial><origin xyz="{com}"/>
      <mass value="{MASS}"/><inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="drive" type="{kind}"><parent link="ground"/><child link="bob"/><axis xyz="{axis}"/>
      <limit lower="-4" upper="4" effort="{EFFORT_LIMIT}" velocity="{SPEED_LIMIT}"/></joint>
      <transmission name="t"><joint name="drive"/><actuator name="m">
        <mechanicalReduction>{RATIO}</mechanicalReduction></actuator></transmission></robot>"""


def swing(amplitude: float, w: float, periods: float, samples: int) -> np.ndarray:
    t = np.linspace(0.0, periods * 2 * np.pi / w, samples)
    x = amplitude * np.sin(w * t)
    return np.column_stack([t, x, amplitude * w * np.cos(w * t), -(w**2) * x])


HEADER = ["time", "drive/position", "drive/velocity", "drive/acceleration"]


def write(folder: Path, kind: str, table: np.ndarray, header: list[str] = HEADER) -> tuple[Path, Path]:
    robot = save(folder, robot_text(kind), "single.urdf")
    return robot, save(folder, table_text(header, table), "motion.csv")


def single(folder: Path) -> hybridyn.HybridRobot:
    """Return a robot of one slide."""
    return hybridyn.load(save(folder, robot_text("prismatic"), "single.urdf"))


def sized(
    folder: Path, capsys: pytest.CaptureFixture[str], kind: str, table: np.ndarray, *words: str
) -> dict[str, float]:
    report = folder / "report.json"
    robot, motion = write(folder, kind, table)
    call(capsys, "idm", "--loads", robot, motion, "-o", report, "--fail-on", "never", *words)
    (facts,) = json.loads(report.read_text())
    return facts


def holds(found: dict[str, float], wanted: dict[str, float], **tolerance: float) -> None:
    """Compare numbers of a report."""
    assert {name: found[name] for name in wanted} == pytest.approx(wanted, **tolerance)


def test_a_mass_on_a_slide(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With x = A sin wt: force m A w^2, power m A^2 w^3 / 2 sin 2wt, energy m A^2 w^2 / 2 per half swing."""
    A, w, periods = 0.3, 7.0, 3
    found = sized(tmp_path, capsys, "prismatic", swing(A, w, periods, 12 * 200 + 1))
    force, power = MASS * A * w**2, MASS * A**2 * w**3 / 2
    found["peak_effort"] = abs(found["peak_effort"])
    wanted = {  # at samples, and sums of squared sines, which are exact
        "peak_effort": force, "peak_effort_at": np.pi / 2 / w, "rms_effort": force / np.sqrt(2),
        "peak_speed": A * w, "peak_speed_at": 0.0, "rms_speed": A * w / np.sqrt(2),
        "peak_power": power, "peak_braking_power": -power, "position_lower": -A, "position_upper": A,
        "rotor_peak_torque": force / RATIO, "rotor_peak_speed": A * w * RATIO,
    }  # fmt: skip
    holds(found, wanted, rel=EXACT, abs=0.0)
    holds(found, {"mean_power": 0.0}, abs=EXACT * power)
    energy = 2 * periods * MASS * A**2 * w**2 / 2
    holds(found, {"energy_given": energy, "energy_taken": energy}, rel=QUADRATURE)
    assert (found["effort_unit"], found["speed_unit"]) == ("N", "m/s")


def test_a_pendulum_that_is_lifted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Turning at a constant rate from hanging to upright: torque m g l sin(q), energy 2 m g l."""
    t = np.linspace(0.0, 2.0, 2001)
    rate = np.pi / 2.0
    table = np.column_stack([t, rate * t, np.full_like(t, rate), np.zeros_like(t)])
    found = sized(tmp_path, capsys, "revolute", table)
    torque = MASS * GRAVITY * LENGTH
    peaks = {"peak_effort": torque, "peak_effort_at": 1.0, "peak_power": torque * rate}
    holds(found, peaks | {"rms_effort": torque / np.sqrt(2)}, rel=EXACT)
    holds(found, {"energy_given": 2 * torque, "mean_power": 2 * torque / 2.0}, rel=QUADRATURE)
    holds(found, {"energy_taken": 0.0}, abs=EXACT * torque)


def test_limits_are_compared_and_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """All that is asked for is written, too."""
    A, w = 0.3, 7.0
    report, figure = tmp_path / "report.json", tmp_path / "cloud.svg"
    robot, motion = write(tmp_path, "prismatic", swing(A, w, 1, 101))
    said = call(capsys, "idm", "--loads", robot, motion, "-o", report, "--plot", figure, status=1)
    force = MASS * A * w**2
    assert abs(json.loads(report.read_text())[0]["peak_effort"]) == pytest.approx(force, rel=EXACT)
    assert len(figure.read_text()) > 10_000
    assert ">drive<" in figure.read_text()
    count = int((np.abs(swing(A, w, 1, 101)[:, 2]) > SPEED_LIMIT).sum())
    for told in (
        f"joint 'drive' leaves its limits: effort of -{force:.6g} N, limit -20 N, by {force - 20:.3g} N; ",
        "joint 'drive' leaves its limits: speed of 2.1 m/s, limit 1 m/s, by 1.1 m/s; first at row 1 (0 s), ",
        f"(0 s), {count} samples",
    ):
        assert told in said.out
    again = call(capsys, "idm", "--loads", robot, motion, "--fail-on", "never")
    assert again.out == said.out
    timeless = [re.sub(r", [\d,]+ samples/s, wall time .*", "", text) for text in (again.err, said.err)]
    assert timeless[0] == timeless[1]
    gentle = call(capsys, "idm", "--loads", *write(tmp_path, "prismatic", swing(0.1, 2.0, 1, 101)))
    assert "no effort, speed or position is over a limit" in gentle.out


def test_a_motion_that_touches_a_limit_does_not_exceed_it(tmp_path: Path) -> None:
    robot = single(tmp_path)
    at_limit = np.full((3, 1), EFFORT_LIMIT) * (1 + np.array([[-1e-12], [0.0], [1e-12]]))
    assert departures(robot, np.zeros((3, 1)), np.zeros((3, 1)), at_limit) == ()


@pytest.mark.parametrize("blocks", [(2001,), (1, 1, 1999), (700, 0, 701, 600)])
def test_blocks_do_not_change_the_numbers(blocks: tuple[int, ...], tmp_path: Path) -> None:
    robot, rng = single(tmp_path), np.random.default_rng(8)
    t = np.cumsum(rng.uniform(0.5e-3, 2e-3, 2001))  # uneven steps
    speed, effort = np.sin(3 * t)[:, None], np.cos(5 * t)[:, None]
    whole, parts = Sizing(robot), Sizing(robot)
    whole.add(t, 1, speed, speed, effort)
    for first, last in pairwise([0, *np.cumsum(blocks)]):
        if last > first:
            rows = slice(first, last)
            parts.add(t[rows], first + 1, speed[rows], speed[rows], effort[rows])
    (one,), (other,) = whole.loads(), parts.loads()
    assert (other.effort, other.power) == (one.effort, one.power)
    sums = [(load.rms_effort, load.energy_given) for load in (one, other)]
    assert sums[1] == pytest.approx(sums[0], rel=EXACT)
    assert len(parts.cloud.points) == len(whole.cloud.points)


def test_the_cloud_is_thinned_evenly(tmp_path: Path) -> None:
    sizing = Sizing(single(tmp_path))
    for start in range(0, 50_000, 777):
        x = np.arange(start, min(start + 777, 50_000), dtype=float)[:, None]
        sizing.add(None, start + 1, x, x, x)
    kept = sizing.cloud.points[:, 0, 0]
    assert CLOUD / 2 < len(kept) <= 2 * CLOUD
    assert len(set(np.diff(kept))) == 1


def test_power_is_what_the_energy_gains(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Over the five-bar's closed cycle without friction, the motors deliver the energy that they absorb."""
    report = tmp_path / "report.csv"
    call(capsys, "idm", "--loads", "five_bar", "--effects", "default", "-o", report)
    rows = list(csv.DictReader(report.read_text().splitlines()))
    given = sum(float(row["energy_given"]) for row in rows)
    taken = sum(float(row["energy_taken"]) for row in rows)
    assert given == pytest.approx(taken, rel=10 * QUADRATURE)  # 1,001 samples of a faster motion
    assert [row["motor"] for row in rows] == ["m1_left_drive", "m1_right_drive"]


def test_numbers_are_those_of_the_inverse_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, one_process: None
) -> None:
    monkeypatch.setattr(one_pass, "MOST_ROWS", 40)
    robot, motion = hybridyn.load("five_bar"), beginning(tmp_path, "five_bar", 100)
    report = tmp_path / "report.json"
    call(capsys, "idm", "--loads", "five_bar", motion, "-o", report, "--jobs", "2")
    efforts = tmp_path / "efforts.csv"
    call(capsys, "idm", "five_bar", motion, "--effects", "model", "-o", efforts)
    tau = np.loadtxt(efforts, delimiter=",", skiprows=1)[:, 1:]
    for i, row in enumerate(json.loads(report.read_text())):
        assert abs(row["peak_effort"]) == pytest.approx(np.abs(tau[:, i]).max(), rel=1e-9)
    q = np.tile(robot.home, (2, 1))
    position, speed = motor_rows(robot, q, np.ones((2, robot.nv)))
    assert position.shape == speed.shape == (2, 2)


def test_a_table_without_time_has_no_energy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = swing(0.3, 7.0, 1, 101)
    robot, motion = write(tmp_path, "prismatic", table[:, 1:], HEADER[1:])
    report = tmp_path / "report.json"
    said = call(capsys, "idm", "--loads", robot, motion, "-o", report, "--fail-on", "never")
    (facts,) = json.loads(report.read_text())
    assert facts["energy_given"] is None
    assert facts["mean_power"] is None
    assert facts["peak_effort_row"] == 26  # a quarter of 100 steps, counted from 1
    assert facts["rms_effort"] == pytest.approx(np.sqrt(np.mean((MASS * table[:, 3]) ** 2)), rel=EXACT)
    assert "over" not in said.out.splitlines()[0]


def test_a_page_shows_what_the_report_says(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Samples, peak, RMS and limits of every motor, one entry in the legend for each, no network."""
    page, report = tmp_path / "cloud.html", tmp_path / "report.json"
    motion = beginning(tmp_path, "five_bar", 100)
    call(capsys, "idm", "--loads", "five_bar", motion, "-o", report, "--plot", page)
    text = page.read_text()
    assert not re.search(r"<(script|link)[^>]+(src|href)=.https?:", text)
    start = text.index("[", text.index("Plotly.newPlot(", text.rindex("<script")))
    traces, _ = json.JSONDecoder().raw_decode(text[start:])
    motors = json.loads(report.read_text())
    assert sorted(trace["name"] for trace in traces if trace["showlegend"]) == [
        "RMS effort", "limit", "peak effort", "samples",
    ]  # fmt: skip
    for axis, facts in zip(("y", "y2"), motors, strict=True):
        own = [trace for trace in traces if trace["yaxis"] == axis]
        (samples,) = [trace for trace in own if trace["name"] == "samples"]
        assert max(map(abs, samples["y"])) == pytest.approx(abs(facts["peak_effort"]), rel=EXACT)
        assert max(map(abs, samples["x"])) == pytest.approx(abs(facts["peak_speed"]), rel=EXACT)
        means = [trace["y"][0] for trace in own if trace["name"] == "RMS effort"]
        assert means == pytest.approx([-facts["rms_effort"], facts["rms_effort"]], rel=EXACT)


def test_the_line_of_a_dc_motor_is_drawn_where_the_panel_shows_it(tmp_path: Path) -> None:
    """Half the stall effort at half the speed without load; the current cuts it off at a third."""
    robot, k, R, U = single(tmp_path), 0.04, 0.5, 2.0
    stall, free = RATIO * k * U / R, U / (RATIO * k)
    law = DcMotors({"drive": k}, {"drive": R}, {"drive": U}, {"drive": 0.7 * stall / (RATIO * k)})
    sizing = Sizing(robot)
    speeds, efforts = np.array([[0.0], [0.5 * free], [free]]), np.array([[0.3], [0.2], [-0.3]]) * stall
    sizing.add(None, 1, np.zeros((3, 1)), speeds, efforts)
    (panel,) = chart_of_sizing(sizing, dc=choose(robot, ["default", law]).dc).panels
    upper = next(mark for mark in panel.marks if mark.name == "DC motor" and mark.y.max() > 0)
    line = np.minimum(0.7 * stall, stall * (1 - upper.x / free))
    assert np.abs(upper.y - line)[upper.x >= 0].max() < 1e-12 * stall
    assert len([mark for mark in panel.marks if mark.name == "DC motor"]) == 2


def test_limits_near_the_motion_are_drawn_on_figure_and_page(tmp_path: Path) -> None:
    sizing = Sizing(single(tmp_path))
    speeds, efforts = np.array([[0.0], [1e-3], [2e-3]]), np.array([[0.5], [0.0], [-0.4]]) * EFFORT_LIMIT
    sizing.add(None, 1, np.zeros((3, 1)), speeds, efforts)
    chart = chart_of_sizing(sizing, title="one <motor>")
    (panel,) = chart.panels
    limits = [mark for mark in panel.marks if mark.name == "limit"]
    assert [mark.y.tolist() for mark in limits] == [[-EFFORT_LIMIT] * 2, [EFFORT_LIMIT] * 2]  # none of speed
    (peak,) = (mark for mark in panel.marks if mark.name == "peak effort")
    assert (peak.x.tolist(), peak.y.tolist()) == ([0.0], [0.5 * EFFORT_LIMIT])
    figure = figure_of_chart(chart)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][:3] == ["samples", "peak effort", "RMS effort"]
    red = [line.get_ydata()[0] for line in figure.axes[0].lines if line.get_color() == ALARM]
    assert red == [-EFFORT_LIMIT, EFFORT_LIMIT]
    page = page_of_chart(chart)
    assert page.count('"name":"limit"') == 2
