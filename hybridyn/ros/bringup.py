"""Files that show a robot with loops in RViz: its tree as URDF, parameters, a launch file, a view.

In the tree loops are cut, every joint may move, and each has one number. Only what URDF knows is written. A
second URDF, in which only motors move, gives the sliders of joint_state_publisher_gui.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from ..assembly.posture import positions_of
from ..conversion.parts import in_parts, without_screws
from ..conversion.request import ConversionRequest, Losses
from ..conversion.shapes import read_shapes
from ..conversion.target_files import MARK
from ..conversion.urdf import write_urdf
from ..description.records import Description
from ..description.shape_files import Shape
from ..description.writing import write_text
from ..errors import ModelError
from ..joints.kinds import JointKind
from ..structure.robot import HybridRobot
from .joint_numbers import check_names

TREE, MOTORS, PARAMETERS, VIEW = "robot.urdf", "motors.urdf", "parameters.yaml", "robot.rviz"
LAUNCH = '''"""Show '{name}' in RViz, with sliders for its motors: ros2 launch {file}."""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import ExecuteProcess
from launch_ros.actions import Node

HERE = Path(__file__).resolve().parent
PARAMETERS = str(HERE / "parameters.yaml")


def generate_launch_description():
    tree = (HERE / "robot.urdf").read_text()
    return LaunchDescription([
        ExecuteProcess(cmd={command} + ["--ros-args", "--params-file", PARAMETERS], output="screen"),
        Node(
            package="robot_state_publisher", executable="robot_state_publisher",
            parameters=[{{"robot_description": tree}}],
        ),
        Node(
            package="joint_state_publisher_gui", executable="joint_state_publisher_gui",
            arguments=[str(HERE / "motors.urdf")], parameters=[PARAMETERS],
            remappings=[("joint_states", "motor_states"), ("robot_description", "motors_description")],
        ),
        Node(package="rviz2", executable="rviz2", arguments=["-d", str(HERE / "robot.rviz")]),
    ])
'''


def write_bringup(
    robot: HybridRobot, source: str, folder: str | Path, *, outputs: Sequence[str] = (),
    xacro_args: Mapping[str, str] | None = None, package_dirs: Sequence[str] = (),
) -> tuple[list[Path], tuple[str, ...]]:  # fmt: skip
    """Write the files into a folder, which is made where it is missing.

    Args:
        robot: The robot.
        source: The file that it was loaded from, or the name of a shipped robot.
        folder: The folder.
        outputs: Output joints of the node.
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `package://` searches.

    Returns:
        The written files, and what the tree cannot say.

    Raises:
        ModelError: A file there is not from convert.
        TrajectoryError: An output is no joint.
    """
    check_names(outputs, robot.joint_index)
    folder, losses = Path(folder), Losses()
    tree = _tree(robot.description, losses)
    shapes = tuple(
        replace(shape, file=shape.path.resolve().as_uri()) if shape.path else shape
        for shape in read_shapes(robot.description, folder / TREE, xacro_args or {}, package_dirs, losses)
    )
    fixed = [x if x.name in robot.motors else replace(x, kind=JointKind.FIXED) for x in tree.joints]
    options = [word for name, value in (xacro_args or {}).items() for word in ("--xacro", f"{name}:={value}")]
    options += [word for one in package_dirs for word in ("--package-dir", str(Path(one).resolve()))]
    command = ["hybridyn", "ros", *options]
    texts = {
        TREE: _urdf(tree, shapes, losses),
        MOTORS: _urdf(replace(tree, joints=tuple(fixed)), (), Losses()),
        PARAMETERS: _parameters(robot, source, outputs),
        "robot.launch.py": LAUNCH.format(name=robot.name, file="robot.launch.py", command=command),
        VIEW: yaml.safe_dump(_view(tree.root)),
    }
    for name in texts:
        if (folder / name).exists() and MARK not in (folder / name).read_text():
            raise ModelError("exists and is not from convert; move it away", file=str(folder / name))
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        mark = f"<!-- {MARK} -->" if name.endswith(".urdf") else f"# {MARK}"
        write_text(folder / name, f"{text}{mark}\n")
    return [folder / name for name in texts], losses.lines()


def _tree(d: Description, losses: Losses) -> Description:
    """Return a robot without loops, whose joints have one number each."""
    for kinds in ({JointKind.PLANAR, JointKind.FLOATING}, {JointKind.SPHERICAL}):
        d = in_parts(d, losses, kinds, lambda _: None)
    d = without_screws(d, losses)
    plain = (replace(joint, rotor_inertia=0.0, gear_ratio=1.0) for joint in d.joints)
    return replace(d, joints=tuple(plain), closures=(), couplings=(), motors=(), effects=())


def _urdf(d: Description, shapes: tuple[Shape, ...], losses: Losses) -> str:
    """Return the text of a tree."""
    return write_urdf(ConversionRequest(d, Path(TREE), shapes), losses).text


def _parameters(robot: HybridRobot, source: str, outputs: Sequence[str]) -> str:
    """Return the parameters of the node, and those of the sliders: where they begin."""
    file = str(Path(source).resolve()) if Path(source).exists() else source
    node: dict[str, Any] = {"robot": file, "motors": list(robot.motors)}
    if outputs:
        node["joints"] = list(outputs)
    home = positions_of(robot, robot.home[None], robot.motors)[0]
    zeros = {name: float(x) for name, x in zip(robot.motors, home, strict=True)}
    return yaml.safe_dump(
        {
            "hybridyn": {"ros__parameters": node},
            "joint_state_publisher": {"ros__parameters": {"zeros": zeros}},
        },
        sort_keys=False,
    )


def _view(root: str) -> dict[str, Any]:
    """Return the configuration of RViz: the robot, and the frames of its links."""
    topic = {"Value": "/robot_description"}
    shown = {
        "Class": "rviz_default_plugins/RobotModel", "Name": "RobotModel", "Enabled": True,
        "Description Source": "Topic", "Description Topic": topic,
    }  # fmt: skip
    frames = {"Class": "rviz_default_plugins/TF", "Name": "TF", "Enabled": True}
    grid = {"Class": "rviz_default_plugins/Grid", "Name": "Grid", "Enabled": True}
    return {
        "Visualization Manager": {
            "Class": "",
            "Displays": [grid, shown, frames],
            "Global Options": {"Fixed Frame": root},
            "Tools": [{"Class": "rviz_default_plugins/MoveCamera"}],
            "Views": {"Current": {"Class": "rviz_default_plugins/Orbit", "Distance": 2.0}},
        }
    }
