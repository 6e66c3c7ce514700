"""`hybridyn ros`: run the node of ROS 2."""

from collections.abc import Sequence
from dataclasses import replace

from ..errors import required
from ..structure.robot import HybridRobot
from .common.options import RobotChoice


def run(load: RobotChoice, joints: Sequence[str] | None, rate: float, ros_args: Sequence[str]) -> None:
    """Run the node until it is interrupted."""
    required("rclpy", "ros", "hybridyn ros")
    from ..ros.node import run as run_node
    from ..ros.settings import RosSettings

    def loaded(file: str, motors: Sequence[str]) -> HybridRobot:
        """Load the robot of the parameters, with the options of the command."""
        return replace(load, robot=file, motors=tuple(motors) or load.motors)()

    run_node(loaded, RosSettings(load.robot or "", load.motors or (), joints or (), rate=rate), ros_args)
