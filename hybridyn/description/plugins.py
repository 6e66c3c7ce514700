"""Plugins of Gazebo in URDF and SDF: the welds and followers that they make, loops and forces.

A plugin is a program; its name and the names in it are all that a reader sees. One that welds two links or
makes a joint follow another is read. One that joins links in another way is refused. One that measures,
publishes, draws or controls motors (whose efforts are inputs) is harmless. Any other is dropped with a note.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from typing import NamedTuple

from .names import listed
from .urdf.xml_node import XmlNode

#: Words in the names of plugins that exert no force of their own.
HARMLESS = {
    "control", "controller", "controllers", "trajectory", "publisher", "broadcaster", "p3d", "f3d", "pose",
    "odometry", "camera", "depth", "kinect", "openni", "realsense", "image", "video", "laser", "lidar",
    "ray", "scan", "velodyne", "livox", "block", "imu", "gps", "gnss", "navsat", "altimeter",
    "magnetometer", "magnetic", "barometer", "pressure", "sonar", "ultrasonic", "ultrasound", "range",
    "sensor", "sensors", "bumper", "contact", "battery", "ft", "torque", "diff", "differential", "drive",
    "skid", "ackermann", "steering", "tricycle", "mecanum", "led", "light", "flashlight", "audio", "logger",
    "record", "recorder", "clock", "performance", "scene", "visual", "projector", "prosilica", "apply",
}  # fmt: skip

#: Gazebo's own systems that exert no force of their own and whose names have none of these words.
SYSTEMS = {
    "physics", "user-commands", "log", "forcetorque", "dvl", "air-speed", "touchplugin",
    "opticaltactileplugin", "logicalaudiosensorplugin", "linearbatteryplugin", "label", "thermal",
    "particle-emitter", "breadcrumbs", "performer-detector", "kinetic-energy-monitor", "comms-endpoint",
    "perfect-comms", "rf-comms", "acoustic-comms", "environment-preload", "shader-param", "lens-flare",
    "collada-world-exporter", "model-photo-shoot",
}  # fmt: skip

#: Names of Gazebo's own systems, and of the plugins of gazebo_ros that only serve its interface.
OF_GAZEBO = (
    rf"(lib)?((gz|ignition)-(sim|gazebo)\d*-({'|'.join(sorted(SYSTEMS))})-system"
    r"|gazebo_ros_(init|factory|state|api_plugin|paths_plugin|properties))(\.so)?"
)

#: Words of plugins that hold bodies together.
HOLDING = {
    "attach", "attaches", "attached", "attacher", "attachment", "detachable", "weld", "welding", "loop",
    "loops", "closed", "closure", "constraint", "constraints", "linkage", "coupling", "coupler", "fixed",
    "joints", "parallel",
}  # fmt: skip

#: Children and attributes that name the two bodies of a constraint.
ENDS = {
    "body1", "body2", "link1", "link2", "link_1", "link_2", "predecessor", "successor", "link_a", "link_b",
}  # fmt: skip


class Follower(NamedTuple):
    """A joint that a plugin moves with another: position = multiplier x position of the leader + offset.

    Attributes:
        node: The element that states it.
        name: Name of the joint.
        leader: Name of the joint that it follows.
        multiplier, offset: The numbers.
    """

    node: XmlNode
    name: str
    leader: str
    multiplier: float
    offset: float


def name_of(plugin: XmlNode) -> str:
    """Return the file of a plugin, else its name."""
    return str(plugin.attrib.get("filename") or plugin.attrib.get("name") or "")[:80]


def is_harmless(plugin: XmlNode) -> bool:
    """Return whether a plugin's name says that it exerts no force and holds nothing."""
    name = name_of(plugin)
    return bool(_words(name) & HARMLESS or re.fullmatch(OF_GAZEBO, name))


def is_read(plugin: XmlNode, model: str) -> bool:
    """Return whether a plugin welds links of this model or makes followers."""
    return weld_of(plugin, model) is not None or any(followers(plugin))


def weld_of(plugin: XmlNode, model: str) -> tuple[XmlNode, XmlNode] | None:
    """Return the elements that name the two links of this model that a plugin welds, or None.

    Args:
        plugin: The element.
        model: Name of the model around it.
    """
    if not _is_weld(plugin):
        return None
    other = plugin.child("child_model")
    if other is not None and other.content() not in (model, "__model__"):
        return None
    return plugin.required_child("parent_link"), plugin.required_child("child_link")


def _is_weld(plugin: XmlNode) -> bool:
    """Return whether a plugin is Gazebo's DetachableJoint."""
    return "detachable" in _words(f"{name_of(plugin)} {plugin.attrib.get('name', '')}")


def followers(plugin: XmlNode) -> Iterator[Follower]:
    """Yield the joint that a mimic plugin moves (`<joint>` leads, `<mimicJoint>` follows)."""
    leader, follower = plugin.child("joint"), plugin.child("mimicJoint")
    if leader is not None and follower is not None:
        numbers = (_number(plugin, word, default) for word, default in (("multiplier", 1.0), ("offset", 0.0)))
        yield Follower(plugin, follower.content(), leader.content(), *numbers)


def refuse_holding(plugin: XmlNode, links: Collection[str], mend: str) -> None:
    """Refuse a plugin that seems to join links of the robot.

    Args:
        plugin: The element.
        links: Names of the robot's links.
        mend: How to state the loop.

    Raises:
        ModelError: It names two links, and its name speaks of holding or its words of ends.
    """
    inside = [*plugin.descendants()]
    words = {name for node in (plugin, *inside) for name in node.attributes()} | {node.tag for node in inside}
    texts = [text for node in inside for text in (node.content(), *map(str, node.attrib.values()))]
    named = dict.fromkeys(text for text in texts if text.rpartition("::")[2] in links)
    both = f"{name_of(plugin)} {plugin.attrib.get('name', '')}"
    if len(named) > 1 and (_words(both) & HOLDING or len(words & ENDS) > 1):
        raise plugin.error(
            f"the plugin '{name_of(plugin)}' of Gazebo joins the links {listed(named)}, in a form that is "
            f"not read; {mend}"
        )


def _number(node: XmlNode, tag: str, default: float) -> float:
    child = node.child(tag)
    return default if child is None or not child.content() else child.number()


def _words(name: str) -> set[str]:
    """Return the words of a name such as `libgazebo_ros_control.so` or `DetachableJoint`."""
    split = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removeprefix("lib"))
    return {word.lower() for word in re.findall(r"[A-Za-z0-9]+", split)}
