"""The shipped robots: their files read, their loops close, their trajectories are what they claim to be."""

import importlib.util
import re
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest

from hybridyn import HybridRobot, closure_residual, idm
from hybridyn.description import Description, read
from hybridyn.errors import ModelError
from hybridyn.tables.columns import read_layout
from hybridyn.tables.opening import open_table
from tests import ROOT
from tests.oracle import Oracle
from tests.support.comparing import refused
from tests.support.samples import slow
from tests.tools import margins

CLOSED = 1e-12  # of the robot's length: home is computed in the xacro, so only rounding is left
INDEPENDENT = 1e-2  # reciprocal condition number of motors against free motions at home, lengths scaled
TRIANGLE = 1e-3  # slack of the triangle inequality against the least moment: rods have 1, thin plates 1e-2
WRITTEN = {"pose": 1e-11, "joint": 1e-5}  # digits in the table: 12 for poses, 6 for joints
SPECTRAL = {"pose": 1e-8, "joint": 1e-4}  # of the largest rate; derivatives of what is written
HARMONICS = {"pose": 60, "joint": 6}  # kept in those derivatives: waves have 5, quaternions a tail
POSES_CLOSE = 1e-11  # of a module's length: poses of 12 digits that a loop over-determines
THIN = 5  # of the rows are assembled one
MOVES = 0.05  # of a motor's range, at least
MARGIN_ROUNDING = 0.005  # margins are stated with two digits


class Facts(NamedTuple):
    """What is known of a robot beforehand."""

    motors: int
    mobility: int
    closures: int
    links: str  # how its links' names begin


ROBOTS = {
    "gough_stewart": Facts(6, 6, 5, "m1_"),
    "lx4": Facts(24, 24, 20, "m[1-4]_"),
    "rps3": Facts(3, 3, 2, "m1_"),
    "five_bar": Facts(2, 2, 1, "m1_"),
    "delta": Facts(3, 3, 5, "m1_"),
    "tanev": Facts(6, 6, 5, "m[12]_"),
    "stewart_ur5": Facts(12, 12, 5, "m1_|.*_link$|base|world|tool0"),
    "scara_delta": Facts(7, 7, 5, "scara_|m1_"),
    "snake": Facts(36, 36, 36, r"tail$|m\d+_"),
}
WITHOUT_RATES = {"rps3"}


def robot_file(name: str) -> Path:
    return ROOT / "urdf" / f"{name}.urdf.xacro"


@pytest.fixture(scope="module", params=[slow(name) if name == "snake" else name for name in ROBOTS])
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def robot(name: str) -> Description:
    return read(robot_file(name))


@pytest.fixture(scope="module")
def table(name: str) -> dict[str, np.ndarray]:
    path = ROOT / "models" / name / "traj.csv"
    with path.open(encoding="utf-8") as lines:
        header = lines.readline().strip().split(",")
        return dict(zip(header, np.loadtxt(lines, delimiter=",").T, strict=True))


def script(file: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(Path(file).stem, ROOT / "models" / file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def loaded(name: str) -> HybridRobot:
    robot = margins.load(name)
    assert isinstance(robot, HybridRobot)
    return robot


@pytest.fixture(scope="module")
def states(loaded: HybridRobot, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    q, v, a = margins.states(loaded, name, every=THIN)
    return q, v, a


def home(oracle: Oracle) -> np.ndarray:
    q = np.zeros(oracle.nq)
    for joint, value in oracle.description.home.items():
        q[oracle.coordinates[joint][1]] = value
    return q


def digits(column: str) -> str:
    return "joint" if column.count("/") == 1 else "pose"


def test_every_robot_of_the_folder_is_tested() -> None:
    assert {path.name.removesuffix(".urdf.xacro") for path in (ROOT / "urdf").glob("*.xacro")} == set(ROBOTS)
    assert {path.parent.name for path in (ROOT / "models").glob("*/model.toml")} == set(ROBOTS)


def test_counts_and_names(name: str, robot: Description) -> None:
    facts = ROBOTS[name]
    assert robot.name == name
    assert len(robot.motors) == facts.motors
    assert len(robot.closures) == facts.closures
    assert not robot.notes
    assert [link.name for link in robot.links if not re.match(facts.links, link.name)] == []


def test_inertias_are_physical(robot: Description) -> None:
    massive = [link for link in robot.links if link.mass > 0]
    assert len(massive) > ROBOTS[robot.name].motors
    for link in massive:
        moments = np.linalg.eigvalsh(link.inertia)
        assert moments[0] > 0, link.name
        assert moments[0] + moments[1] - moments[2] > TRIANGLE * moments[0], link.name
    assert all(not link.inertia.any() for link in robot.links if link.mass == 0)


def test_home_closes_every_loop_and_motors_drive_every_freedom_there(name: str, robot: Description) -> None:
    oracle = Oracle(robot)
    at_home = home(oracle)
    assert np.abs(oracle.residual(at_home)).max() < CLOSED * oracle.tree.length
    motions = oracle.motions(at_home)
    driven = (motions / oracle.unit[:, None])[oracle.motors]
    assert driven.shape == (ROBOTS[name].motors, ROBOTS[name].mobility)
    singular_values = np.linalg.svd(driven, compute_uv=False)
    assert singular_values[-1] > INDEPENDENT * singular_values[0]


def test_limits_hold_home_and_motors_alone_have_all_of_them_rotors_and_friction(robot: Description) -> None:
    """Rotors and friction are stated in the xacro, or in model.toml beside it."""
    for joint in robot.joints:
        if joint.name in robot.motors:
            assert 0 < joint.effort < np.inf, joint.name
            assert 0 < joint.velocity < np.inf, joint.name
        if joint.kind != "fixed":
            assert joint.lower < robot.home.get(joint.name, (0.0,))[0] < joint.upper, joint.name
        stated = (joint.rotor_inertia, joint.damping, joint.friction, abs(joint.gear_ratio - 1.0))
        assert (min(stated) > 0) == (max(stated) > 0) == (joint.name in robot.motors), joint.name


@pytest.mark.parametrize(("file", "argument", "count"), [("snake", "n", 3), ("lx4", "modules", 6)])
def test_number_of_modules_is_an_argument(file: str, argument: str, count: int) -> None:
    robot = read(robot_file(file), xacro_args={argument: count})
    oracle = Oracle(robot)
    per_module = ROBOTS[file].motors // {"snake": 12, "lx4": 4}[file]
    assert len(robot.motors) == per_module * count
    assert np.abs(oracle.residual(np.zeros(oracle.nq))).max() < CLOSED * oracle.tree.length


def test_arm_of_stewart_ur5_stands_on_the_platform() -> None:
    robot = read(robot_file("stewart_ur5"))
    mount = next(joint for joint in robot.joints if joint.child == "world")
    assert (mount.parent, mount.kind) == ("m1_platform", "fixed")
    assert robot.root == "m1_base"


def test_trajectory_has_a_known_header(name: str, robot: Description) -> None:
    path = ROOT / "models" / name / "traj.csv"
    with open_table(path) as rows:
        layout = read_layout(
            rows.columns, robot, motors=robot.motors, base="moving" if name == "snake" else "fixed"
        )
    assert layout.time == 0
    assert not layout.full_state


def test_trajectory_is_finite_and_long(table: dict[str, np.ndarray]) -> None:
    time = table["time"]
    assert time.size >= 1000
    assert np.all(np.diff(time) > 0)
    assert all(np.isfinite(column).all() for column in table.values())
    assert all(np.ptp(column) > 0 for key, column in table.items() if "/position" in key or "/pose/" in key)


def test_trajectory_is_what_the_script_writes(name: str, table: dict[str, np.ndarray]) -> None:
    written_by = script("make_trajectories.py")
    period, motion = written_by.MOTIONS[name]
    columns = motion(np.linspace(0.0, period, written_by.SAMPLES))
    assert ["time", *columns] == list(table)
    for key, values in columns.items():
        assert np.abs(table[key] - values).max() <= WRITTEN[digits(key)] * np.abs(values).max(), key


def derivative(values: np.ndarray, period: float, column: str) -> np.ndarray:
    """Differentiate one period of a smooth periodic function, exactly but for rounding."""
    spectrum = np.fft.rfft(values)
    spectrum[HARMONICS[digits(column)] :] = 0.0
    return np.fft.irfft(2j * np.pi / period * np.arange(spectrum.size) * spectrum, values.size)


def assert_rates(found: np.ndarray, expected: np.ndarray, key: str) -> None:
    assert np.abs(found - expected).max() < SPECTRAL[digits(key)] * np.abs(expected).max(), key


def test_rates_are_the_derivatives(name: str, table: dict[str, np.ndarray]) -> None:
    period = table["time"][-1]
    cut = {key: values[:-1] for key, values in table.items()}  # the last sample repeats the first
    pairs = [("position", "velocity"), ("velocity", "acceleration"), ("pose", "velocity")]
    compared = 0
    for key, values in cut.items():
        for lower, upper in pairs:
            rate = key.replace(f"/{lower}", f"/{upper}")
            if rate != key and rate in cut and not key.endswith(("/qx", "/qy", "/qz", "/qw")):
                assert_rates(cut[rate], derivative(values, period, key), key)
                compared += 1
    assert (compared == 0) == (name in WITHOUT_RATES)


def test_quaternions_turn_with_the_angular_velocity(table: dict[str, np.ndarray]) -> None:
    period = table["time"][-1]
    for key in [key for key in table if key.endswith("/pose/qw")]:
        link = key.removesuffix("/pose/qw")
        q = np.array([table[f"{link}/pose/{c}"][:-1] for c in ("qx", "qy", "qz", "qw")])
        assert np.abs(np.linalg.norm(q, axis=0) - 1.0).max() < WRITTEN["pose"]
        (x, w), (x_dot, w_dot) = (
            (p[:3], p[3]) for p in (q, np.array([derivative(component, period, key) for component in q]))
        )
        omega = 2.0 * (w * x_dot - w_dot * x - np.cross(x_dot, x, axis=0))  # 2 q_dot q*, fixed axes
        for i, axis in enumerate(("wx", "wy", "wz")):
            assert_rates(table[f"{link}/velocity/{axis}"][:-1], omega[i], key)


@pytest.mark.parametrize("count", ["0", "2.5"])
@pytest.mark.parametrize(("file", "argument"), [("snake", "n"), ("lx4", "modules")])
def test_wrong_number_of_modules_is_refused(file: str, argument: str, count: str) -> None:
    refused(
        lambda: read(robot_file(file), xacro_args={argument: count}),
        ModelError,
        f"{argument} must be a whole number, at least 1",
    )


def test_trajectory_closes_every_loop(loaded: HybridRobot, states: tuple[np.ndarray, ...]) -> None:
    assert loaded.mobility == ROBOTS[loaded.name].mobility
    assert np.abs(closure_residual(loaded, states[0])).max() < POSES_CLOSE


def test_trajectory_stays_within_limits(loaded: HybridRobot, states: tuple[np.ndarray, ...]) -> None:
    q, v, a = states
    tau = idm(loaded, q, v, a)
    for joint in loaded.description.joints:
        if joint.kind == "fixed":
            continue
        number = loaded.joints.index(joint.name)
        position, rate = q[:, loaded.q_slices[number]], v[:, loaded.v_slices[number]]
        assert joint.lower < position.min() <= position.max() < joint.upper, joint.name
        if joint.name in loaded.motors:
            assert np.ptp(position) > MOVES * (joint.upper - joint.lower), joint.name
            assert np.abs(rate).max() < joint.velocity, joint.name
            assert np.abs(tau[:, loaded.motors.index(joint.name)]).max() < joint.effort, joint.name


def test_singularity_margin_is_the_one_stated(name: str) -> None:
    """Few rows can only come out larger than the whole trajectory, for which `margins.py` takes a minute."""
    readme = (ROOT / "models" / name / "README.md").read_text(encoding="utf-8")
    (stated,) = re.findall(r"\*\*(0\.\d\d)\*\*", readme)
    found = margins.smallest_margin(name, every=200)
    assert float(stated) - MARGIN_ROUNDING < found < 1.25 * float(stated)
