"""Closed home postures: all that exist are found, and the chosen one is what the next load starts from."""

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.assemble import assemble_home
from hybridyn.cli.home import _name
from hybridyn.joints.kinds import JointKind
from hybridyn.structure.robot import positions
from hybridyn.studies.home import HomePosture, homes
from tests.robots.robot_texts import save
from tests.support.command_line import call
from tests.support.comparing import refused

#: Closed to rounding, relative to the module's length.
CLOSED = 1e-12
#: A posture against its own triangle [rad].
EXACT = 1e-9
#: So few starts find both triangles.
FEW = "--starts", 8

#: Two bars of lengths 3 and 4 (dm) whose tips meet at a distance of 5; open at zero.
TRIANGLE = """<robot name="triangle"><link name="ground"/>
<link name="left">
<inertial><mass value="1"/><origin xyz="0.1 0 0"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<link name="right">
<inertial><mass value="1"/><origin xyz="0.1 0 0"/><inertia ixx="1" iyy="1" izz="1"/></inertial></link>
<joint name="drive" type="prismatic"><parent link="ground"/><child link="rail"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="9" velocity="1"/></joint><link name="rail"/>
<joint name="a" type="continuous"><parent link="rail"/><child link="left"/><axis xyz="0 0 1"/></joint>
<joint name="b" type="revolute"><parent link="ground"/><child link="right"/>
<origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
<limit lower="-3.2" upper="0" effort="0" velocity="1"/></joint>
<loop name="tip" type="revolute"><predecessor link="left"><origin xyz="0.3 0 0"/></predecessor>
<successor link="right"><origin xyz="0.4 0 0"/></successor><axis xyz="0 0 1"/></loop>
<transmission name="t"><joint name="drive"/></transmission></robot>"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return save(tmp_path, TRIANGLE, "triangle.urdf")


def test_both_triangles_are_found(file: Path) -> None:
    robot = hybridyn.load(file)
    assert hybridyn.closure_residual(robot, robot.home) > 0.1
    found = homes(robot)
    assert len(found.postures) == 2
    for posture in found.postures:
        at = positions(robot, posture.q)
        assert at["drive"] == (0.0,)
        assert abs(abs(at["a"][0]) - np.arccos((9 + 25 - 16) / 30)) < EXACT
        assert posture.residual < CLOSED
        assert posture.within_limits == (at["b"][0] < 0)
        assert posture.distance == pytest.approx(max(abs(at["a"][0]), abs(at["b"][0])))
    (first, _) = homes(robot, {"drive": 0.1}).postures  # motors may stand elsewhere
    assert abs(abs(positions(robot, first.q)["a"][0]) - np.arccos((9 + 16 - 16) / 24)) < EXACT
    refused(
        lambda: homes(robot, {"driwe": 0.1}),
        hybridyn.TrajectoryError,
        r"unknown joint 'driwe' \(did you mean 'drive'\?\)",
    )


def free(kind: str, parent: str, child: str, axis: str = "0 0 1") -> str:
    """Return a joint without a motor."""
    return (
        f'<joint name="{parent}_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/><limit lower="-9" upper="9" effort="0" velocity="1"/></joint>'
    )


BALL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1"/></inertial>'
#: What stands below the triangle or on it, and moves freely: motions that no closure needs.
LOOSE = {
    "rails of a hopper": '<link name="earth"/><link name="rail_x"/>'
    + free("prismatic", "earth", "rail_x", "1 0 0")
    + free("prismatic", "rail_x", "ground", "0 1 0"),
    **{
        f"a {kind} base": free(kind, "earth", "ground") + '<link name="earth"/>'
        for kind in ("revolute", "continuous", "planar", "floating")
    },
    **{
        f"a {kind} load": free(kind, "left", "ball") + f'<link name="ball">{BALL}</link>'
        for kind in ("prismatic", "continuous", "planar", "floating")
    },
}  # fmt: skip


@pytest.mark.parametrize("case", LOOSE)
def test_what_no_closure_needs_stays_at_home(case: str, tmp_path: Path) -> None:
    file = save(tmp_path, TRIANGLE.replace("</robot>", LOOSE[case] + "</robot>"), "triangle.urdf")
    robot = hybridyn.load(file)
    home = positions(robot, robot.home)
    found = homes(robot, starts=8)
    assert len(found.postures) == 2
    for q in [one.q for one in found.postures] + [assemble_home(robot)]:
        at = positions(robot, q)
        assert {name for name, x in at.items() if x != home[name]} <= {"a", "b"}
        assert abs(abs(at["a"][0]) - np.arccos((9 + 25 - 16) / 30)) < EXACT
    hybridyn.convert(file, tmp_path / "closed.sdf")


def test_without_motors_a_joint_near_the_base_stays(file: Path) -> None:
    robot = hybridyn.load(file, motors=[])
    for q in [one.q for one in homes(robot).postures] + [assemble_home(robot)]:
        at = {name: x[0] for name, x in positions(robot, q).items()}
        assert at["b"] == 0.0
        assert abs(np.sin(at["a"])) < EXACT
        assert abs(at["drive"] + 0.3 * np.cos(at["a"]) - 0.9) < EXACT


def test_a_joint_without_a_motor_takes_the_place_of_a_motor(file: Path) -> None:
    robot = hybridyn.load(file)
    found = homes(robot, {"a": 0.5}).postures
    b = np.arcsin(0.3 * np.sin(0.5) / 0.4)
    drives = sorted(positions(robot, one.q)["drive"][0] for one in found)
    reach = 0.5 - 0.3 * np.cos(0.5)
    assert np.abs(drives - (reach + 0.4 * np.cos(b) * np.array([-1, 1]))).max() < EXACT
    assert {positions(robot, one.q)["a"] for one in found} == {(0.5,)}


def test_postures_are_named_by_the_farthest_joints() -> None:
    def posture(**distances: float) -> HomePosture:
        joint, distance = next(iter(distances.items()))
        return HomePosture(np.zeros(2), 0.0, True, joint, distance, 1, distances)

    postures = posture(a=0.0, b=0.0), posture(a=1.0, b=0.5), posture(a=1.0, b=0.2)
    robot = SimpleNamespace(kinds=(JointKind.REVOLUTE, JointKind.PRISMATIC), joint_index={"a": 0, "b": 1})
    names = ["home", "a 1 rad, b 0.5 m from home", "a 1 rad, b 0.2 m from home"]
    assert [_name(robot, one) for one in postures] == names  # type: ignore[arg-type]


def test_of_joints_that_are_equally_far_the_first_is_named() -> None:
    """Two joints of this mechanism flip by the same angle, which rounding must not order."""
    for found in homes(hybridyn.load("andrews"), starts=20).postures:
        (first, far), (second, near) = list(found.distances.items())[:2]
        assert far > near + 1e-6 or (first, second) in {("beta", "theta"), ("phi", "omega")}


def test_a_posture_is_printed_without_rounding_noise(capsys: pytest.CaptureFixture[str]) -> None:
    (_, *lines) = call(capsys, "home", "gough_stewart", "--starts", 5).out.splitlines()
    assert {float(line.split(" = ")[1]) for line in lines} == {0.0}


def test_a_written_posture_is_the_next_home(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    listed = call(capsys, "home", file, "--all", *FEW)
    assert "2 postures with the motors there, positions in m and rad" in listed.out
    assert re.match(r"1  . \d.* from home  (within|beyond) limits +closed to .*\n2  ", listed.out)
    model = file.with_name("triangle.model.toml")
    model.write_text(
        'motors = ["drive"]\n\n[home]\ndrive = 0.05  # old\n\n# rotors\n[joints.drive]\ndamping = 0.1\n'
    )
    for number in (1, 2):
        shown = call(capsys, "home", file, "--choose", number, *FEW)
        written = call(capsys, "home", file, "--choose", number, "--write", *FEW)
        assert written.out == ""
        text = model.read_text()
        assert shown.out in text
        assert text.startswith('motors = ["drive"]\n\n[home]\n')
        assert text.endswith("\n\n# rotors\n[joints.drive]\ndamping = 0.1\n")
        robot = hybridyn.load(file)
        assert hybridyn.closure_residual(robot, robot.home) < CLOSED


def test_a_model_file_is_made_where_there_is_none(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "home", file, "--write", "--at", "drive=0.1")
    robot = hybridyn.load(file)
    assert robot.description.home["drive"] == (0.1,)
    assert hybridyn.closure_residual(robot, robot.home) < CLOSED


def test_commands_say_where_they_start(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The posture of the triangle at home, both branches; nothing where home is zero."""
    table = save(tmp_path, "time,drive/position\n" + "".join(f"{t / 10},0\n" for t in range(8)), "drive.csv")
    assert "branch: " not in call(capsys, "info", file).out
    assert "[branch]" not in call(capsys, "info", file).out
    for number in (1, 2):
        call(capsys, "home", file, "--choose", number, "--write", *FEW)
        at = positions(robot := hybridyn.load(file), robot.home)
        angle = max(abs(at["a"][0]), abs(at["b"][0]))
        joint = "ab"[abs(at["b"][0]) == angle]
        far = f"in which '{joint}' is farthest from zero ({angle:.3g} rad)"
        line = f"assembly branch: that of the home posture, {far}"
        assert line in " ".join(call(capsys, "info", file).out.split())
        assert line in call(capsys, "idm", file, table).err


def test_every_command_says_that_home_is_open(
    file: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    table = save(tmp_path, "time,drive/position\n" + "".join(f"{t / 10},0\n" for t in range(8)), "drive.csv")
    commands = [("info",), ("home", *FEW), ("home", "--write", *FEW), ("idm", table), ("info",)]
    for number, (command, *words) in enumerate(commands):
        caplog.clear()
        call(capsys, command, file, *words)
        told = [text for text in caplog.messages if "are open at home" in text]
        assert len(told) == (number < 3), command
        assert all("module 'left'" in text and "limit 0.0001" in text for text in told), told


def test_a_posture_within_limits_is_written_unless_another_is_asked_for(
    file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call(capsys, "home", file, "--write")
    robot = hybridyn.load(file)
    assert positions(robot, robot.home)["b"][0] < 0


@pytest.mark.parametrize("text", ["home.drive = 0.1\n", "home = { drive = 0.1 }\n"])
def test_another_way_of_writing_home_is_not_replaced(
    text: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = file.with_name("triangle.model.toml")
    model.write_text(text)
    assert "cannot be replaced" in call(capsys, "home", file, "--write", status=1).err
    assert model.read_text() == text


@pytest.mark.parametrize(
    ("words", "status", "told"),
    [
        (["--choose", "3"], 1, "there is no posture 3: 2 postures found"),
        (["--at", "drive"], 2, "is not of the form NAME=NUMBER"),
        (["--at", "drive=9"], 1, "the loops do not close"),
    ],
)
def test_requests_that_cannot_be_met(
    words: list[str], status: int, told: str, file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call(capsys, "home", file, *words, status=status, says=told)
    assert not file.with_name("triangle.model.toml").exists()
