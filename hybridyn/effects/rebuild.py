"""`with_effects`: rebuild a robot for effects that change its structure."""

from ..errors import ModelError
from ..structure.bodies import Payload
from ..structure.building import rebuilt
from ..structure.robot import HybridRobot
from .catalogue import JOINTS
from .choice import Choice, Effects
from .inputs import BaseMotion
from .listing import listed_units
from .load_friction import LoadFriction


def with_effects(robot: HybridRobot, effects: Choice) -> HybridRobot:
    """Rebuild the robot for some effects, or return the same one if they do not change it.

    Payloads are added to their links (for all later calls). Joints with an effect are not cut from a wrist. A
    prescribed base adds a free-flyer at the beginning of q, v, a.

    Args:
        robot: The robot.
        effects: As in `hybridyn.idm`.

    Raises:
        ModelError: An effect or a link is unknown, or a floating base is prescribed.

    Example:
        >>> from hybridyn.effects import Payload
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.gravity(robot, robot.home).round(3)
        array([ 1.875, -1.875])
        >>> loaded = hybridyn.with_effects(robot, [Payload("m1_tool", 2.0)])
        >>> hybridyn.gravity(loaded, robot.home).round(3)
        array([ 4.43, -4.43])
    """
    if effects is None or isinstance(effects, Effects):
        return robot
    units = listed_units(robot, effects)
    joints = {name for unit in units if isinstance(unit, JOINTS) for name in unit.numbers(robot)}
    joints |= {name for unit in units if isinstance(unit, LoadFriction) for name in unit.joints}
    payloads = [unit for unit in units if isinstance(unit, Payload) and unit not in robot.payloads]
    held, base = robot.held | (joints & robot.cut_joints), robot.base
    if any(isinstance(unit, BaseMotion) for unit in units):
        if base == "floating":
            raise ModelError("base_motion: the robot's base floats; its motion cannot be prescribed")
        base = "moving"
    if held == robot.held and base == robot.base and not payloads:
        return robot
    description = robot.description
    for payload in payloads:
        description = payload.onto(description)
    return rebuilt(robot, description, base=base, held=held)
