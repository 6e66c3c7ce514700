"""Figures of tables, and the command that draws them."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.cli import main
from hybridyn.description import read
from hybridyn.errors import TrajectoryError, install_advice
from hybridyn.figures.envelope import Envelope
from hybridyn.figures.motion import chart_of_rows
from hybridyn.figures.panels import Chart
from hybridyn.figures.plot import figure_of_efforts, figure_of_table
from hybridyn.figures.reports import chart_of_report
from hybridyn.figures.table import chart_of_table
from tests import ROOT
from tests.command_line import call
from tests.comparing import refused
from tests.files import save

COLUMNS = ["time", "a/position", "b/position", "a/effort", "energy/kinetic", "energy/total", "residual"]
ROWS = np.column_stack([np.linspace(0, 1, 5)] + [np.full(5, float(i)) for i in range(1, 6)] + [np.zeros(5)])


def test_motors_energies_and_residual_have_a_panel_each() -> None:
    figure = figure_of_table(COLUMNS, ROWS, title="run")
    position, effort, energy, residual = figure.axes
    assert [line.get_label() for line in position.lines] == ["a"]  # b has no effort: it is passive
    assert effort.lines[0].get_ydata() == pytest.approx(np.full(5, 3.0))
    assert [line.get_label() for line in energy.lines] == ["kinetic", "total"]
    assert residual.get_yscale() == "log"
    assert residual.get_xlabel() == "time [s]"


MIXED = ["time", "a/effort", "b/effort", "c/effort", "a/position", "b/position", "c/position"]
SAME = [np.linspace(0, 1, 4), *np.arange(24.0).reshape(6, 4)]


def test_joints_that_slide_and_joints_that_turn_have_their_own_axes() -> None:
    kinds = {"a": "prismatic", "b": "revolute", "c": "continuous"}
    panels = chart_of_table(MIXED, np.column_stack(SAME), kinds=kinds).panels
    assert [(panel.label, [line.name for line in panel.lines]) for panel in panels] == [
        ("position [m]", ["a"]),
        ("position [rad]", ["b", "c"]),
        ("effort [N]", ["a"]),
        ("effort [N m]", ["b", "c"]),
    ]
    assert (panels[3].lines[1].y == SAME[3]).all()


def test_joints_of_unknown_kind_share_no_axis() -> None:
    """N and N m are never on one axis, however little is known."""
    panels = chart_of_table(MIXED, np.column_stack(SAME)).panels
    assert all(len(panel.lines) == 1 for panel in panels)
    assert [panel.title for panel in panels] == ["a", "b", "c"] * 2
    assert {panel.label for panel in panels} == {"position [m or rad]", "effort [N or N m]"}
    known = chart_of_table(MIXED, np.column_stack(SAME), kinds={"a": "prismatic", "b": "prismatic"}).panels
    assert [panel.label for panel in known[2:]] == ["effort [N]", "effort [N or N m]"]


@pytest.mark.parametrize(
    ("words", "labels", "said"),
    [
        (["--robot", "scara_delta"], ["effort [N]", "effort [N m]"], ""),
        ([], ["effort [N or N m]"], "so 7 joints have an axis each: name its robot (--robot)"),
        (["--robot", "five_bar"], ["effort [N or N m]"], "has no joint 'scara_shoulder', so 7"),
    ],
)
def test_the_command_keeps_newtons_and_newton_metres_apart(
    words: list[str], labels: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, target = tmp_path / "efforts.csv", tmp_path / "efforts.svg"
    motors = read(ROOT / "urdf/scara_delta.urdf.xacro").motors
    table.write_text("\n".join([",".join(f"{m}/effort" for m in motors), ",".join("1" * len(motors))]) + "\n")
    answer = call(capsys, "plot", table, "-o", target, *words)
    assert said in answer.err
    assert bool(said) == bool(answer.err)
    drawn = re.findall(r">(effort \[.*?\])<", target.read_text())
    assert sorted({*drawn}) == sorted(labels)
    assert len(drawn) == (len(labels) if not said else len(motors))


def test_nothing_to_draw_is_said() -> None:
    refused(lambda: figure_of_table(["time"], ROWS[:, :1]), TrajectoryError, "no column of a joint")


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_the_command_draws_a_file(tmp_path: Path, ending: str, head: bytes) -> None:
    table = tmp_path / "run.csv"
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in ROWS.tolist())]
    table.write_text("# a remark\n" + "\n".join(lines) + "\n")
    target = tmp_path / f"run.{ending}"
    assert main(["plot", str(table), "-o", str(target)]) == 0
    assert target.read_bytes().startswith(head)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.csv", f"run.{ending}"]


LOADS = """motor,peak_effort,effort_unit,rms_effort,peak_speed,speed_unit,rms_speed,\
peak_power,peak_braking_power
a,-3,N,2,1,m/s,0.5,4,-1
b,5,N m,1,2,rad/s,0.25,6,
"""
EFFECTS = "effect,motor,unit,rms\ngravity,a,N,1\ngravity,b,N m,2\nvelocity,a,N,\nvelocity,b,N m,4\n"
POSES = "p@b/pose/x,p@b/pose/z,conditioning,m/effort\n" + "".join(
    f"{x / 10},{z / 5},{0.1 * (x + z)},{x}\n" for x in range(4) for z in range(3)
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LOADS, ["effort [N]", "effort [N m]", "speed [rad/s]", "power [W]", "RMS effort"]),
        (EFFECTS, ["RMS of what it adds [N]", "RMS of what it adds [N m]", "gravity", "velocity"]),
        (POSES, ["conditioning [-], 1 is isotropic", "largest effort against gravity [N or N m]", "z [m]"]),
    ],
)
def test_the_command_draws_reports_and_workspaces(
    text: str, words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, target = save(tmp_path, text, "report.csv"), tmp_path / "report.svg"
    call(capsys, "plot", source, "-o", target)
    drawn = target.read_text()
    assert [word for word in words if f">{word}<" not in drawn] == []


def test_bars_are_the_numbers_of_the_report() -> None:
    rows = list(csv.DictReader(LOADS.splitlines()))
    newtons, _, slides, _, power = chart_of_report(rows).panels
    assert (newtons.ticks, [line.y.tolist() for line in newtons.lines]) == (("a",), [[3.0], [2.0]])
    assert [line.y.tolist() for line in slides.lines] == [[1.0], [0.5]]
    assert [line.y.tolist() for line in power.lines] == [[4.0, 6.0], [1.0, 0.0]]
    refused(lambda: chart_of_report([{"setting": "x"}]), TrajectoryError, "neither loads of motors")


def chart(robot: hybridyn.HybridRobot, tau: np.ndarray) -> Chart:
    columns = [f"{motor}/effort" for motor in robot.motors]
    return chart_of_rows(robot, columns, np.linspace(0, 1, len(tau)), tau)


def test_motors_are_grouped_by_module_and_serial_ones_together() -> None:
    robot = hybridyn.load(ROOT / "urdf/stewart_ur5.urdf.xacro")
    panels = chart(robot, np.ones((3, len(robot.motors)))).panels
    assert [len(panel.lines) for panel in panels] == [6, 6]
    assert [panel.unit for panel in panels] == ["N", "N m"]
    assert panels[1].title == "shoulder_link ... wrist_3_link"
    assert tuple(line.name for panel in panels for line in panel.lines) == robot.motors


def test_limits_are_drawn_where_efforts_come_near_and_told_where_not() -> None:
    robot = hybridyn.load(ROOT / "urdf/stewart_ur5.urdf.xacro")
    limits = [next(j.effort for j in robot.description.joints if j.name == motor) for motor in robot.motors]
    tau = np.outer([0.0, 1.0, -0.5], np.full(len(limits), 1.0))
    tau[1, :6] = 0.9 * limits[0]
    tau[2, 6] = -0.7 * limits[6]
    near, far = chart(robot, tau).panels
    assert near.limits() == [(limits[0], None)]
    assert near.far_limits() == ""
    assert far.limits() == [(limits[6], 0)]  # its own line's: other motors of the panel have others
    assert far.far_limits().startswith("limit")
    figure = figure_of_efforts(robot, np.linspace(0, 1, 3), tau)
    dashed = [line for line in figure.axes[0].lines if line.get_linestyle() == "--"]
    assert sorted(line.get_ydata()[0] for line in dashed) == [-limits[0], limits[0]]


def test_peaks_are_marked_where_they_are() -> None:
    robot = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro")
    tau = np.array([[0.0, 0.0], [1.0, 0.5], [-3.0, 0.25]])
    ax = figure_of_efforts(robot, np.array([0.0, 0.5, 2.0]), tau).axes[0]
    marks = {(line.get_xdata()[0], line.get_ydata()[0]) for line in ax.lines if line.get_marker() == "o"}
    assert marks == {(2.0, -3.0), (0.5, 0.5)}
    assert [text.get_text() for text in ax.texts] == ["-3 N m"]


def test_the_power_is_that_of_the_motors() -> None:
    robot = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro")
    a, b = robot.motors
    columns = [f"{a}/effort", f"{b}/effort", f"{a}/velocity", f"{b}/velocity"]
    rows = np.array([[1.0, 2.0, 3.0, 4.0], [0.0, 1.0, 5.0, -6.0]])
    power = chart_of_rows(robot, columns, np.arange(2.0), rows).panels[-1]
    assert power.title == "power of the motors"
    assert power.lines[0].y.tolist() == [11.0, -6.0]


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_an_envelope_keeps_every_peak_of_long_tables(block: int) -> None:
    rows = np.random.default_rng(1).normal(size=(5003, 3))
    rows[4711, 1], rows[-1, 2] = 50.0, -60.0
    kept = Envelope(most=40)
    for first in range(0, len(rows), block):
        part = rows[first : first + block]
        kept.add(np.arange(first, first + len(part), dtype=float), part)
    x, y = kept.lines()
    assert len(x) <= 4 * 40 + 2
    assert (np.diff(x) >= 0).all()
    assert (y.max(axis=0) == rows.max(axis=0)).all()
    assert (y.min(axis=0) == rows.min(axis=0)).all()
    assert abs(x[y[:, 1].argmax()] - 4711) < 5003 / 40


@pytest.mark.parametrize("ending", ["png", "svg", "html"])
def test_idm_draws_what_it_computes(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str) -> None:
    words = ("-o", tmp_path / "efforts.csv", "--plot", tmp_path / f"efforts.{ending}")
    call(capsys, "idm", "tanev", *words)
    drawn = (tmp_path / f"efforts.{ending}").read_bytes()
    if ending != "png":
        for expected in (b"m1_platform", b"m2_platform"):
            assert expected in drawn
    assert drawn.startswith({"png": b"\x89PNG", "svg": b"<?xml", "html": b"<!doctype html>"}[ending])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["efforts.csv", f"efforts.{ending}"]


def test_a_page_needs_no_network(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = tmp_path / "run.html"
    table = tmp_path / "run.csv"
    lines = [",".join(COLUMNS), *(",".join(map(repr, row)) for row in ROWS.tolist())]
    table.write_text("\n".join(lines) + "\n")
    call(capsys, "plot", table, "-o", target)
    text = target.read_text()
    assert "Plotly.newPlot" in text
    assert not re.search(r"<(script|link)[^>]+(src|href)=.https?:", text)


@pytest.mark.slow
def test_ddm_effects_and_simulate_draw(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from PIL import Image

    scene = tmp_path / "short.toml"
    file = ROOT / "urdf/five_bar.urdf.xacro"
    scene.write_text(
        f'duration = 0.1\n[robot]\nfile = "{file}"\n[solver]\nmethod = "conserving"\nstep = 1e-2\n'
    )
    run = tmp_path / "run.csv"
    drawn = [tmp_path / f"{name}.png" for name in ("simulate", "ddm", "effects")]
    call(capsys, "simulate", scene, "-o", run, "--plot", drawn[0])
    call(capsys, "ddm", "five_bar", run, "-o", tmp_path / "a.csv", "--plot", drawn[1])
    call(capsys, "idm", "--by-effect", "five_bar", run, "--plot", drawn[2])
    for file in drawn:
        pixels = np.asarray(Image.open(file).convert("RGB"))
        assert (pixels < 250).any(axis=2).mean() > 0.02, file.name  # lines, axes and letters


def test_a_missing_package_is_told_before_any_work(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    call(
        capsys,
        "idm",
        "five_bar",
        "--plot",
        "a.html",
        status=2,
        says=f"this needs plotly: {install_advice('plot')}",
    )
