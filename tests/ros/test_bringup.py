"""What `convert --ros` writes: a tree that closes at the node's states, and a launch file that runs."""

import shutil
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import yaml
from lxml import etree

import hybridyn
from hybridyn.cli import main
from hybridyn.description.shipped import find_robot
from hybridyn.ros.bringup import write_bringup
from hybridyn.ros.joint_numbers import RosJoints
from tests.ros.judge import open_by
from tests.support.files import save

#: What URDF has words for, of a tree that is shown.
KNOWN = {
    "robot", "link", "joint", "inertial", "origin", "mass", "inertia", "visual", "geometry", "box",
    "cylinder", "sphere", "mesh", "material", "color", "parent", "child", "axis", "limit", "dynamics",
}  # fmt: skip
MANY = """<robot name="many"><link name="base"/>
<link name="a"/><link name="b"/><link name="c"/><link name="tool"/>
<joint name="ball" type="spherical"><parent link="base"/><child link="a"/><origin xyz="0.1 0.2 0.3"/></joint>
<joint name="table" type="planar"><parent link="a"/><child link="b"/><origin rpy="0.3 0 0"/>
<axis xyz="0 0 1"/></joint>
<joint name="loose" type="floating"><parent link="b"/><child link="c"/></joint>
<joint name="wheel" type="continuous"><parent link="c"/><child link="tool"/><axis xyz="1 0 0"/></joint>
</robot>"""


@pytest.mark.parametrize("name", ["five_bar", "lx4"])
def test_the_tree_closes_at_closed_states(tmp_path: Path, name: str) -> None:
    assert main(["convert", name, "--ros", "-o", str(tmp_path / "out")]) == 0
    file = tmp_path / "out" / "robot.urdf"
    robot, tree = hybridyn.load(name), pin.buildModelFromUrdf(str(file))
    assert {one.tag for one in etree.parse(file).iter() if isinstance(one.tag, str)} <= KNOWN
    assert set(tree.names) - {"universe"} == set(robot.joints)
    q = hybridyn.assemble(robot, motors=robot.home[robot.motor_q] + 0.01, guess=robot.home)[0]
    joints = RosJoints(robot)
    assert open_by(robot, joints.names, joints.positions(q), tree) < 1e-12
    moving = pin.buildModelFromUrdf(str(tmp_path / "out" / "motors.urdf"))
    assert set(moving.names) - {"universe"} == set(robot.motors)


@pytest.mark.skipif(shutil.which("check_urdf") is None, reason="needs check_urdf, of urdfdom")
def test_urdfdom_finds_nothing_wrong(tmp_path: Path) -> None:
    write_bringup(hybridyn.load("five_bar"), "five_bar", tmp_path)
    done = subprocess.run(
        ["check_urdf", str(tmp_path / "robot.urdf")], capture_output=True, text=True, check=True
    )
    assert "Successfully Parsed XML" in done.stdout
    assert "Unknown" not in done.stdout + done.stderr


def test_joints_with_several_freedoms_are_chains(tmp_path: Path) -> None:
    file = save(tmp_path, MANY, "many.urdf")
    robot = hybridyn.load(file, motors=["wheel"])
    _, lost = write_bringup(robot, str(file), tmp_path / "out")
    tree = pin.buildModelFromUrdf(str(tmp_path / "out" / "robot.urdf"))
    joints = RosJoints(robot)
    assert set(tree.names) - {"universe"} == set(joints.names)
    assert any(line.startswith("spherical joints are three hinges: 'ball'") for line in lost)
    q = pin.normalize(robot.model, np.random.default_rng(0).uniform(-1, 1, robot.nq))
    at = dict(zip(joints.names, joints.positions(q), strict=True))
    x = np.concatenate(
        [
            [np.cos(at[name]), np.sin(at[name])] if joint.nq == 2 else [at[name]]
            for name, joint in zip(list(tree.names)[1:], list(tree.joints)[1:], strict=True)
        ]
    )
    places = []
    for model, posture in ((robot.model, q), (tree, x)):
        data = model.createData()
        pin.framesForwardKinematics(model, data, posture)
        places.append(data.oMf[model.getFrameId("tool", pin.BODY)].homogeneous)
    np.testing.assert_allclose(places[0], places[1], rtol=0, atol=1e-13)


def test_the_launch_file_starts_what_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With stand-ins of `launch`, which no index of packages has here."""
    words = ["convert", "five_bar", "--ros", "-o", str(tmp_path), "--map", "m1_left_elbow,m1_right_elbow"]
    assert main(words) == 0
    started: list[dict[str, Any]] = []
    modules = {
        name: ModuleType(name) for name in ("launch", "launch.actions", "launch_ros", "launch_ros.actions")
    }
    vars(modules["launch"])["LaunchDescription"] = list
    vars(modules["launch.actions"])["ExecuteProcess"] = lambda **words: started.append(words)
    vars(modules["launch_ros.actions"])["Node"] = lambda **words: started.append(words)
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    inside: dict[str, Any] = {"__file__": str(tmp_path / "robot.launch.py")}
    exec(Path(inside["__file__"]).read_text(), inside)
    inside["generate_launch_description"]()
    assert [one.get("package") for one in started] == [
        None, "robot_state_publisher", "joint_state_publisher_gui", "rviz2",
    ]  # fmt: skip
    command = started[0]["cmd"]
    assert command[:3] == ["hybridyn", "ros", "--ros-args"]
    told = yaml.safe_load(Path(command[-1]).read_text())["hybridyn"]["ros__parameters"]
    assert Path(told.pop("robot")).samefile(find_robot("five_bar"))
    assert told == {
        "motors": ["m1_left_drive", "m1_right_drive"],
        "joints": ["m1_left_elbow", "m1_right_elbow"],
    }  # fmt: skip
    assert etree.fromstring(started[1]["parameters"][0]["robot_description"]).tag == "robot"
    for words in (started[2]["arguments"], started[3]["arguments"][1:]):
        assert Path(words[0]).is_file()
    assert SimpleNamespace(**yaml.safe_load((tmp_path / "robot.rviz").read_text()))


def test_files_of_others_are_not_replaced(tmp_path: Path) -> None:
    save(tmp_path, "<robot/>", "robot.urdf")
    with pytest.raises(hybridyn.ModelError, match="exists and is not from convert"):
        write_bringup(hybridyn.load("five_bar"), "five_bar", tmp_path)
