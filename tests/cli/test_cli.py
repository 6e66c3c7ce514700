"""The command line: what goes where, exit statuses, one-line errors, and nothing half-written."""

import csv
import math
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import click
import numpy as np
import pytest

import hybridyn
from hybridyn import compiled
from hybridyn.cli import COMMANDS, commands, main
from hybridyn.cli.common.progress import progress
from hybridyn.cli.common.text import aligned_rows
from hybridyn.errors import AT_SAMPLE, AssemblyError
from hybridyn.streams.one_pass import MOST_ROWS
from hybridyn.tables.opening import open_table
from tests import ROOT
from tests.support.clocks import Clock
from tests.support.command_line import call, program, table_text
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save
from tests.support.waiting import PATIENCE, wait_until

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="slider"><inertial><mass value="2"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"><inertial><origin xyz="1 0 0"/><mass value="3"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="slider"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="100" velocity="1"/></joint>
  <joint name="turn" type="revolute"><parent link="slider"/><child link="tool"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="100" velocity="1"/></joint>
</robot>
"""
HEADER = [f"{name}/{rate}" for name in ("lift", "turn") for rate in ("position", "velocity", "acceleration")]
ROWS = np.random.default_rng(7).uniform(-1.0, 1.0, (30, 6))
TIME = 0.1 * np.arange(30)
SCREEN = 50  # lines


@pytest.fixture
def arm(tmp_path: Path) -> str:
    path = save(tmp_path, ARM, "arm.urdf")
    return str(path)


@pytest.fixture
def motion(tmp_path: Path) -> str:
    path = save(tmp_path, table_text(["time", *HEADER], np.column_stack([TIME, ROWS])), "traj.csv")
    return str(path)


def expected_efforts(arm: str) -> np.ndarray:
    robot = hybridyn.load(arm)
    return hybridyn.idm(robot, ROWS[:, [0, 3]], ROWS[:, [1, 4]], ROWS[:, [2, 5]])


def test_efforts_on_standard_output_and_summary_on_standard_error(run, arm, motion) -> None:
    _, out, err = run("idm", arm, motion)
    header, *rows = csv.reader(out.splitlines())
    assert header == ["time", "lift/effort", "turn/effort"]
    found = np.array(rows, dtype=float)
    tau = expected_efforts(arm)
    assert np.array_equal(found[:, 0], TIME)
    assert np.array_equal(found[:, 1:], tau)
    lift, turn = (line.split() for line in err.splitlines()[2:4])
    peak = np.abs(tau[:, 0]).argmax()
    assert lift == [
        "lift",
        f"{tau[peak, 0]:.6g}",
        f"{np.sqrt(np.trapezoid(tau[:, 0] ** 2, TIME) / (TIME[-1] - TIME[0])):.6g}",
        "N",
        f"{TIME[peak]:.6g}",
        "s",
    ]
    assert " N m " in err.splitlines()[3]
    assert turn[0] == "turn"
    assert "30 samples" in err
    assert "wall time" in err
    assert "residual" not in err  # nothing to close
    assert "spline" not in err
    assert run("idm", arm, motion, "-q") == (0, out, "")


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_writes_a_file(run, arm, motion, tmp_path: Path, ending: str) -> None:
    pl = needs("io")
    target = tmp_path / f"out.{ending}"
    assert run("idm", arm, motion, "-o", target).out == ""
    frame = pl.read_csv(target) if ending == "csv" else pl.read_parquet(target)
    assert np.array_equal(frame.to_numpy()[:, 1:], expected_efforts(arm))


def test_gravity_wrenches_and_motors_reach_the_model(run, arm, tmp_path: Path) -> None:
    wrench = [f"tool/wrench/{name}" for name in ("fx", "fy", "fz", "mx", "my", "mz")]
    rest = np.zeros((1, 12))
    rest[0, 8] = 5.0
    path = save(tmp_path, table_text([*HEADER, *wrench], rest), "rest.csv")
    out = run("idm", arm, path, "--gravity", "0,0,-2", "--motors", "turn,lift").out
    header, row = csv.reader(out.splitlines())
    assert header == ["turn/effort", "lift/effort"]
    assert [float(cell) for cell in row] == pytest.approx([-6.0, 5.0])  # -(3 x 2) x 1 m; (2 + 3) x 2 - 5


def test_a_moving_base_takes_its_motion_from_the_table(run, arm, tmp_path: Path) -> None:
    """Upside down and thrown: the lift holds five kilograms against gravity less the throw."""
    pose = {"x": 0, "y": 0, "z": 9, "qx": 1, "qy": 0, "qz": 0, "qw": 0}
    header = [f"base/pose/{name}" for name in pose]
    header += [
        f"base/{rate}/{n}" for rate in ("velocity", "acceleration") for n in ("x", "y", "z", "wx", "wy", "wz")
    ]
    row = [*pose.values(), *[0, 0, 7, 0, 0, 0], *[0, 0, 2, 0, 0, 0]]
    path = save(tmp_path, table_text([*HEADER, *header], np.array([[0.0] * 6 + row])), "thrown.csv")
    out = run("idm", arm, path, "--base", "moving", "--gravity", "0,0,-10").out
    assert float(out.splitlines()[1].split(",")[0]) == pytest.approx(-5.0 * (10.0 + 2.0))
    run("idm", arm, path, status=1, says="the base is fixed")


def test_says_which_rates_come_from_a_spline(run, arm, tmp_path: Path) -> None:
    path = save(
        tmp_path,
        table_text(["time", "lift/position", "turn/position"], np.column_stack([TIME, TIME, TIME**2])),
        "traj.csv",
    )
    _, out, err = run("idm", arm, path)
    assert "spline" in err
    assert "velocity and acceleration of 'lift', 'turn'" in err
    assert len(out.splitlines()) == 31


def test_reads_standard_input(run, arm, motion, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = run("idm", arm, motion)[1]
    with open(motion) as text:
        monkeypatch.setattr(sys, "stdin", text)
        assert run("idm", arm, "-")[1] == wanted


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (("lift/position", "lifd/position"), ["column 'lifd/position'", "did you mean 'lift'"]),
        (("time", "tim"), ["column 'tim'", "did you mean 'time'"]),
        (("0.1,", "zero,"), ["row 2, column 'time'", "not a finite number"]),
        (("0.1,", "0.0,"), ["row 2, column 'time'", "does not come after"]),
    ],
)
def test_bad_tables_are_one_line_and_leave_nothing(run, arm, motion, tmp_path: Path, damage, words) -> None:
    path = Path(motion)
    path.write_text(path.read_text().replace(*damage, 1))
    before = sorted(tmp_path.iterdir())
    said = run("idm", arm, motion, "-o", tmp_path / "out.csv", status=1, says=words)
    assert said.err.startswith(f"error: {motion}, ")
    assert sorted(tmp_path.iterdir()) == before


def test_an_error_late_in_the_table_leaves_nothing_either(run, arm, tmp_path: Path) -> None:
    rows = np.column_stack([0.01 * np.arange(5_000), np.zeros((5_000, 6))])
    text = table_text(["time", *HEADER], rows)
    (tmp_path / "traj.csv").write_text(text.rstrip("\n")[:-3] + "nan\n")
    (tmp_path / "out.csv").write_text("old")
    before = sorted(tmp_path.iterdir())
    run("idm", arm, tmp_path / "traj.csv", "-o", tmp_path / "out.csv", status=1, says="row 5000")
    assert sorted(tmp_path.iterdir()) == before
    assert (tmp_path / "out.csv").read_text() == "old"


def test_bad_robots_and_efforts_that_overflow_are_one_line(run, arm, motion, tmp_path: Path) -> None:
    huge = save(tmp_path, table_text(HEADER, np.array([[0.0, 0, 0, 0, 1e200, 0]])), "huge.csv")
    assert "row 1" in run("idm", arm, huge, status=1).err
    path = save(tmp_path, ARM.replace('link="slider"', 'link="slidr"', 1), "arm.urdf")
    run("idm", path, motion, status=1, says=str(path))


def test_bugs_are_one_line_without_debug(run, arm, motion, tmp_path: Path, monkeypatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\nb\x1b[31m")

    monkeypatch.setattr("hybridyn.cli.idm.inverse_model", broken)
    said = run(
        "idm", arm, motion, "-o", tmp_path / "a.csv", status=1, says="unexpected ZeroDivisionError: a b"
    )
    assert "\x1b" not in said.err
    refused(lambda: main(["idm", arm, motion, "--debug"]), ZeroDivisionError, "")


def test_xacro_words_anywhere(run, motion, tmp_path: Path) -> None:
    path = tmp_path / "arm.urdf.xacro"
    text = ARM.replace('name="arm"', 'name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro"')
    text = text.replace('<link name="base"/>', '<xacro:arg name="m" default="2"/><link name="base"/>')
    path.write_text(text.replace('mass value="2"', 'mass value="$(arg m)"'))
    still = save(tmp_path, table_text(HEADER, np.zeros((1, 6))), "still.csv")
    weights = []
    for words in (
        [path, still],
        [path, "m:=4", still],
        [path, still, "--xacro", "m:=4"],
        ["m:=4", path, still],
    ):
        out = run("idm", *words).out
        weights.append(float(out.splitlines()[1].split(",")[0]))
    assert weights == pytest.approx([5 * 9.81, 7 * 9.81, 7 * 9.81, 7 * 9.81])


def test_a_five_bar_from_its_motors_or_its_full_state(run, tmp_path: Path) -> None:
    robot, source = ROOT / "urdf/five_bar.urdf.xacro", ROOT / "models/five_bar/traj.csv"
    _, out, err = run("idm", robot, source)
    assert "worst closure residual" in err
    efforts = np.array(list(csv.reader(out.splitlines()[1:])), dtype=float)
    assert len(efforts) == 1001

    five_bar = hybridyn.load(robot)
    with open_table(source) as table:
        rows = next(table.blocks).values
    motors = {name: tuple(rows[:, 1 + 3 * i : 4 + 3 * i].T) for i, name in enumerate(five_bar.motors)}
    q, v, a = hybridyn.assemble(five_bar, motors=motors)
    expected = hybridyn.idm(five_bar, q, v, a)
    # The first block has 1,000 rows, the second one: batches of other lengths are summed in another order.
    same = slice(0, MOST_ROWS)
    atol = 1e-13 * np.abs(expected).max()
    q, v, a = hybridyn.assemble(five_bar, motors={m: tuple(x[same] for x in w) for m, w in motors.items()})
    assert np.array_equal(efforts[same, 1:], hybridyn.idm(five_bar, q, v, a))
    np.testing.assert_allclose(efforts[:, 1:], expected, rtol=0, atol=atol)

    header = [
        f"{name}/{rate}" for rate in ("position", "velocity", "acceleration") for name in five_bar.joints
    ]
    path = save(tmp_path, table_text(header, np.hstack([q, v, a])), "state.csv")
    out = run("idm", robot, path).out
    assert np.array_equal(np.array(list(csv.reader(out.splitlines()[1:])), dtype=float), efforts[same, 1:])

    path.write_text(table_text(header, np.hstack([q + 1e-3, v, a])))
    assert "leave the passive joints out" in run("idm", robot, path, status=1).err


class Assembled:
    """Stands for `TableAssembler`: remembers what it was asked, fails on demand."""

    def __init__(self, fail_at: float = np.inf) -> None:
        self.calls: list[dict[str, object]] = []
        self.fail_at = fail_at

    def __call__(self, robot, *, motors=None, platforms=None, guess=None, nearest=False, redundancy=""):
        """Lift the arm to the tool's height."""
        self.calls.append({"motors": motors, "platforms": platforms, "guess": guess})
        z = platforms["tool"][0]["z"]
        wrong = np.flatnonzero(z >= self.fail_at)
        if len(wrong):
            at = int(wrong[0])
            text = f"module 'arm'{AT_SAMPLE}: no way from the one before, pass passive=\"solved\""
            raise AssemblyError(text, sample=at)
        zero = np.zeros((len(z), 2))
        return np.column_stack([z, 0 * z]), zero, zero


def test_platforms_are_assembled_block_after_block(run, arm, tmp_path: Path, monkeypatch) -> None:
    assembled = Assembled()
    monkeypatch.setattr(compiled, "TableAssembler", lambda robot: partial(assembled, robot))
    time_ = 0.001 * np.arange(4_500)
    path = save(tmp_path, table_text(["time", "tool/pose/z"], np.column_stack([time_, time_])), "traj.csv")
    out = run("idm", arm, path, "--engine", "general").out
    assert len(out.splitlines()) == 4_501
    assert len(assembled.calls) == math.ceil(4_500 / MOST_ROWS)
    first, *guesses = [call["guess"] for call in assembled.calls]
    assert first is None
    ends = [call["platforms"]["tool"][0]["z"][-1] for call in assembled.calls]
    assert [guess[0] for guess in guesses] == ends[:-1]  # each begins where the one before ends
    assembled.fail_at = 2.5
    message = "module 'arm': no way from the one before, pass --passive solved"
    err = run("idm", arm, path, "--engine", "general", status=1).err
    assert err == f"error: {path}, row 2501 (t = 2.5 s): {message}\n"


def test_rows_without_time_are_assembled_one_by_one(run, arm, tmp_path: Path, monkeypatch) -> None:
    assembled = Assembled(fail_at=3.0)
    monkeypatch.setattr(compiled, "TableAssembler", lambda robot: partial(assembled, robot))
    header = ["tool/pose/z", "tool/velocity/z", "tool/acceleration/z"]
    path = save(tmp_path, table_text(header, np.zeros((4, 3))), "traj.csv")
    run("idm", arm, path, "--engine", "general")
    assert [call["guess"] for call in assembled.calls] == [None] * 4
    path.write_text(table_text(header, np.arange(6.0)[:, None] * [1, 0, 0]))
    said = run("idm", arm, path, "--engine", "general", status=1)
    assert f"{path}, row 4: module 'arm'" in said.err


def test_weights_from_words(run, arm, motion, monkeypatch) -> None:
    seen = []

    def remembering(robot, q, v, a, *, weights=None, **_):
        seen.append(weights)
        return SimpleNamespace(values=np.zeros((len(q), 2)), reactions=None, residual=np.zeros(len(q)))

    monkeypatch.setattr("hybridyn.cli.idm.inverse_model", remembering)
    for words in (["lift=3,turn=2"], ["lift=3", "--weights", "turn=2"]):
        run("idm", arm, motion, "--weights", *words)
    assert seen == [{"lift": 3.0, "turn": 2.0}] * 2


def test_info_shows_modules_and_what_looks_wrong(run, arm, tmp_path: Path) -> None:
    _, out, err = run("info", arm)
    assert err == ""
    for told in (
        "base 'base' fixed; 2 modules; 2 freedoms", "prismatic joint lift*", "revolute joint turn*",
        "nothing looks wrong",
    ):  # fmt: skip
        assert told in out
    path = save(
        tmp_path,
        ARM.replace('mass value="3"', 'mass value="0"').replace('"1" iyy="1" izz="1"', '"0" iyy="0" izz="0"'),
        "light.urdf",
    )
    out = run("info", path)[1]
    assert f"{path}:5: warning [missing-inertial]\n  link 'tool': " in out
    assert "[no-mass]\n  module 'tool': none of its bodies has mass" in out


def test_help_names_every_command(run) -> None:
    out = run("--help").out
    assert all(f"\n  {name}" in out for name in COMMANDS)
    assert run() == (0, out, "")
    assert run("--version")[1] == f"hybridyn {hybridyn.__version__}\n"


def options_of(name: str) -> list[click.Option]:
    """Return the options of a command."""
    command = commands.get_command(click.Context(commands), name)
    assert command is not None
    return [one for one in command.params if isinstance(one, click.Option)]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_help_fits_a_screen_and_ends_with_the_options_of_the_robot(
    name: str, run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    own, _, shared = run(name, "--help").out.partition("Options of the robot:")
    assert (own + shared).count("\n") <= SCREEN
    assert "--package-dir" not in own
    assert ("--package-dir" in shared) == (name not in ("simulate", "sweep"))


def test_an_option_is_the_same_in_all_commands() -> None:
    """It is a flag everywhere or nowhere, and takes words of the same kind."""
    kinds: dict[str, set[object]] = {}
    for name in COMMANDS:
        for option in options_of(name):
            kinds.setdefault(option.opts[-1], set()).add((option.is_flag, type(option.type).__name__))
    assert {word: kind for word, kind in kinds.items() if len(kind) > 1} == {}


def test_a_reader_that_goes_away_is_no_error(arm, tmp_path: Path) -> None:
    rows = np.column_stack([0.01 * np.arange(20_000), np.zeros((20_000, 6))])
    (tmp_path / "traj.csv").write_text(table_text(["time", *HEADER], rows))
    with program("idm", arm, str(tmp_path / "traj.csv")) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        assert process.stdout.readline() == "time,lift/effort,turn/effort\n"
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(PATIENCE) == 141


@pytest.mark.parametrize(("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_interruption_leaves_nothing(arm, tmp_path: Path, number: int, status: int) -> None:
    """The table is a pipe that never ends, so that the work is under way when the signal comes."""
    target = tmp_path / "out.csv"
    with program("idm", arm, "-", "-o", str(target), stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        process.stdin.write(table_text(["time", *HEADER], np.column_stack([TIME, ROWS])))
        process.stdin.flush()
        wait_until(lambda: bool(list(tmp_path.glob(".out.csv.*"))), "a draft of the output")
        process.send_signal(number)
        assert process.wait(PATIENCE) == status
        assert process.stderr.read().strip() in ("error: interrupted", "")
    assert [path.name for path in tmp_path.iterdir()] == ["arm.urdf"]


def test_progress_is_drawn_only_when_it_takes_long(capsys, monkeypatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    clock = Clock()
    monkeypatch.setattr("hybridyn.cli.common.progress.time", clock)
    with progress() as show:
        clock.now = 1.9
        show(10, 0.1)
        assert capsys.readouterr().err == ""
        clock.now = 10.0
        show(1_000, 0.5)
        drawn = capsys.readouterr().err
        assert "50%" in drawn
        assert "1,000 samples, 100/s, 10 s left" in drawn
    assert capsys.readouterr().err == "\r\x1b[K"


def test_cells_are_set_in_columns() -> None:
    assert aligned_rows([["a", "1.5"], ["long", "10"]], right=(1,)) == ["a     1.5", "long   10"]


def test_two_motors_of_one_freedom_share_its_power(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In a parallelogram the elbow turns back what the drive turns: their difference is the effort of one."""
    time = np.linspace(0.0, 1.0, 60)
    angle = 0.5 + 0.2 * np.sin(5 * time)
    efforts = []
    for motors, sides in (("drive,elbow", (1, -1)), ("drive", (1,))):
        names = [f"{name}/position" for name in motors.split(",")]
        table = np.column_stack([time, *(side * angle for side in sides)])
        file = save(tmp_path, table_text(["time", *names], table), f"{motors}.csv")
        robot = ROOT / "benchmarks" / "robots" / "parallelogram.urdf"
        out = call(capsys, "idm", robot, file, "--motors", motors).out
        rows = np.loadtxt(out.splitlines(), delimiter=",", skiprows=1)
        efforts.append(rows[:, 1 : 1 + len(sides)] @ sides)
    np.testing.assert_allclose(*efforts, rtol=1e-8)
