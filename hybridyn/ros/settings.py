"""What the node is told, as parameters of ROS: by command line, by a file of parameters, or while it runs."""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor

from ..description.names import did_you_mean
from ..errors import ModelError

#: Parameters that may be set while the node runs.
CHANGEABLE = ("payload_mass", "payload_centre")
#: What a value is, by its kind and whether it is several.
FORMS = {
    (str, False): "a word",
    (str, True): "a list of names, as in [a, b]",
    (float, False): "a number",
    (float, True): "a list of three numbers, as in [0.0, 0.0, 0.1]",
    (bool, False): "true or false",
}
#: Beginnings of the names of parameters that ROS itself reads.
OF_ROS = ("use_sim_time", "start_type_description_service", "qos_overrides.")


@dataclass(frozen=True)
class RosSettings:
    """Parameters of the node; all but `CHANGEABLE` are read when it starts.

    Attributes:
        robot: The robot's file, or the name of a shipped robot; "" waits for the topic `robot_description`.
        motors: Names of the motors, instead of those in the files.
        joints: Names of the output joints, for trajectories.
        names: "driver's name=joint", for joints that the driver calls otherwise.
        rate: Highest rate of complete states [Hz]; 0 answers every message.
        effects: Names of the effects that count in efforts.
        trajectory_efforts: Whether trajectories of motors have efforts.
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
    trajectory_efforts: bool = False
    payload_link: str = ""
    payload_mass: float = 0.0
    payload_centre: Sequence[float] = (0.0, 0.0, 0.0)

    @property
    def renamed(self) -> dict[str, str]:
        """The robot's joint by the driver's name.

        Raises:
            ModelError: An entry of `names` is not of the form NAME=JOINT, or a name stands twice.
        """
        pairs = [one.partition("=") for one in self.names]
        if wrong := ["".join(pair) for pair in pairs if not all(pair)]:
            raise ModelError(f"parameter 'names': '{wrong[0]}' is not of the form NAME=JOINT")
        for side in (0, 2):
            told = [pair[side] for pair in pairs]
            if twice := [name for name in told if told.count(name) > 1]:
                raise ModelError(f"parameter 'names': '{twice[0]}' stands twice on one side of '='")
        return {name: joint for name, _, joint in pairs}


def declared(node: Any, settings: RosSettings) -> RosSettings:
    """Declare the parameters of a node, and return their values.

    Args:
        node: The node.
        settings: The values of parameters that ROS does not give.

    Raises:
        ModelError: A value is of another kind, or no rate.
    """
    found = asdict(settings)
    for name in node._parameter_overrides:  # what was given; no public name of rclpy lists it
        if name not in found and not name.startswith(OF_ROS):
            node.get_logger().warning(f"parameter '{name}' is not read{did_you_mean(name, found)}")
    for name, value in found.items():
        told = ParameterDescriptor(dynamic_typing=True, read_only=name not in CHANGEABLE)
        usual = list(value) if isinstance(value, tuple | list) else value
        node.declare_parameter(name, None if usual == [] else usual, told)  # ROS has no type of an empty list
        if (given := node.get_parameter(name).value) is not None:
            found[name] = checked(name, given)
    if not 0 <= found["rate"] < float("inf"):
        raise ModelError(f"parameter 'rate' is {found['rate']}; it is states a second, or 0 for all of them")
    return replace(settings, **found)


def checked(name: str, value: Any) -> Any:
    """Return the value of a parameter as the node uses it: whole numbers count as numbers.

    Args:
        name: The parameter.
        value: What ROS gives.

    Raises:
        ModelError: It is of another kind.
    """
    usual = getattr(RosSettings, name)
    several = isinstance(usual, tuple)
    kind = type((*usual, "")[0] if several else usual)
    given = list(value) if isinstance(value, list | tuple | array) else [value]
    if kind is float:
        given = [float(x) if type(x) is int else x for x in given]
    fits = several is isinstance(value, list | tuple | array) and all(type(x) is kind for x in given)
    if not fits or (several and kind is float and len(given) != len(usual)):
        raise ModelError(f"parameter '{name}' is {value!r}; it is {FORMS[kind, several]}")
    return given if several else given[0]
