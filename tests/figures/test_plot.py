"""Figures of tables, and the command that draws them."""

import csv
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.cli import main
from hybridyn.colours import ALARM
from hybridyn.description import read
from hybridyn.errors import TrajectoryError, install_advice
from hybridyn.figures.as_matplotlib import figure_of_chart
from hybridyn.figures.motion import chart_of_rows, extremes
from hybridyn.figures.panels import Panel, PanelFigure
from hybridyn.figures.reports import chart_of_report
from hybridyn.figures.workspace import figure_of_workspace
from tests import ROOT
from tests.support.command_line import call, table_text
from tests.support.comparing import refused
from tests.support.files import beginning, save

COLUMNS = ["time", "a/position", "b/position", "a/effort", "energy/kinetic", "energy/total", "residual"]
ROWS = np.column_stack([np.linspace(0, 1, 5)] + [np.full(5, float(i)) for i in range(1, 6)] + [np.zeros(5)])


def lines(panel: Panel) -> dict[str, list[float]]:
    """Return the lines of a panel by name; names end in the peak."""
    named = [mark for mark in panel.marks if mark.name]
    return {mark.name.partition(", peak")[0]: list(mark.y) for mark in named}


def test_motors_energies_and_residual_have_a_panel_each() -> None:
    figure = figure_of_chart(chart_of_rows(COLUMNS, ROWS[:, 0], ROWS, title="run"))
    position, effort, energy, residual = figure.axes
    names = [text.get_text() for text in position.get_legend().get_texts()]
    assert names == ["a, peak 1"]  # b has no effort: it is passive
    assert effort.lines[0].get_ydata() == pytest.approx(np.full(5, 3.0))
    assert [text.get_text() for text in energy.get_legend().get_texts()] == ["kinetic", "total"]
    assert residual.get_yscale() == "log"
    assert residual.get_xlabel() == "time [s]"


def test_joints_of_an_unknown_robot_share_no_axis() -> None:
    """N and N m are never on one axis."""
    columns = ["time", "a/effort", "b/effort", "a/position", "b/position"]
    panels = chart_of_rows(columns, np.arange(4.0), np.ones((4, 5))).panels
    assert [panel.title for panel in panels] == ["a", "b"] * 2
    assert {panel.label for panel in panels} == {"position [m or rad]", "effort [N or N m]"}


@pytest.mark.parametrize(
    ("words", "labels"),
    [
        (["--robot", "scara_delta"], {"effort [N]", "effort [N m]"}),
        ([], {"effort [N or N m]"}),
        (["--robot", "five_bar"], {"effort [N or N m]"}),
    ],
)
def test_the_command_keeps_newtons_and_newton_metres_apart(
    words: list[str], labels: set[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, target = tmp_path / "efforts.csv", tmp_path / "efforts.html"
    motors = read(ROOT / "urdf/scara_delta.urdf.xacro").motors
    table.write_text("\n".join([",".join(f"{m}/effort" for m in motors), ",".join("1" * len(motors))]) + "\n")
    call(capsys, "plot", table, "-o", target, *words)
    drawn = re.findall(r'"text":"(effort \[.*?\])"', target.read_text())
    assert {*drawn} == labels
    assert (len(drawn) == len(motors)) == ("scara_delta" not in words)


def test_nothing_to_draw_is_said() -> None:
    refused(lambda: chart_of_rows(["time"], ROWS[:, 0], ROWS[:, :1]), TrajectoryError, "no column of a joint")


@pytest.mark.parametrize(
    ("name", "head"),
    [("run.png", b"\x89PNG"), ("run.svg", b"<?xml"), ("run.pdf", b"%PDF"), (".png", b"\x89PNG")],
)
def test_the_command_draws_a_file(tmp_path: Path, name: str, head: bytes) -> None:
    table = tmp_path / "run.csv"
    table.write_text("# a remark\n" + table_text(COLUMNS[:2], ROWS[:, :2]))
    target = tmp_path / name
    assert main(["plot", str(table), "-o", str(target)]) == 0
    assert target.read_bytes().startswith(head)
    assert {p.name for p in tmp_path.iterdir()} == {"run.csv", name}


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
        (LOADS, ["effort [N]", "effort [N m]", "speed [rad/s]", "power [W]", "RMS", "peak of braking"]),
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


@pytest.mark.parametrize(("across", "aspect"), [("x", 1.0), ("roll", "auto")])
def test_axes_of_a_workspace_are_equal_if_their_units_are(across: str, aspect: float | str) -> None:
    poses = {across: np.repeat(np.arange(3.0), 3), "z": np.tile(np.arange(3.0), 3) / 10}
    figure = figure_of_workspace(poses, {"conditioning": np.linspace(0.1, 1.0, 9)})
    assert figure.axes[0].get_aspect() == aspect


@pytest.mark.parametrize("largest", [0.0, 2.0])
@pytest.mark.parametrize("levels", [1, 3])
def test_equal_values_have_one_colour(largest: float, levels: int) -> None:
    """In all slices of a map, and where nearly all values are zero."""
    x, y, z = (a.ravel() for a in np.meshgrid(np.arange(11.0), np.arange(11.0), np.arange(levels) / 10))
    held = np.zeros(len(x))
    held[-1] = largest
    figure = figure_of_workspace({"x": x, "y": y, "z": z}, {"conditioning": 0.1 + y, "motor/effort": held})
    figure.canvas.draw()
    images = [image for ax in figure.axes for image in ax.get_images()]
    assert len(images) == 2 * levels
    colours = np.concatenate([image.to_rgba(image.get_array()).reshape(-1, 4) for image in images[levels:]])
    assert len(np.unique(colours, axis=0)) == (2 if largest else 1)
    assert {image.get_clim() for image in images[levels:]} == {(0.0, largest or 1.0)}


def test_bars_are_the_numbers_of_the_report() -> None:
    rows = list(csv.DictReader(LOADS.splitlines()))
    newtons, _, slides, _, power = chart_of_report(rows).panels
    assert [(mark.x, list(mark.y)) for mark in newtons.marks] == [(("a",), [3.0]), (("a",), [2.0])]
    assert [list(mark.y) for mark in slides.marks] == [[1.0], [0.5]]
    assert [list(mark.y) for mark in power.marks] == [[4.0, 6.0], [1.0, 0.0]]
    refused(lambda: chart_of_report([{"setting": "x"}]), TrajectoryError, "neither loads of motors")


def chart(robot: hybridyn.HybridRobot, tau: np.ndarray) -> PanelFigure:
    columns = [f"{motor}/effort" for motor in robot.motors]
    return chart_of_rows(columns, np.linspace(0, 1, len(tau)), tau, robot=robot)


def test_motors_are_grouped_by_module_and_serial_ones_together() -> None:
    robot = hybridyn.load(ROOT / "urdf/stewart_ur5.urdf.xacro")
    panels = chart(robot, np.ones((3, len(robot.motors)))).panels
    assert [panel.label for panel in panels] == ["effort [N]", "effort [N m]"]
    assert panels[1].title.startswith("shoulder_link ... wrist_3_link")
    assert tuple(name for panel in panels for name in lines(panel)) == robot.motors


def test_limits_are_drawn_where_efforts_come_near() -> None:
    robot = hybridyn.load(ROOT / "urdf/stewart_ur5.urdf.xacro")
    limits = [next(j.effort for j in robot.description.joints if j.name == motor) for motor in robot.motors]
    tau = np.outer([0.0, 1.0, -0.5], np.full(len(limits), 1.0))
    tau[1, :6] = 0.9 * limits[0]
    tau[2, 6] = -0.7 * limits[6]
    near, far = chart(robot, tau).panels
    drawn = [{(m.y[0], m.colour) for m in panel.marks if m.style == "dashed"} for panel in (near, far)]
    assert drawn[0] == {(-limits[0], ALARM), (limits[0], ALARM)}
    assert drawn[1] == {(-limits[6], ALARM), (limits[6], ALARM)}  # other motors are far from theirs
    assert near.title == "m1_platform"


def test_peaks_are_marked_where_they_are() -> None:
    robot = hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro")
    tau = np.array([[0.0, 0.0], [1.0, 0.5], [-3.0, 0.25]])
    (panel,) = chart(robot, tau).panels
    assert {(m.x[0], m.y[0]) for m in panel.marks if m.style == "dot"} == {(1.0, -3.0), (0.5, 0.5)}
    assert [m.name for m in panel.marks if m.name] == ["m1_left_drive, peak -3", "m1_right_drive, peak 0.5"]


@pytest.mark.parametrize("each", [1, 7, 1000])
def test_extremes_keep_every_peak_of_long_tables(each: int) -> None:
    rows = np.random.default_rng(1).normal(size=(5003, 3))
    rows[4711, 1], rows[-1, 2] = 50.0, -60.0
    x, y = extremes(np.arange(5003.0), rows, each)
    assert len(x) == (5003 if each == 1 else 2 * -(-5003 // each))
    assert (np.diff(x) >= 0).all()
    assert (y.max(axis=0) == rows.max(axis=0)).all()
    assert (y.min(axis=0) == rows.min(axis=0)).all()
    assert abs(x[y[:, 1].argmax()] - 4711) < each


@pytest.mark.parametrize("ending", ["png", "svg", "html"])
def test_idm_draws_what_it_computes(tmp_path: Path, capsys: pytest.CaptureFixture[str], ending: str) -> None:
    words = ("-o", tmp_path / "efforts.csv", "--plot", tmp_path / f"efforts.{ending}")
    call(capsys, "idm", "tanev", beginning(tmp_path, "tanev", 10), *words)
    drawn = (tmp_path / f"efforts.{ending}").read_bytes()
    if ending != "png":
        for expected in (b"m1_platform", b"m2_platform"):
            assert expected in drawn
    assert drawn.startswith({"png": b"\x89PNG", "svg": b"<?xml", "html": b"<!doctype html>"}[ending])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["efforts.csv", f"efforts.{ending}", "motion.csv"]


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
    monkeypatch.setitem(sys.modules, "plotly", None)
    says = f"this needs plotly: {install_advice('plot')}"
    call(capsys, "idm", "five_bar", "--plot", "a.html", status=1, says=says)
