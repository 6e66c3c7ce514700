"""`hybridyn ddm`: efforts in, accelerations out; reactions of both models; motions without a motor."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.tables.opening import open_table
from hybridyn.tables.signals import TWIST, WRENCH
from tests import ROOT
from tests.support.command_line import read_table, table_text
from tests.support.comparing import SOLVED, close_to
from tests.support.files import save

ROUND_TRIP = 1e-9  # two solutions of the loops and of the inertia, relative to the largest acceleration
FIVE_BAR = ROOT / "urdf/five_bar.urdf.xacro"
RPS3 = ROOT / "urdf/rps3.urdf.xacro"


class FiveBar:
    """The five-bar along the first rows of its own trajectory."""

    def __init__(self, count: int = 20, **options: object) -> None:
        self.robot = hybridyn.load(FIVE_BAR)
        with open_table(ROOT / "models/five_bar/traj.csv") as table:
            rows = next(table.blocks).values[:: 1000 // count][:count]
        self.time = rows[:, 0]
        given = {name: tuple(rows[:, 1 + 3 * i : 4 + 3 * i].T) for i, name in enumerate(self.robot.motors)}
        self.q, self.v, self.a = hybridyn.assemble(self.robot, motors=given)
        self.tau = hybridyn.idm(self.robot, self.q, self.v, self.a)

    def columns(self, joints: tuple[str, ...]) -> tuple[list[str], np.ndarray]:
        """Return positions and velocities of joints, and the efforts."""
        at = [self.robot.joints.index(name) for name in joints]
        header = ["time", *(f"{name}/{rate}" for rate in ("position", "velocity") for name in joints)]
        header += [f"{name}/effort" for name in self.robot.motors]
        return header, np.column_stack([self.time, self.q[:, at], self.v[:, at], self.tau])


@pytest.fixture(scope="module")
def five_bar() -> FiveBar:
    return FiveBar()


@pytest.mark.parametrize("engine", ["general", "compiled"])
def test_a_joint_that_the_only_motor_leaves_open_is_given_in_the_table(
    run, tmp_path: Path, five_bar: FiveBar, engine: str
) -> None:
    """The motor on the right is off: the position of a passive elbow takes its place in the table."""
    left = ["m1_left_drive", "m1_left_elbow"]
    at = [five_bar.robot.joints.index(name) for name in left]
    header = ["time", *(f"{name}/{rate}" for rate in ("position", "velocity") for name in left)]
    rows = [five_bar.time, five_bar.q[:, at], five_bar.v[:, at], five_bar.tau[:, 0]]
    path = save(tmp_path, table_text([*header, f"{left[0]}/effort"], np.column_stack(rows)), "states.csv")
    table = read_table(run("ddm", FIVE_BAR, path, "--motors", left[0], "--engine", engine).out)
    robot = hybridyn.load(FIVE_BAR, motors=left[:1])
    wanted = hybridyn.ddm(robot, five_bar.q, five_bar.v, five_bar.tau[:, :1])
    close_to(np.column_stack([table[f"{name}/acceleration"] for name in robot.joints]), wanted, ROUND_TRIP)


@pytest.mark.parametrize("full", [True, False])
def test_a_five_bar_from_its_motors_or_its_full_state(run, tmp_path: Path, five_bar: FiveBar, full) -> None:
    joints = five_bar.robot.joints if full else five_bar.robot.motors
    path = save(tmp_path, table_text(*five_bar.columns(joints)), "states.csv")
    said = run("ddm", FIVE_BAR, path)
    table = read_table(said.out)
    assert list(table) == ["time", *(f"{name}/acceleration" for name in five_bar.robot.joints)]
    assert np.array_equal(table.pop("time"), five_bar.time)
    close_to(np.column_stack(list(table.values())), five_bar.a, ROUND_TRIP)
    peak = np.abs(five_bar.a[:, 0]).argmax()
    line = next(line for line in said.err.splitlines() if "m1_left_drive" in line).split()
    assert float(line[1]) == pytest.approx(five_bar.a[peak, 0], rel=1e-5)
    assert line[3:] == ["rad/s^2", f"{five_bar.time[peak]:.6g}", "s"]
    assert "worst closure residual" in said.err
    assert "spline" not in said.err


def test_the_table_of_the_inverse_model_may_come_back_with_its_efforts(run, tmp_path: Path) -> None:
    """Its accelerations are not read; its velocities could be missing."""
    source = ROOT / "models/five_bar/traj.csv"
    efforts = run("idm", FIVE_BAR, source, "-q")
    with open_table(source) as table:
        columns, rows = table.columns, next(table.blocks).values
    tau = read_table(efforts.out)
    tau.pop("time")
    path = tmp_path / "states.csv"
    keep = [i for i, name in enumerate(columns) if "velocity" not in name]
    for chosen, tolerance in ((list(range(len(columns))), ROUND_TRIP), (keep, 1e-3)):
        header = [*(columns[i] for i in chosen), *tau]
        path.write_text(table_text(header, np.column_stack([rows[:, chosen], *tau.values()])))
        said = run("ddm", FIVE_BAR, path)
        found = read_table(said.out)["m1_left_drive/acceleration"]
        close_to(found[50:-50], rows[50:-50, columns.index("m1_left_drive/acceleration")], tolerance)
        assert ("velocity of 'm1_left_drive'" in said.err) == (chosen is keep)
        assert "acceleration of" not in said.err


@pytest.mark.parametrize("base", ["moving", "floating"])
def test_bases_and_wrenches(run, tmp_path: Path, base) -> None:
    """From the library's arrays to the table's world axes and back."""
    robot = hybridyn.load(RPS3, base=base)
    rng = np.random.default_rng(5)
    pose = np.array(
        [0.3, -0.2, 1.0, *(np.array([0.1, -0.3, 0.2, 0.8]) / np.linalg.norm([0.1, -0.3, 0.2, 0.8]))]
    )
    twist, acceleration = rng.normal(size=(2, 6))
    root, link = robot.description.root, robot.modules[-1].outputs[0]
    motors = {name: (0.02 * i, 0.1 * i) for i, name in enumerate(robot.motors)}
    q, v, a = hybridyn.assemble(robot, motors=motors, platforms={root: (pose, twist, acceleration)})
    tau, wrench = rng.normal(size=(2, 6))
    tau = 50.0 * tau[: len(robot.motors)]
    given = {"base_acceleration": a[:6]} if base == "moving" else {}
    expected = hybridyn.ddm(robot, q, v, tau, wrenches={link: wrench}, **given)
    header = [f"{root}/pose/{n}" for n in ("x", "y", "z", "qx", "qy", "qz", "qw")]
    header += [f"{root}/velocity/{n}" for n in TWIST]
    header += [f"{root}/acceleration/{n}" for n in TWIST] if base == "moving" else []
    header += [f"{name}/{rate}" for name in motors for rate in ("position", "velocity")]
    header += [f"{name}/effort" for name in motors] + [f"{link}/wrench/{n}" for n in WRENCH]
    values = [
        *pose,
        *twist,
        *(acceleration if base == "moving" else []),
        *np.ravel(list(motors.values())),
        *tau,
        *wrench,
    ]
    path = save(tmp_path, table_text(header, np.array([values])), "states.csv")
    said = run("ddm", RPS3, path, "--base", base)
    table = read_table(said.out)
    joints = np.array([table[f"{name}/acceleration"][0] for name in robot.joints[1:]])
    close_to(joints, expected[6:], SOLVED)
    if base == "moving":
        assert f"{root}/acceleration/x" not in table
        return
    # The inverse model of what came out needs the same efforts, and no wrench on the free base.
    world = np.array([table[f"{root}/acceleration/{n}"][0] for n in TWIST])
    _, _, back = hybridyn.assemble(
        robot,
        motors={n: (*motors[n], table[f"{n}/acceleration"][0]) for n in motors},
        platforms={root: (pose, twist, world)},
    )
    close_to(back, expected, SOLVED)


def without(columns: tuple[list[str], np.ndarray], name: str, instead: str | None = None):
    header, rows = columns
    at = header.index(name)
    if instead is not None:
        return [*header[:at], instead, *header[at + 1 :]], rows
    return header[:at] + header[at + 1 :], np.delete(rows, at, axis=1)


@pytest.mark.parametrize(
    ("name", "instead", "words"),
    [
        ("m1_left_drive/effort", None, ["column 'm1_left_drive/effort': is missing", "every motor"]),
        (
            "m1_left_drive/effort",
            "m1_left_driv/effort",
            ["column 'm1_left_driv/effort'", "mean 'm1_left_drive'"],
        ),
        ("m1_left_drive/effort", "m1_left_elbow/effort", ["column 'm1_left_elbow/effort'", "not driven"]),
        ("m1_left_drive/position", None, ["m1_left_drive/position"]),
    ],
)
def test_bad_headers(run, tmp_path: Path, five_bar: FiveBar, name, instead, words) -> None:
    path = save(
        tmp_path, table_text(*without(five_bar.columns(five_bar.robot.motors), name, instead)), "states.csv"
    )
    run("ddm", FIVE_BAR, path, status=1, says=[str(path), *words])


def test_states_that_do_not_close_name_file_row_and_closure(run, tmp_path: Path, five_bar: FiveBar) -> None:
    header, rows = five_bar.columns(five_bar.robot.joints)
    rows = rows.copy()
    rows[7, 1 + five_bar.robot.joints.index("m1_left_elbow")] += 1e-3
    path = save(tmp_path, table_text(header, rows), "states.csv")
    said = run("ddm", FIVE_BAR, path, "-o", tmp_path / "a.csv", "--reactions", tmp_path / "b.csv", status=1)
    assert said.err.startswith(
        f"error: {path}, row 8 (t = {rows[7, 0]:.6g} s): module 'm1_right_lower': closure '"
    )
    assert [entry.name for entry in tmp_path.iterdir()] == ["states.csv"]


@pytest.mark.parametrize("command", ["idm", "ddm"])
def test_motors_alone_do_not_say_how_passive_joints_move(run, tmp_path: Path, five_bar, command) -> None:
    header, rows = five_bar.columns(("m1_left_drive",))
    header, rows = without((header, rows), "m1_right_drive/effort")
    if command == "idm":
        header, rows = without((header, rows), "m1_left_drive/effort")
        afloat = [ROOT / "models/five_bar/traj.csv", "--base", "floating", "--passive", "solved"]
        run("idm", FIVE_BAR, *afloat, status=1, says=["m1_base/pose/x", "hybridyn simulate"])
    path = save(tmp_path, table_text(header, rows), "motors.csv")
    options = ["--passive", "solved"] if command == "idm" else []
    words = [FIVE_BAR, path, "--motors", "m1_left_drive", *options, "-o", tmp_path / "out.csv"]
    run(command, *words, status=1, says=(str(path), "hybridyn simulate", "every joint"))


def test_motions_without_a_motor_are_named(run, tmp_path: Path, five_bar: FiveBar) -> None:
    header, rows = without(five_bar.columns(five_bar.robot.joints), "m1_right_drive/effort")
    path = save(tmp_path, table_text(header, rows), "states.csv")
    said = run("ddm", FIVE_BAR, path, "--motors", "m1_left_drive")
    assert "no motor drives the motion of joint m1_right" in said.err


# -------------------------------------------------------------------- reactions


def wrench(table: dict[str, np.ndarray], prefix: str) -> np.ndarray:
    return np.column_stack([table[f"{prefix}/{name}"] for name in WRENCH])


@pytest.mark.parametrize("command", ["idm", "ddm"])
def test_reactions_are_a_second_table(run, tmp_path: Path, five_bar: FiveBar, command) -> None:
    header, rows = five_bar.columns(five_bar.robot.joints)
    if command == "idm":
        header = [
            "time",
            *(f"{n}/{r}" for r in ("position", "velocity", "acceleration") for n in five_bar.robot.joints),
        ]
        rows = np.column_stack([five_bar.time, five_bar.q, five_bar.v, five_bar.a])
    path, target = tmp_path / "states.csv", tmp_path / "inner.csv"
    path.write_text(table_text(header, rows))
    said = run(command, FIVE_BAR, path, "--reactions", target)
    table = read_table(target.read_text())
    robot = five_bar.robot
    _, inner = hybridyn.idm(robot, five_bar.q, five_bar.v, five_bar.a, reactions=True)
    assert np.array_equal(table["time"], five_bar.time)
    close_to(wrench(table, "m1_base/reaction"), inner.base, ROUND_TRIP)
    for name in inner.modules:
        close_to(wrench(table, f"{name}/reaction"), inner.modules[name], ROUND_TRIP)
    for name in inner.closures:
        close_to(wrench(table, f"{name}/wrench"), inner.closures[name], ROUND_TRIP)
    for name in inner.joints:
        close_to(wrench(table, f"{name}/transmitted"), inner.joints[name], ROUND_TRIP)
    assert len(table) == 1 + 6 * (1 + len(inner.modules) + len(inner.closures) + len(inner.joints))
    assert "share 3 redundant rows" in said.err


def test_the_ground_carries_a_robot_at_rest(run, tmp_path: Path) -> None:
    """The weight, straight up, whatever the module: the sign and the frame of the base's wrench."""
    robot = hybridyn.load(RPS3)
    header = [f"{n}/{r}" for n in robot.motors for r in ("position", "velocity", "acceleration")]
    path, target = tmp_path / "rest.csv", tmp_path / "inner.csv"
    path.write_text(table_text(header, np.zeros((1, len(header)))))
    run("idm", RPS3, path, "--reactions", target)
    mass = sum(link.mass for link in robot.description.links)
    found = wrench(read_table(target.read_text()), f"{robot.description.root}/reaction")[0]
    assert found[:3] == pytest.approx([0.0, 0.0, 9.81 * mass], abs=1e-9 * 9.81 * mass)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-o", "{folder}/a.csv", "--reactions", "{folder}/a.csv"], "is written already"),
        (["--reactions", "{source}"], "would be replaced"),
        (["--reactions", "-"], "standard output"),
        (["--reactions", "{folder}/a.txt"], "ends in"),
    ],
)
def test_targets_that_cannot_be(run, tmp_path: Path, five_bar: FiveBar, words, message) -> None:
    path = save(tmp_path, table_text(*five_bar.columns(five_bar.robot.joints)), "states.csv")
    given = (word.format(folder=tmp_path, source=path) for word in words)
    run("ddm", FIVE_BAR, path, *given, status=2, says=message)
    assert [entry.name for entry in tmp_path.iterdir()] == ["states.csv"]
