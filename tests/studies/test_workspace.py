"""Workspaces: a five-bar against its annuli, a slide against its limits, efforts; grids of joints."""

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import label

import hybridyn
from hybridyn.assembly.redundancy import LEAST
from hybridyn.spatial import Array
from hybridyn.studies.map_table import postures_on_grid
from hybridyn.studies.sweep.evaluation import status_of
from hybridyn.studies.workspace.closing import OUT_OF_REACH, PoseClosing
from hybridyn.studies.workspace.link_sweep import find_sweep
from hybridyn.studies.workspace.measures import Measures
from hybridyn.studies.workspace.workspace import Workspace, workspace
from tests.quantities.ankle import JOINTS, ankle, closed_form, leg
from tests.support.command_line import call, read_table
from tests.support.comparing import ROUNDING, SOLVED, close_to, refused
from tests.support.files import save
from tests.support.samples import slow

UPPER, LOWER, HALF_SPACING, LEAN = 0.25, 0.40, 0.12, np.radians(25.0)  # models/five_bar/README.md
DRIVE_LIMIT, ELBOW_LIMIT = 1.2, 1.9
STEP = 0.02
BOUNDARY = 5e-4  # m: nearer to where a leg is stretched, Newton need not arrive within its iterations
EXACT = 1e-9
DIFFERENCE = 1e-6  # rad: step of the central differences; their error is its square
DIFFERENCED = 1e-8


def leg_margins(x: Array, z: Array, home: Array, limits: bool) -> Array:
    """Compute how far the tip is inside the reach of both legs [m], negative outside; elbows outwards."""
    margin = np.full(x.shape, np.inf)
    for side in (-1.0, 1.0):
        dx = x - side * HALF_SPACING
        reach = np.hypot(dx, z)
        margin = np.minimum(margin, np.minimum(UPPER + LOWER - reach, reach - (LOWER - UPPER)))
        if not limits:
            continue
        with np.errstate(invalid="ignore"):
            at_motor = np.arccos((UPPER**2 + reach**2 - LOWER**2) / (2 * UPPER * reach))
            at_elbow = np.arccos((UPPER**2 + LOWER**2 - reach**2) / (2 * UPPER * LOWER))
        turn = np.arctan2(side * dx, -z) + at_motor - LEAN
        turn = (turn + np.pi) % (2 * np.pi) - np.pi
        home_reach = np.hypot(home[0] - side * HALF_SPACING, home[1])
        bend = at_elbow - np.arccos((UPPER**2 + LOWER**2 - home_reach**2) / (2 * UPPER * LOWER))
        margin = np.fmin(margin, (DRIVE_LIMIT - np.abs(turn)) * UPPER)
        margin = np.fmin(margin, (ELBOW_LIMIT - np.abs(bend)) * LOWER)
    return margin


@pytest.mark.parametrize(("limits", "step"), [slow(False, STEP), slow(True, STEP), (True, 2 * STEP)])
def test_a_five_bar_reaches_the_intersection_of_its_annuli(limits: bool, step: float) -> None:
    """With limits, only the part of it that is connected with home is reached."""
    found = workspace(hybridyn.load("five_bar"), link="m1_tool", steps={"x": step, "z": step}, limits=limits)
    assert found.sweep.names == ("x", "z")
    n = round(2 * (UPPER + LOWER) / step)
    i, k = np.meshgrid(np.arange(-n, n + 1), np.arange(-n, n + 1), indexing="ij")
    margin = leg_margins(found.start[0] + i * step, found.start[1] + k * step, found.start, limits)
    parts = label(margin > 0)[0]
    inside = parts == parts[n, n]
    reached = np.zeros_like(inside)
    reached[tuple((found.index + n).T)] = True
    assert not (reached & ~inside).any()
    assert np.abs(margin[inside & ~reached]).max(initial=0.0) < BOUNDARY
    assert reached.sum() * (step / STEP) ** 2 > (450 if limits else 2200)
    if limits:
        others = (parts > 0).sum() - inside.sum()  # they exist but are not reached
        assert others * (step / STEP) ** 2 > 25


def test_a_posture_reaches_its_coordinates_and_closes() -> None:
    robot = hybridyn.load("rps3")
    found = workspace(robot, steps={"z": 0.08, "roll": 0.3, "pitch": 0.3})
    assert found.sweep.names == ("z", "roll", "pitch")  # x, y and yaw follow: parasitic motion
    assert hybridyn.closure_residual(robot, found.q).max() < EXACT
    pose = hybridyn.kinematics(robot, found.q, np.zeros((len(found.q), robot.nv)), links=["m1_platform"])
    assert pose["m1_platform"].pose[:, 2] == pytest.approx(found.coordinates[:, 0], abs=EXACT)
    columns = dict(zip(found.sweep.names, found.coordinates.T, strict=True))
    q, _, _ = hybridyn.assemble(
        robot, platforms={"m1_platform@m1_base": {n: x[:1] for n, x in columns.items()}}
    )
    assert q[0] == pytest.approx(found.q[0], abs=1e-6)
    for name, at in zip(robot.joints, robot.q_slices, strict=True):
        joint = next(joint for joint in robot.description.joints if joint.name == name)
        assert (found.q[:, at.start] >= joint.lower - EXACT).all()
        assert (found.q[:, at.start] <= joint.upper + EXACT).all()


def test_a_single_slide_reaches_its_limits(tmp_path: Path) -> None:
    path = save(
        tmp_path,
        '<robot name="slide"><link name="rail"/><link name="cart"><inertial><mass value="3"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="drive" type="prismatic"><parent link="rail"/><child link="cart"/>'
        '<origin xyz="0 0 0.5"/><axis xyz="0 0 1"/><limit lower="-0.25" upper="0.5" effort="9" velocity="1"/>'
        "</joint></robot>",
        "slide.urdf",
    )
    found = workspace(hybridyn.load(path), module=1, steps={"z": 0.05})
    assert found.coordinates[:, 0] == pytest.approx(np.arange(-5, 11) * 0.05 + 0.5)
    assert found.size == pytest.approx(16 * 0.05)
    assert found.blocked == {"drive": 2}
    assert found.measures["drive/effort"] == pytest.approx(3 * 9.81)  # its weight
    assert found.measures["effort_per_force"] == pytest.approx(1.0)
    assert found.measures["conditioning"] == pytest.approx(1.0)
    everywhere = workspace(hybridyn.load(path), module=1, steps={"z": 0.05}, at={"z": 0.9})
    assert everywhere.coordinates[:, 0] == pytest.approx(np.arange(-13, 3) * 0.05 + 0.9)


def motor_map(robot: hybridyn.HybridRobot, found: Workspace, i: int) -> Array:
    """Return motor positions over the tool's x and z by central differences of assembled postures."""
    ends = found.coordinates[i] + DIFFERENCE * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    platforms = {"m1_tool@m1_base": dict(zip(("x", "z"), ends.T, strict=True))}
    q = hybridyn.assemble(robot, platforms=platforms, guess=found.q[i])[0]
    motors = q[:, [robot.joint_index[name] for name in robot.motors]]
    return (motors[::2] - motors[1::2]).T / (2 * DIFFERENCE)


def test_maps_of_a_five_bar_are_those_of_virtual_work() -> None:
    robot = hybridyn.load("five_bar")
    found = workspace(robot, link="m1_tool", steps={"x": 0.2, "z": 0.2})
    for i in range(len(found.index)):
        J = motor_map(robot, found, i)  # motor rates over the tool's velocity
        s = np.linalg.svd(J, compute_uv=False)
        assert found.measures["conditioning"][i] == pytest.approx(s[1] / s[0], rel=1e-4)
        rows = np.linalg.norm(np.linalg.inv(J.T), axis=1)  # J^T tau = F
        assert found.measures["effort_per_force"][i] == pytest.approx(rows.max(), rel=1e-4)
    tau = hybridyn.idm(robot, found.q, *np.zeros((2, len(found.q), robot.nv)))
    for column, name in enumerate(robot.motors):
        assert found.measures[f"{name}/effort"] == pytest.approx(tau[:, column], rel=EXACT)


@pytest.mark.parametrize(
    ("name", "module", "names", "axes"),
    [
        ("gough_stewart", None, "x y z roll pitch yaw", "x y z"),
        ("delta", None, "x y z", "x y z"),
        ("tanev", 2, "roll pitch yaw", "roll pitch yaw"),
        ("snake", "m3_platform", "roll pitch yaw", "roll pitch yaw"),
        ("stewart_ur5", 4, None, None),
        ("five_bar", None, "x z", "x z"),
    ],
)
def test_what_is_swept(name: str, module: int | str | None, names: str | None, axes: str | None) -> None:
    robot = hybridyn.load(name)
    sweep = find_sweep(robot, module, None, None, robot.home)
    if names is None:
        assert 0 < len(sweep.axes) <= sum(robot.modules[k].mobility for k in sweep.modules)
    else:
        assert (" ".join(sweep.names), " ".join(sweep.axes)) == (names, axes)


def test_other_coordinates_can_be_swept_and_held() -> None:
    robot = hybridyn.load("gough_stewart")
    found = workspace(robot, axes=["z", "yaw"], at={"x": 0.05}, steps={"z": 0.05, "yaw": 0.2})
    assert found.sweep.axes == ("z", "yaw")
    assert found.coordinates[:, 0] == pytest.approx(0.05)
    assert found.coordinates[:, 3] == pytest.approx(0.0, abs=EXACT)
    assert len(np.unique(found.index[:, 1])) > 5


@pytest.mark.slow
def test_the_lattice_is_symmetric_where_the_robot_is() -> None:
    """The five-bar is symmetric in x except for its tool, which changes the efforts but not the reach."""
    found = workspace(hybridyn.load("five_bar"), link="m1_tool", steps={"x": 0.04, "z": 0.04})
    points = {tuple(index) for index in found.index.tolist()}
    assert {(-i, k) for i, k in points} == points


def test_no_step_changes_the_branch() -> None:
    """A step to a pose that only the other assembly branch reaches is rejected."""
    robot = hybridyn.load("five_bar")
    sweep = find_sweep(robot, None, "m1_tool", None, robot.home)
    inner = robot.home[robot.modules[0].q_index]
    far = sweep.home + np.array([0.0, 1.1])  # above the motors: the legs pass their dead centres on the way
    _, state = PoseClosing(robot, sweep, False, LEAST)(1, sweep.home[None], far[None], inner[None])
    assert state[0] == OUT_OF_REACH


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"module": "m2"}, "there is no module 'm2'"),
        ({"module": 7}, "there is no module '7'; there are 1"),
        ({"link": "m1_tol"}, "did you mean 'm1_tool'"),
        ({"link": "m1_base"}, "no module moves link 'm1_base' relative to 'm1_base'"),
        ({"module": 2, "link": "m1_platform", "robot": "lx4"}, "does not belong to module"),
        ({"module": 1, "link": "m1_tool@m1_base"}, "between 'm1_tool' and 'm1_base' move; name no module"),
        ({"link": "m1_tool@m1_bas"}, "did you mean 'm1_base'"),
        ({"axes": ["q"]}, "there is no coordinate 'q'"),
        ({"axes": ["y"]}, "'y' of link 'm1_tool' is not independent"),
        ({"at": {"yaw": 0.1}}, "'yaw' of link 'm1_tool' cannot be chosen"),
        ({"at": {"z": 5.0}}, "does not reach the workspace's origin"),
        ({"steps": {"x": 0.0}}, "the step of 'x' must be positive"),
        ({"steps": {"roll": 0.1}}, "'roll' is not swept"),
        ({"link": "m1_tool", "at": {"x": 0.0, "z": -0.12}}, r"joint 'm1_\w+_drive' is outside its limits"),
        ({"robot": "lx4"}, r"choose a module: 1 \(m1_platform\), 2"),
    ],
)
def test_wrong_arguments_are_refused(words: dict[str, object], message: str) -> None:
    robot = hybridyn.load(words.pop("robot", "five_bar"))
    error = refused(lambda: workspace(robot, **words), hybridyn.HybridynError, message)
    far = "outside its limits" in message or "does not reach" in message
    assert status_of(error) == ("unreachable" if far else "failed")  # of a design


@pytest.mark.parametrize("seed", range(4))
def test_a_linkage_that_lies_flat_holds_no_weight(seed: int) -> None:
    """Efforts are zero where a turned frame rounds gravity: a map would show the rounding in colours."""
    rounded = np.array([0.0, -9.81, 0.0]) + 1e-15 * np.random.default_rng(seed).normal(size=3)
    robot = hybridyn.load("five_bar", gravity=rounded)
    found = Measures(robot, find_sweep(robot, None, None, None, robot.home))(robot.home[None])
    efforts = [x for name, x in found.items() if name.endswith("/effort")]
    assert len(efforts) == 2
    assert not np.any(efforts)


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], one_process: None) -> None:
    """The table, the summary and the figure; several processes give the same bytes as one."""
    one, two, figure = (tmp_path / name for name in ("one.csv", "two.csv", "maps.png"))
    words = ["workspace", "five_bar", "--link", "m1_tool", "--step", "x=0.3,z=0.3"]
    said = call(capsys, *words, "-o", one, "--plot", figure)
    assert said.out == ""
    call(capsys, *words, "-o", two, "--jobs", "2")
    assert one.read_bytes() == two.read_bytes()
    table = read_table(one.read_text())
    count = len(table["conditioning"])
    assert f"module 1: {count} poses of 'm1_tool' in 'm1_base'" in said.err
    assert "steps stopped by: " in said.err
    assert table["m1_tool@m1_base/pose/x"].max() == pytest.approx(-table["m1_tool@m1_base/pose/x"].min())
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert figure.stat().st_size > 20_000


def test_a_figure_marks_what_ends_the_workspace() -> None:
    """Marks lie between a pose that is reached and one that is not."""
    from hybridyn.figures.workspace import figure_of_workspace

    found = workspace(hybridyn.load("five_bar"), steps={"x": 0.15, "z": 0.15})

    def named(coordinates: Array) -> dict[str, Array]:
        return dict(zip(found.sweep.names, coordinates.T, strict=True))

    ends = {reason: named(x) for reason, x in found.edges.items()}
    figure = figure_of_workspace(named(found.coordinates), found.measures, ends=ends)
    for marks, (reason, steps) in zip(figure.axes[0].collections, found.rejected.items(), strict=True):
        assert marks.get_label() == reason
        at = (np.asarray(marks.get_offsets()) - found.start) / found.steps
        close_to(at, (steps[:, 0] + steps[:, 1]) / 2, SOLVED)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == set(found.blocked)


@pytest.mark.slow
@pytest.mark.parametrize("name", [slow("delta"), "rps3", slow("gough_stewart")])
def test_a_figure_of_slices(name: str, tmp_path: Path) -> None:
    from hybridyn.figures.workspace import figure_of_workspace

    coarse = {"z": 0.1, "roll": 0.5, "pitch": 0.5} if name == "rps3" else {"x": 0.15, "y": 0.15, "z": 0.1}
    found = workspace(hybridyn.load(name), steps=coarse)
    coordinates = dict(zip(found.sweep.names, found.coordinates.T, strict=True))
    unit = "N m" if name == "delta" else "N"
    figure = figure_of_workspace(coordinates, found.measures, unit=unit)
    assert len(figure.axes) >= 3 * 2
    figure.savefig(tmp_path / "maps.svg")
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert all("[" in label for label in labels if "effort" in label or "conditioning" in label)
    assert ("[N m per N]" in " ".join(labels)) == (name == "delta")


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
