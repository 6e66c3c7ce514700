"""Scene files: what they say, and one line with file, line and key for each way of being wrong; controllers."""

# ruff: noqa: E501

import re
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description.side_cars.toml_file import line_of
from hybridyn.errors import HybridynError, ModelError, TrajectoryError
from hybridyn.scenes import controllers
from hybridyn.scenes.references import MotorAxes, Reference, RestPosture, from_points, from_table
from hybridyn.scenes.scene_file import read_scene
from hybridyn.scenes.stage import stage
from tests import ROOT
from tests.support.command_line import table_text
from tests.support.comparing import refused
from tests.support.files import save

HEAD = f'duration = 1.0\n[robot]\nfile = "{ROOT}/urdf/five_bar.urdf.xacro"\n'
PD = '[controller]\nkind = "pd"\nkp = 1.0\nkd = 1.0\n'
REFERENCE = "[controller.reference]\n"


def written(folder: Path, text: str) -> Path:
    return save(folder, HEAD + text, "scene.toml")


def refusal(folder: Path, text: str, words: str, **place: object) -> ModelError:
    return refused(lambda: stage(written(folder, text)), HybridynError, re.escape(words), **place)


def test_a_scene_is_read_with_its_defaults(tmp_path: Path) -> None:
    scene = read_scene(written(tmp_path, "")).scene
    assert (scene.duration, scene.robot.base, scene.effects.use) == (1.0, None, "default")
    assert scene.controller is None
    assert scene.solver.method == "dopri5"


@pytest.mark.parametrize(
    ("text", "line", "key", "words"),
    [
        ('[solver]\nmetod = "rk4"\n', 5, "solver.metod", "did you mean 'method'"),
        ('[controler]\nkind = "pd"\n', 4, "controler", "did you mean 'controller'"),
        ('[solver]\nmethod = "rk5"\n', 5, "solver.method", "'rk4'"),
        ('[solver]\nmethod = "rk4"\n', 4, "solver", "give step"),
        ("[solver]\nbaumgarte = 5.0\n", 5, "solver.baumgarte", "unknown key"),
        ('[controller]\nkind = "pdd"\n', 5, "controller.kind", "did you mean 'pd'"),
        ("[controller]\nkp = 1.0\n", 4, "controller.kind", "must be one of"),
        ('[controller]\nkind = "pd"\nkp = 1.0\n[controller.reference]\ntable = "x"\n', 4, "controller.kd", "missing"),
        (PD + "kpp = 1\n" + REFERENCE + 'table = "x"\n', 8, "controller.kpp", "did you mean 'kp'"),
        (PD + REFERENCE, 8, "controller.reference", "give one of table, points"),
        ('[controller]\nkind = "pd"\nkp = { a = -1.0 }\nkd = 1\n', 6, "controller.kp.a", "greater than or equal"),
        ("[effects.damper]\ncoefficient = { m1_left_drive = -1 }\n", 5, "effects.damper.coefficient.m1_left_drive",
         "greater than or equal"),
        ('[[effects.payload]]\nlink = "m1_tool"\nmass = 1\n[[effects.payload]]\nlink = "m1_tool"\nmass = -1\n', 9,
         "effects.payload.1.mass", "greater than or equal"),
        ('[[events]]\njoint = "a"\nat = 1\n[[events]]\njoint = "a"\naat = 1\n', 9, "events.1.aat", "did you mean 'at'"),
        ("[initial]\nplatforms = { m1_tool = { u = 1 } }\n", 5, "initial.platforms.m1_tool.u", "'yaw'"),
        ('[motion]\ntable = "x"\n' + PD + REFERENCE + 'table = "x"\n', None, "", "not both"),
    ],
)  # fmt: skip
def test_what_the_tables_refuse(tmp_path: Path, text: str, line: int | None, key: str, words: str) -> None:
    error = refusal(tmp_path, text, words, line=line, element=key or "")
    assert str(error).startswith(f"{tmp_path}/scene.toml:" + (f"{line}: '{key}'" if line else ""))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("[initial]\njoints = { m1_left_driv = 0.1 }\n", 5, "did you mean 'm1_left_drive'"),
        ('[effects]\nuse = ["default", "damping"]\n', 5, "no effect 'damping'"),
        ('[effects]\nuse = "spring"\n', 5, "no numbers"),
        ("[effects.spring]\nstiffness = { m1_left_drve = 1.0 }\n", 5, "did you mean 'm1_left_drive'"),
        ('[[effects.payload]]\nlink = "m1_tol"\nmass = 1.0\n', 5, "did you mean 'm1_tool'"),
        ('[[effects.wrench]]\nlink = "m1_tol"\nwrench = [0, 0, 0, 0, 0, 0]\n', 5, "did you mean 'm1_tool'"),
        ('[[events]]\njoint = "m1_left_driv"\nat = 0.0\n', 5, "did you mean 'm1_left_drive'"),
        ('[[events]]\nlink = "m1_tol"\nat = 0.0\n', 5, "did you mean 'm1_tool'"),
        (PD + REFERENCE + 'table = "short.csv"\n', 9, "the table runs from 0 s to 0.5 s, the scene from 0 to 1 s"),
        (PD + REFERENCE + 'table = "none.csv"\n', 9, "none.csv"),
        ('[controller]\nkind = "efforts"\ntable = "short.csv"\n', 6, "m1_left_drive/effort"),
        ('[controller]\nkind = "efforts"\ntable = "efforts.csv"\n', 6, "from 0 s to 0.5 s"),
        ('[controller]\nkind = "efforts"\nefforts = { m1_left_driv = 1 }\n', 4, "did you mean 'm1_left_drive'"),
        ("[initial.rates.joints]\nm1_left_drive = 1.0\nm1_left_elbow = 5.0\n", 6, "would open loops"),
        ("[initial.rates]\nplatforms = { m1_tool = { x = 1.0 } }\n", 5, "its pose is not given"),
        ("[initial]\nplatforms = { m1_tool = { x = 9.0, z = 9.0 } }\n", 4, "m1_"),
        ('[controller]\nkind = "python"\nfile = "law.py"\n', 6, "allow_python"),
        ('[controller]\nkind = "python"\nfile = "../law.py"\n', 6, "beside the scene"),
        ("[initial.rates.joints]\nm1_left_elbw = 5.0\n", 5, "did you mean 'm1_left_elbow'"),
        ('[controller]\nkind = "pd"\nkp = { m1_left_drive = 1 }\nkd = 1\n[[controller.reference.points]]\ntime = 0\n',
         4, "'m1_right_drive' has no number"),
        (PD + "[[controller.reference.points]]\ntime = 0\njoints = { m1_left_elbow = 1 }\n", 10, "is no motor"),
    ],
)  # fmt: skip
def test_what_the_robot_refuses(tmp_path: Path, text: str, line: int, words: str) -> None:
    (tmp_path / "short.csv").write_text(
        "time,m1_left_drive/position,m1_left_drive/velocity,m1_left_drive/acceleration,"
        "m1_right_drive/position,m1_right_drive/velocity,m1_right_drive/acceleration\n0,0,0,0,0,0,0\n0.5,0,0,0,0,0,0\n"
    )
    (tmp_path / "efforts.csv").write_text("time,m1_left_drive/effort,m1_right_drive/effort\n0,0,0\n0.5,0,0\n")
    assert str(refusal(tmp_path, text, words)).startswith(f"{tmp_path}/scene.toml:{line}: ")


def test_no_toml_no_robot_no_text(tmp_path: Path) -> None:
    refusal(tmp_path, "x =\n", ":4: not readable as TOML")
    path = save(tmp_path, b"\xff", "other.toml")
    refused(lambda: read_scene(path), ModelError, "UTF-8")
    path.write_text('duration = 1.0\n[robot]\nfile = "none.urdf"\n')
    refused(lambda: stage(path), ModelError, r"other.toml:3: 'robot.file': .*none.urdf")


def test_a_shipped_robot_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file beside the scene wins, whatever lies in the working directory."""
    folder, elsewhere = tmp_path / "scenes", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    (elsewhere / "five_bar").write_text("no robot")
    monkeypatch.chdir(elsewhere)
    path = save(folder, 'duration = 1.0\n[robot]\nfile = "five_bar"\n', "scene.toml")
    ready = stage(path)
    assert Path(ready.source.robot).samefile(ROOT / "urdf/five_bar.urdf.xacro")
    assert ready.robot.name == "five_bar"
    (folder / "five_bar").write_text((ROOT / "urdf/delta.urdf.xacro").read_text())
    assert read_scene(path).robot == str(folder / "five_bar")
    path.write_text('duration = 1.0\n[robot]\nfile = "fivebar"\n')
    refused(lambda: stage(path), ModelError, r"scene.toml:3: 'robot.file': .*no shipped robot.*'five_bar'")


def test_lines_of_arrays_of_tables() -> None:
    text = '[[a.b]]\nx = 1\n[[a.b]]\n"x" = 2\n[a.b.c]\ny = 3\n[d]\nz = [\n  1,\n]\n'
    places = {("a", "b", 0, "x"): 2, ("a", "b", 1, "x"): 4, ("a", "b", 1, "c", "y"): 6, ("d", "z", 0): 8}
    assert {keys: line_of(text, keys) for keys in places} == places
    assert line_of(text, ("e",)) is None


ROUNDING = 1e-12  # the same sums in another order
SOLVED = 1e-9  # two solutions of the loops and of the inertia, relative
DECAY = 1e-5  # tolerance of the integration, and a reference whose third derivative jumps
ENDLESS = """<robot name="wheel"><link name="base"/><link name="wheel"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hub" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/>
</joint></robot>"""


@pytest.fixture(scope="module")
def robot() -> hybridyn.HybridRobot:
    return hybridyn.load(ROOT / "urdf/five_bar.urdf.xacro")


@pytest.fixture(scope="module")
def state(robot) -> tuple[np.ndarray, np.ndarray]:
    q, v, _ = hybridyn.assemble(robot, motors={"m1_left_drive": (0.2, 0.7), "m1_right_drive": (-0.1, -0.4)})
    return q, v


@pytest.fixture(scope="module")
def reference(robot) -> Reference:
    return from_points(
        robot, [RestPosture(0.0, {}, {}), RestPosture(0.5, {"m1_left_drive": 0.3}, {})], robot.home
    )


def test_from_rest_to_rest(robot, reference) -> None:
    """s^3 (10 - 15 s + 6 s^2), its derivatives, and standing still afterwards."""
    for t in (0.0, 0.1, 0.25, 0.4, 0.5):
        s = t / 0.5
        x, v, a = (part[0] for part in reference.at(t))
        assert x == pytest.approx(0.3 * s**3 * (10 - 15 * s + 6 * s**2), abs=ROUNDING)
        assert v == pytest.approx(0.3 * 30 * s**2 * (1 - s) ** 2 / 0.5, abs=ROUNDING)
        assert a == pytest.approx(0.3 * 60 * s * (1 - s) * (1 - 2 * s) / 0.25, abs=10 * ROUNDING)
    assert np.array_equal(reference.at(7.0)[0], reference.x[0, -1])
    assert not np.any(reference.at(7.0)[1:])
    assert not np.any(np.array([reference.at(t) for t in (0.1, 0.3)])[:, :, 1])  # the other motor stays


def test_a_first_point_that_is_later_starts_where_the_robot_is(robot, state) -> None:
    found = from_points(robot, [RestPosture(1.0, {"m1_left_drive": 0.3}, {})], state[0])
    assert found.at(0.0)[0] == pytest.approx([0.2, -0.1], abs=ROUNDING)
    assert found.at(1.0)[0] == pytest.approx([0.3, -0.1], abs=ROUNDING)


def test_a_start_by_an_orientation_in_the_world(tmp_path: Path) -> None:
    """By a quaternion, by an axis times the angle, and by a whole pose, on a base that leans."""
    half = np.array([0.05, 0.1])
    lean, turn = ([0.0, float(np.sin(x)), 0.0, float(np.cos(x))] for x in half)
    point, spin = [0.1, 0.02, 0.65], 0.3
    head = HEAD.replace("five_bar", "gough_stewart") + 'base = "moving"\n'
    starts = []
    for pose, rates in (
        ([*point, *turn], [0, 0, 0, 0, spin, 0]),
        (dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), [*point, *turn], strict=True)), None),
        (dict(zip(("x", "y", "z", "rx", "ry", "rz"), [*point, 0.0, 0.2, 0.0], strict=True)), None),
    ):
        words = rates or dict(zip(("x", "y", "z", "wx", "wy", "wz"), [0, 0, 0, 0, spin, 0], strict=True))
        given = [
            x if isinstance(x, list) else "{" + ", ".join(f"{k} = {y}" for k, y in x.items()) + "}"
            for x in (pose, words)
        ]
        text = (
            f'[initial.platforms]\nm1_base = [0, 0, 0, {", ".join(map(str, lean))}]\n"m1_platform@world" = {given[0]}\n'
            f'[initial.rates.platforms]\n"m1_platform@world" = {given[1]}\n'
        )
        ready = stage(save(tmp_path, head + text, "scene.toml"))
        starts.append(np.concatenate([ready.q0, ready.v0]))
    assert starts[1] == pytest.approx(starts[0], abs=1e-9)
    assert starts[2] == pytest.approx(starts[0], abs=1e-9)


def test_points_by_platforms_reach_the_platform(robot) -> None:
    home = hybridyn.kinematics(robot, robot.home, np.zeros(4), np.zeros(4))["m1_tool"].pose
    goal = {"x": float(home[0]) + 0.05, "z": float(home[2]) - 0.03}
    x = from_points(robot, [RestPosture(0.4, {}, {"m1_tool": (goal,)})], robot.home).at(0.4)[0]
    q, v, a = hybridyn.assemble(robot, motors=dict(zip(robot.motors, x, strict=True)))
    pose = hybridyn.kinematics(robot, q, v, a)["m1_tool"].pose
    assert [pose[0], pose[2]] == pytest.approx([goal["x"], goal["z"]], abs=SOLVED)


def test_a_table_is_met_in_its_rows_and_ends_with_them(robot) -> None:
    reference = from_table(robot, str(ROOT / "models/five_bar/traj.csv"))
    for row in (0, 1, 500, 1000):
        for level, found in enumerate(reference.at(float(reference.time[row]))):
            assert found == pytest.approx(reference.x[level, row], abs=1e-9)
    t = (reference.time[10] + reference.time[11]) / 2
    step = 1e-4
    rate = (reference.at(t + step)[0] - reference.at(t - step)[0]) / (2 * step)
    assert rate == pytest.approx(reference.at(t)[1], rel=1e-4)
    refused(lambda: reference.at(float(reference.time[-1]) + 1e-3), TrajectoryError, "is outside")


def test_endless_motors_take_the_short_way_round(tmp_path: Path) -> None:
    path = save(tmp_path, ENDLESS, "wheel.urdf")
    wheel = hybridyn.load(path, motors=["hub"])
    q = np.array([np.cos(3.0), np.sin(3.0)])
    axes = MotorAxes.of(wheel)
    assert axes.positions(q) == pytest.approx([3.0])
    assert axes.error(np.array([-3.0]), q) == pytest.approx([2 * np.pi - 6.0])
    x = from_points(wheel, [RestPosture(1.0, {"hub": -3.0}, {})], q).at(1.0)[0]
    assert x == pytest.approx([2 * np.pi - 3.0])
    law = controllers.Pd(
        wheel, Reference(np.zeros(1), np.full((3, 1, 1), -3.0) * [[[1]], [[0]], [[0]]], True, q), 2.0, 0.0
    )
    assert law(0.0, q, np.zeros(1)) == pytest.approx([2 * (2 * np.pi - 6.0)])


def test_pd(robot, state, reference) -> None:
    law = controllers.Pd(robot, reference, {"m1_left_drive": 5.0, "m1_right_drive": 7.0}, 0.3)
    x, x_dot, _ = reference.at(0.2)
    expected = np.array([5.0, 7.0]) * (x - [0.2, -0.1]) + 0.3 * (x_dot - [0.7, -0.4])
    assert law(0.2, *state) == pytest.approx(expected, abs=ROUNDING)


def test_computed_torque_is_the_inverse_model_of_the_wanted_accelerations(robot, state, reference) -> None:
    law = controllers.ComputedTorque(robot, reference, 100.0, 20.0, "model")
    x, x_dot, x_ddot = reference.at(0.2)
    wanted = x_ddot + 20.0 * (x_dot - [0.7, -0.4]) + 100.0 * (x - [0.2, -0.1])
    a = hybridyn.ddm(robot, *state, law(0.2, *state), effects="model")
    motors = [robot.joints.index(name) for name in robot.motors]
    assert a[motors] == pytest.approx(wanted, rel=SOLVED)


def test_computed_torque_leaves_an_error_to_its_own_decay(robot, reference) -> None:
    """Second order, critically damped, from rest: e = e_0 (1 + w t) exp(-w t)."""
    w, start = 12.0, 0.1
    q, v, _ = hybridyn.assemble(robot, motors={"m1_left_drive": start, "m1_right_drive": 0.0})
    law = controllers.ComputedTorque(robot, reference, w * w, 2 * w)
    times = np.linspace(0.0, 0.05, 4)
    run = hybridyn.simulate(robot, q, v, times, effort=law, rtol=1e-6)
    at = robot.joints.index("m1_left_drive")
    error = run.q[:, at] - [reference.at(t)[0][0] for t in times]
    assert error == pytest.approx(start * (1 + w * times) * np.exp(-w * times), abs=DECAY * start)


def test_efforts_over_time(robot, state) -> None:
    law = controllers.EffortTable(np.array([0.0, 1.0]), np.array([[0.0, 4.0], [2.0, 0.0]]))
    assert law(0.25, *state) == pytest.approx([0.5, 3.0])
    refused(lambda: law(1.5, *state), TrajectoryError, "outside")
    assert list(controllers.constant(robot, {"m1_right_drive": 3.0})) == [0.0, 3.0]


@pytest.mark.parametrize(
    ("kp", "words"),
    [({"m1_left_driv": 1.0}, "did you mean"), ({"m1_left_drive": 1.0}, "no number"), (-1.0, "not negative")],
)
def test_gains_that_cannot_be(robot, reference, kp, words) -> None:
    refused(lambda: controllers.Pd(robot, reference, kp, 1.0), ModelError, words)


@pytest.mark.parametrize(
    ("text", "words"),
    [("x = 1\n", "AttributeError"), ("def controller(robot):\n    return 3\n", "must return a function"),
     ("def controller(robot):\n    raise ValueError('no')\n", "ValueError: no"), ("1 +\n", "SyntaxError")],
)  # fmt: skip
def test_python_that_is_none(robot, tmp_path: Path, text: str, words: str) -> None:
    path = save(tmp_path, text, "law.py")
    refused(lambda: controllers.from_file(robot, str(path), "controller"), ModelError, words)
    refused(
        lambda: controllers.from_file(robot, str(tmp_path / "none.py"), "controller"),
        ModelError,
        "no such Python file",
    )


def test_a_table_of_platforms_gives_the_motors_their_motion(robot, tmp_path: Path) -> None:
    t = np.linspace(0.0, 1.0, 21)
    home = hybridyn.kinematics(robot, robot.home, np.zeros(4), np.zeros(4))["m1_tool"].pose
    header = [f"m1_tool/{rate}/{axis}" for axis in "xz" for rate in ("pose", "velocity", "acceleration")]
    rows = [t, home[0] + 0.02 * np.sin(t), 0.02 * np.cos(t), -0.02 * np.sin(t)]
    rows += [home[2] + 0 * t, 0 * t, 0 * t]
    path = save(tmp_path, table_text(["time", *header], np.column_stack(rows)), "tool.csv")
    reference = from_table(robot, str(path))
    x, x_dot, _ = reference.at(0.525)
    given = {name: (x[i], x_dot[i]) for i, name in enumerate(robot.motors)}
    q, v, a = hybridyn.assemble(robot, motors=given)
    pose = hybridyn.kinematics(robot, q, v, a)["m1_tool"].pose
    assert pose[0] == pytest.approx(home[0] + 0.02 * np.sin(0.525), abs=1e-9)  # quintic between rows
