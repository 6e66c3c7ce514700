"""Read Drake's forces between two links, of URDF or SDF: springs along a line, and bushings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..joint_chains import pose_coordinates
from ..names import did_you_mean, unique
from ..records import Array, RobotFile
from .drake import Named, as_stated, constraint_name, point, sides_of
from .xml_node import XmlNode, origin_of

SPRING, BUSHING = "drake:linear_spring_damper", "drake:linear_bushing_rpy"
#: Elements in bushings: the two frames, and three numbers each, by the words of the effect.
ENDS = ("drake:bushing_frameA", "drake:bushing_frameC")
THREES = tuple(f"{what}_{how}" for what in ("torque", "force") for how in ("stiffness", "damping"))

#: Returns the link that carries a named frame, and the frame in it, shape (4, 4).
Framed = Callable[[XmlNode, str], tuple[str, Array]]


def spring_effects(nodes: list[XmlNode], named: Named = as_stated) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Return `<drake:linear_spring_damper>`s as the effect line_springs, or nothing.

    Args:
        nodes: The elements.
        named: As in `read_ball_constraint`.

    Raises:
        ModelError: A number is missing or negative.
    """
    words = ("free_length", "stiffness", "damping")
    out: dict[str, dict[str, Any]] = {key: {} for key in ("ends", "points", *words[1:], "lower", "upper")}
    for node in nodes:
        name = unique(constraint_name(node), {*out["ends"]})
        sides = sides_of(node, {"p_AP": point, "p_BQ": point}, named, words)
        out["ends"][name] = [link for link, _ in sides]
        out["points"][name] = [at[:3, 3].tolist() for _, at in sides]
        length, out["stiffness"][name], out["damping"][name] = (_positive(node, word) for word in words)
        out["lower"][name] = out["upper"][name] = length
    return (("line_springs", out),) if nodes else ()


def _positive(node: XmlNode, word: str) -> float:
    child = node.required_child(f"{node.tag}_{word}")
    number = child.number("value" if "value" in child.attrib else "")
    if number < 0:
        raise child.error(f"{number:g} is negative")
    return number


def read_bushings(nodes: Sequence[XmlNode], framed: Framed, robot: RobotFile) -> None:
    """Add `<drake:linear_bushing_rpy>`s to a robot as the effect bushings, and note that they close nothing.

    Raises:
        ModelError: A frame is unknown, both are on one link, or a number is missing or negative.
    """
    if not nodes:
        return
    out: dict[str, dict[str, Any]] = {key: {} for key in ("ends", "frames", *THREES)}
    for node in nodes:
        tags = {word: f"drake:bushing_{word}" for word in THREES}
        node.only(["name"], [*ENDS, *tags.values()])
        name = unique(constraint_name(node), {*out["ends"]})
        ends = [node.required_child(tag) for tag in ENDS]
        placed = [framed(end, end.content() or end.text("name")) for end in ends]
        links = [link for link, _ in placed]
        if links[0] == links[1]:
            raise node.error(f"both frames are on link '{links[0]}'")
        out["ends"][name], out["frames"][name] = links, [[*pose_coordinates(at)] for _, at in placed]
        for word, tag in tags.items():
            out[word][name] = _three(node.required_child(tag))
        robot.notes.append(
            f"{node.at}: bushing '{name}' between links '{links[0]}' and '{links[1]}' closes no loop: they "
            "are free of each other but for its springs and dampers, which effects='model' computes and the "
            "default effects do not"
        )
    robot.effects += (("bushings", out),)


def _three(node: XmlNode) -> list[float]:
    node.only(["value"], [])
    numbers = node.numbers("value" if "value" in node.attrib else "", 3)
    if (numbers < 0).any():
        raise node.error(f"{numbers.min():g} is negative")
    return [float(x) for x in numbers]


def frames_of(root: XmlNode, robot: RobotFile) -> Framed:
    """Return what finds the frames of a URDF: those of links, and Drake's `<frame name link xyz rpy>`.

    Raises:
        ModelError: Two have one name.
    """
    frames = {link.name: (link.name, np.eye(4)) for link in robot.links}
    for node in root.children("frame"):
        if {"name", "link"} <= {*node.attributes()}:
            if (name := node.text("name")) in frames:
                raise node.error("another frame or link has this name; rename one")
            frames[name] = node.text("link"), origin_of(node)

    def find(node: XmlNode, name: str) -> tuple[str, Array]:
        """Return the link and the place of a frame in it.

        Raises:
            ModelError: There is no such frame, or no such link.
        """
        for known in (name, frames.get(name, ("",))[0]):
            if known not in frames:
                raise node.error(f"unknown frame '{known}'{did_you_mean(known, frames)}")
        return frames[name]

    return find
