"""The map between motors and joints in exported C, and the example of a transmission of ros2_control."""

import ctypes
import re
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.exporting import export
from tests import ROOT
from tests.compiled.ros2_control import HANDLES, HEADERS, PROGRAM
from tests.compiled.test_export import STRICT, called, compiler, run_test
from tests.dynamics.test_idm import flat_five_bar
from tests.quantities.ankle import JOINTS, MOTORS, ankle, ankle_text, leg
from tests.support.command_line import call
from tests.support.comparing import SOLVED, close_to, refused

PACKAGE = ROOT / "docs/examples/ros2_control"
NAME = "ankle_transmission"
GEAR, LEVER, SHIFT = 20.0, 4.0, 0.1
#: Actuators and joints in another order than the robot's, by other names.
PORTS = (
    ("actuator", "b_actuator", "motor_left", GEAR, SHIFT),
    ("actuator", "a_actuator", "motor_right", 1.0, 0.0),
    ("joint", "z_roll", "roll", LEVER, 0.0),
    ("joint", "pitch", "pitch", 1.0, SHIFT),
)
CPP = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"]
HANDLE = "transmission_interface/handle.hpp"
TARGETS = np.array([[0.1, -0.2], [0.3, 0.15], [-0.4, 0.1]])
needs_cpp = pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler")


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Export the ankle's transmission, and build it with a minimal stand-in of ros2_control's headers."""
    folder = tmp_path_factory.mktemp("ros2")
    export(ankle(folder), folder / "ankle_c", map_joints=JOINTS)
    for file, text in {**HEADERS, HANDLE: HANDLES["own"]}.items():
        (folder / file).parent.mkdir(exist_ok=True)
        (folder / file).write_text(text)
    (folder / "main.cpp").write_text(PROGRAM)
    include = [f"-I{at}" for at in (folder, folder / "ankle_c", PACKAGE / "include")]
    ankle_c = folder / "ankle_c" / "ankle.c"
    parts = PACKAGE / "src" / f"{NAME}.cpp", folder / "main.cpp", folder / "ankle.o"
    assert compiler(*STRICT, *include, "-c", ankle_c, "-o", parts[-1]) == ""
    assert compiler(*include, *parts, "-lm", "-o", folder / "main", program=CPP) == ""
    return folder


def test_the_stand_in_has_the_signatures_that_the_readme_lists() -> None:
    rows = re.findall(
        r"^\| `(.+?)` \| `(virtual .+?;)` \|", (PACKAGE / "README.md").read_text(), re.MULTILINE
    )
    assert len(rows) == 6
    for header, signature in rows:
        assert signature in HEADERS[header]
    listed = {signature for _, signature in rows}
    for header in {header for header, _ in rows}:  # and no other ones
        assert {
            x.strip() for x in HEADERS[header].splitlines() if x.endswith(") = 0;") or "const = 0" in x
        } <= listed


def told(built: Path, *lines: str) -> list[str]:
    """Return what the program prints to a plan whose first lines are the ports."""
    ports = [" ".join(map(str, port)) for port in PORTS]
    done = subprocess.run([built / "main"], input="\n".join([*ports, *lines]), capture_output=True, text=True)
    assert done.returncode == 0
    return done.stdout.splitlines()


def numbers(line: str) -> np.ndarray:
    return np.array(line.split(), dtype=float).reshape(-1, 2)


def outside(joints: np.ndarray) -> np.ndarray:
    """Return positions, rates and efforts of (pitch, roll) as the handles (roll, pitch) have them."""
    return joints[:, ::-1] * [[1 / LEVER, 1], [1 / LEVER, 1], [LEVER, 1]] + [[0, SHIFT], [0, 0], [0, 0]]


def shown(word: str, values: Iterable[np.ndarray]) -> str:
    return " ".join([word, *(repr(float(x)) for part in values for x in part)])


@pytest.mark.slow
def test_the_map_in_c_follows_from_another_posture(tmp_path: Path) -> None:
    """A few Newton steps from home lead to the numbers of the general path, both ways."""
    robot = ankle(tmp_path)
    export(robot, tmp_path, map_joints=JOINTS)
    source, library = tmp_path / "ankle.c", tmp_path / "ankle.so"
    assert compiler(*STRICT, "-fPIC", "-shared", source, "-o", library, "-lm") == ""
    loaded = ctypes.CDLL(str(library))
    found = hybridyn.joint_map(robot, {"pitch": 0.1, "roll": -0.2}, JOINTS)
    rates, efforts = np.random.default_rng(0).normal(size=(2, 2))
    sides = {
        "joints": (found.motor_positions, found.joint_positions, found.joints_per_motors,
                   found.joint_rates(rates), found.joint_efforts(efforts)),
        "motors": (found.joint_positions, found.motor_positions, found.motors_per_joints,
                   found.motor_rates(rates), found.motor_efforts(efforts)),
    }  # fmt: skip
    for side, (given, wanted, matrix, other_rates, other_efforts) in sides.items():
        near, work = robot.home.copy(), np.zeros(1000)
        q, position, rate, effort, rows = np.zeros(8), *np.zeros((3, 2)), np.zeros((2, 2))
        arrays = near, given, rates, efforts, q, position, rate, effort, rows, work
        guards = []
        for _ in range(6):
            guards.append(called(getattr(loaded, f"ankle_map_to_{side}"), *arrays))
            near[:] = q
        assert guards[0] > 1.0 >= guards[-1]
        close_to(
            (q, position, rate, effort, rows), (found.q, wanted, other_rates, other_efforts, matrix), SOLVED
        )


@pytest.mark.slow
@needs_cpp
def test_a_transmission_maps_positions_velocities_and_efforts(built: Path, tmp_path: Path) -> None:
    """Far targets are followed step by step; gears, offsets and the order of names are as the URDF states."""
    robot, rng = ankle(tmp_path), np.random.default_rng(0)
    gear, shift = np.array([GEAR, 1.0]), np.array([SHIFT, 0.0])
    lines, expected = ["handles position velocity effort", "configure"], []
    for pitch, roll in TARGETS:
        found = hybridyn.joint_map(robot, {"pitch": pitch, "roll": roll}, JOINTS)
        rates, efforts = rng.normal(size=(2, 2))  # of the motors
        driven = [(found.motor_positions - shift) * gear, rates * gear, efforts / gear]
        lines.append(shown("to_joints", driven))
        expected.append(
            outside(np.array([(pitch, roll), found.joint_rates(rates), found.joint_efforts(efforts)]))
        )
        rates, efforts = rng.normal(size=(2, 2))  # of the joints
        lines.append(shown("to_actuators", outside(np.array([(pitch, roll), rates, efforts]))))
        motors = found.motor_positions, found.motor_rates(rates), found.motor_efforts(efforts)
        expected.append(np.array([(motors[0] - shift) * gear, motors[1] * gear, motors[2] / gear]))
    answers = told(built, *lines)
    assert answers[0] == "2 2"
    for answer, values in zip(answers[1:], expected, strict=True):
        close_to(numbers(answer), values, SOLVED)


@pytest.mark.slow
@needs_cpp
@pytest.mark.parametrize("release", ["hardware", "read_write"])
def test_it_builds_with_the_handles_of_other_releases(built: Path, tmp_path: Path, release: str) -> None:
    (tmp_path / HANDLE).parent.mkdir()
    (tmp_path / HANDLE).write_text(HANDLES[release])
    include = [tmp_path, built, built / "ankle_c", PACKAGE / "include"]
    for source in (PACKAGE / "src" / f"{NAME}.cpp", built / "main.cpp"):
        words = "-Wno-deprecated-declarations", "-fsyntax-only", *(f"-I{at}" for at in include), source
        assert compiler(*words, program=CPP) == ""


@pytest.mark.slow
@needs_cpp
def test_what_cannot_be_closed_is_nan_and_the_next_posture_is_not(built: Path) -> None:
    plan = ["handles position effort", "configure"]
    asked = [(-0.05, 0.1), (0.0, 2.9), (float("nan"), 0.0), (1e9, 0.0), (-0.05, 0.1)]
    plan += [shown("to_actuators", [at, (1.0, 2.0)]) for at in asked]
    good, *bad, again = [numbers(line) for line in told(built, *plan)[1:]]
    assert np.isfinite(good).all()
    assert all(np.isnan(values).all() for values in bad)
    close_to(again, good, SOLVED)


@pytest.mark.slow
@needs_cpp
def test_handles_that_are_missing_are_named(built: Path) -> None:
    answers = told(
        built, "handles effort", "configure", "handles position", "actuator more x 1 0", "configure"
    )
    assert answers[0].startswith("no handles of positions: velocities and efforts of closed loops depend on")
    assert answers[1].startswith("the transmission needs 'motor_left' by its name or role, with a reduction")


def test_the_package_is_one_that_ros2_reads(tmp_path: Path) -> None:
    """Its files name the same package, and its sizes and places are those of the robot."""
    package = ElementTree.parse(PACKAGE / "package.xml").getroot()
    assert package.findtext("name") == NAME
    assert "transmission_interface" in [tag.text for tag in package.findall("depend")]
    library = ElementTree.parse(PACKAGE / f"{NAME}.xml").getroot()
    kind = library[0].attrib
    assert kind["base_class_type"] == "transmission_interface::TransmissionLoader"
    source = (PACKAGE / "src" / f"{NAME}.cpp").read_text()
    assert f"PLUGINLIB_EXPORT_CLASS({kind['type']}," in source
    assert f"file(transmission_interface {NAME}.xml)" in (PACKAGE / "CMakeLists.txt").read_text()
    robot = hybridyn.load(PACKAGE / "ankle.urdf", motors=MOTORS)
    close_to(robot.home, ankle(tmp_path).home, SOLVED)
    sizes = f"JOINT_COUNT = {len(JOINTS)}, MOTOR_COUNT = {len(MOTORS)}, POSTURE_SIZE = {robot.nq};"
    assert sizes in (PACKAGE / "include" / NAME / f"{NAME}.hpp").read_text()
    for joint in (*JOINTS, *MOTORS):
        assert f'{{"{joint}", {robot.q_slices[robot.joint_index[joint]].start}, false, 0.1}}' in source


def test_joints_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    robot = ankle(tmp_path)
    for asked, error, words in (
        (
            lambda: export(robot, tmp_path / "made", map_joints=["pitch"]),
            hybridyn.SingularityError,
            "1 chosen joints for 2 freedoms leave the motion of",
        ),
        (
            lambda: export(robot, tmp_path / "made", name="a b", map_joints=JOINTS),
            hybridyn.ModelError,
            "'a b' is not a C identifier",
        ),
    ):
        refused(asked, error, words)
    assert not (tmp_path / "made").exists()


@pytest.mark.slow
@pytest.mark.parametrize("robot", ["leg", "five_bar"])
def test_the_exported_test_judges_the_map(tmp_path: Path, robot: str) -> None:
    """Other modules keep their positions; the five-bar's joints turn without end."""
    loaded = leg(tmp_path) if robot == "leg" else flat_five_bar()[0]
    joints = JOINTS if robot == "leg" else ["left_elbow", "right_elbow"]
    export(loaded, tmp_path / "made", name="machine", map_joints=joints)
    printed = run_test(tmp_path / "made", "machine")
    assert printed.count("map_to_joints") == printed.count("map_to_motors") == 5


@pytest.mark.slow
def test_the_command_line_exports_the_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "ankle.urdf"
    file.write_text(ankle_text())
    words = [
        "convert",
        file,
        "--c",
        "--motors",
        ",".join(MOTORS),
        "--map",
        ",".join(JOINTS),
        "-o",
        tmp_path / "made",
    ]
    assert call(capsys, *words).status == 0
    header = (tmp_path / "made" / "ankle.h").read_text()
    assert "joint_position, joint_rate, joint_effort\n     0  pitch\n     1  roll" in header
    run_test(tmp_path / "made", "ankle")
