"""Columns of a motion: of joints, motors and links."""

from __future__ import annotations

import re

from ...description.names import did_you_mean
from ...dynamics.link_motion import kinematics
from ...errors import TrajectoryError
from ...spatial import Array
from ...streams.postures import TreeSamples
from ...structure.robot import HybridRobot
from ...tables.signals import TWIST

#: Columns of a link; those of joints and motors have no component.
OF_LINK = re.compile(r"(?P<link>.+)/(?P<quantity>pose|velocity|acceleration)/(?P<component>\w+)")
_FORMS = (
    "columns are '<joint>/position|velocity|acceleration', '<motor>/effort|power', '<link>/pose/x|y|z' and "
    "'<link>/velocity|acceleration/x|y|z|wx|wy|wz'"
)


def column_of(robot: HybridRobot, block: TreeSamples, tau: Array, column: str) -> Array:
    """Return a column of the motion, shape (T,).

    Args:
        block: The postures.
        tau: Efforts of the motors, shape (T, motors).
        column: `<joint>/position|velocity|acceleration` of a joint with one freedom, `<motor>/effort|power`,
            or `<link>/pose|velocity|acceleration/...` in the world.

    Raises:
        TrajectoryError: There is no such column.
    """
    if match := OF_LINK.fullmatch(column):
        return _of_link(robot, block, match["link"], match["quantity"], match["component"])
    owner, _, quantity = column.rpartition("/")
    if quantity in ("effort", "power"):
        if owner not in robot.motors:
            raise _absent("motor", owner, robot.motors)
        effort: Array = tau[:, robot.motors.index(owner)]
        speed = block.v[:, robot.v_slices[robot.joint_index[owner]].start]
        return effort if quantity == "effort" else effort * speed
    quantities = {"position": (block.q, robot.q_slices), "velocity": (block.v, robot.v_slices),
                  "acceleration": (block.a, robot.v_slices)}  # fmt: skip
    if quantity not in quantities:
        raise TrajectoryError(f"'{column}' is not understood; {_FORMS}")
    if owner not in robot.joint_index:
        raise _absent("joint", owner, robot.joints)
    joint = robot.joint_index[owner]
    if not (robot.kinds[joint].additive if quantity == "position" else robot.kinds[joint].single):
        raise TrajectoryError(f"joint '{owner}' is {robot.kinds[joint]}, and has no single {quantity}")
    rows, places = quantities[quantity]
    return rows[:, places[joint].start]


def _of_link(robot: HybridRobot, block: TreeSamples, link: str, quantity: str, component: str) -> Array:
    """Return a coordinate of a link's origin, or a component of its rates, shape (T,), world axes."""
    known = TWIST[:3] if quantity == "pose" else TWIST
    if component not in known:
        raise TrajectoryError(f"'{link}/{quantity}/{component}' is not understood; {_FORMS}")
    motion = kinematics(robot, block.q, block.v, block.a, links=[link])[link]
    rows = {"pose": motion.pose, "velocity": motion.twist, "acceleration": motion.acceleration}[quantity]
    return rows[:, TWIST.index(component)]


def _absent(what: str, name: str, known: tuple[str, ...] | list[str]) -> TrajectoryError:
    return TrajectoryError(f"there is no {what} '{name}'{did_you_mean(name, known)}")
