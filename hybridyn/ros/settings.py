"""What the node is told, as parameters of ROS: by command line, by a file of parameters, or while it runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.parameter import Parameter

from ..errors import ModelError


@dataclass(frozen=True)
class RosSettings:
    """Parameters of the node; all but the payload's mass and centre are read when it starts.

    Attributes:
        robot: The robot's file, or the name of a shipped robot; "" waits for the topic `robot_description`.
        motors: Names of the motors, instead of those in the files.
        joints: Names of the output joints, for trajectories.
        names: "driver's name=joint", for joints that the driver calls otherwise.
        rate: Highest rate of complete states [Hz]; 0 answers every message.
        effects: Names of the effects that count in efforts.
        payload_link: Link that carries the payload.
        payload_mass: Mass of the payload [kg].
        payload_centre: Its centre of mass in the frame of its link, three numbers [m].
    """

    robot: str = ""
    motors: Sequence[str] = ()
    joints: Sequence[str] = ()
    names: Sequence[str] = ()
    rate: float = 0.0
    effects: Sequence[str] = ("default",)
    payload_link: str = ""
    payload_mass: float = 0.0
    payload_centre: Sequence[float] = (0.0, 0.0, 0.0)

    @property
    def renamed(self) -> dict[str, str]:
        """The robot's joint by the driver's name.

        Raises:
            ModelError: An entry of `names` is not of the form NAME=JOINT.
        """
        pairs = [one.partition("=") for one in self.names]
        if wrong := ["".join(pair) for pair in pairs if not all(pair)]:
            raise ModelError(f"parameter 'names': '{wrong[0]}' is not of the form NAME=JOINT")
        return {name: joint for name, _, joint in pairs}


def declared(node: Any, settings: RosSettings) -> RosSettings:
    """Declare the parameters of a node, and return their values.

    Args:
        node: The node.
        settings: The values of parameters that ROS does not give.
    """
    found = {}
    for name, value in asdict(settings).items():
        several, numbers = not isinstance(value, str | float), name == "payload_centre"
        kind = Parameter.Type.DOUBLE_ARRAY if numbers else Parameter.Type.STRING_ARRAY
        fixed = ParameterDescriptor(read_only=name not in ("payload_mass", "payload_centre"))
        node.declare_parameter(name, kind if several and not value else _plain(value), fixed)
        given = node.get_parameter_or(name, Parameter(name, value=_plain(value)) if value else None)
        found[name] = value if given is None or given.value is None else given.value
    return replace(settings, **found)


def _plain(value: Any) -> Any:
    """Return a value as ROS has it: lists in place of tuples."""
    return value if isinstance(value, str | float) else list(value)
