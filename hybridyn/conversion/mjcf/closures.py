"""Write closures as equalities between sites.

a point                one connect
fixed                  one weld
revolute               two connects, at two points of the axis
any other              a follower (see `followers`), welded to the other link
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np

from ...description.placement import placement_from, turned
from ...description.records import Array, Closure
from ..request import Losses
from .bodies import Tree, pose
from .followers import FOLLOWER, Follower

FULL = (0, 1, 2)


def needs_follower(closure: Closure) -> bool:
    """Say whether MuJoCo has no equality with the rows of a closure."""
    return closure.translations != FULL or closure.rotation == "perpendicular"


def add_closures(
    equality: ET.Element,
    closures: tuple[Closure, ...],
    followers: Mapping[str, Follower],
    tree: Tree,
    arm: float,
    losses: Losses,
) -> None:
    """Add sites and equalities.

    Args:
        equality: The element `<equality>`.
        closures: The closures.
        followers: The follower of each closure that needs one, by its name.
        tree: The bodies, which receive sites.
        arm: Distance of the two points that hold an axis [m].
        losses: Receives closures that MuJoCo has no word for.
    """
    for closure in closures:
        ends = {"a": (closure.link_a, closure.frame_a), "b": (closure.link_b, closure.frame_b)}
        word = "weld" if closure.rotation == "fixed" else "connect"
        if follower := followers.get(closure.name):
            name = f"{closure.name}:{FOLLOWER}"
            ends["a" if follower.first else "b"] = (name, tree.ends[name])
            word = "weld"
            losses.add("closures are a weld to a body of their own, which follows one link", closure.name)
        own = {end: (link, turned(frame, closure.turn.T)) for end, (link, frame) in ends.items()}
        _equate(equality, word, closure.name, f"{closure.name}:", own, tree)
        if word == "connect" and closure.rotation == "parallel":
            ahead = placement_from(np.eye(3), np.array([0.0, 0.0, arm]))
            second = {end: (link, frame @ ahead) for end, (link, frame) in ends.items()}
            _equate(equality, word, f"{closure.name}:axis", f"{closure.name}:axis_", second, tree)
            losses.add("closures with an axis are connects of two points on it", closure.name)


def _equate(
    equality: ET.Element, word: str, name: str, stem: str, ends: dict[str, tuple[str, Array]], tree: Tree
) -> None:
    """Add an equality between two sites; their names end in a and b."""
    between = {}
    for number, (end, (link, frame)) in enumerate(ends.items(), 1):
        site = stem + end
        ET.SubElement(tree.bodies[link], "site", {"name": site} | pose(frame))
        between[f"site{number}"] = site
    ET.SubElement(equality, word, {"name": name} | between)
