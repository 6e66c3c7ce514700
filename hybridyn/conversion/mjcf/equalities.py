"""Write closures and couplings as equalities.

a point        one connect between sites         two joints     a joint equality
fixed          one weld between sites            more joints    an equality of a fixed tendon
revolute       two connects, at two points of the axis

MuJoCo counts positions in equalities from those at `qpos0`.
"""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.names import unique
from ...description.placement import placement_from, turned
from ...description.records import Description
from ..home import home_of
from ..numerals import add
from ..request import Losses
from .bodies import Tree, pose


def add_closures(equality: ET.Element, d: Description, tree: Tree, arm: float, losses: Losses) -> None:
    """Add sites and equalities.

    Args:
        equality: The element `<equality>`.
        d: The robot; its closures are points, axes and welds.
        tree: The bodies, which receive sites.
        arm: Distance of the two points that hold an axis [m].
        losses: Receives closures that MuJoCo has no word for.
    """
    for closure in d.closures:
        word = "weld" if closure.rotation == "fixed" else "connect"
        ends = (("a", closure.link_a, closure.frame_a), ("b", closure.link_b, closure.frame_b))
        stems = {closure.name: (f"{closure.name}:", turned(np.eye(4), closure.turn.T))}
        if closure.rotation == "parallel":
            ahead = placement_from(np.eye(3), np.array([0.0, 0.0, arm]))
            stems[f"{closure.name}:axis"] = (f"{closure.name}:axis_", ahead)
            losses.add("closures with an axis are connects of two points on it", closure.name)
        for name, (stem, there) in stems.items():
            for end, link, frame in ends:
                add(tree.bodies[link], "site", name=stem + end, **pose(frame @ there))
            add(equality, word, name=name, site1=f"{stem}a", site2=f"{stem}b")


def add_couplings(root: ET.Element, equality: ET.Element, d: Description) -> None:
    """Add the couplings of a robot.

    Args:
        root: The root element, which receives `<tendon>`.
        equality: The element `<equality>`; its names stay unique.
        d: The robot.
    """
    at, taken = {joint.name: home_of(d, joint)[0] for joint in d.joints if joint.kind != "fixed"}, set[str]()
    for closure in d.closures:
        taken |= {closure.name, f"{closure.name}:axis"}
    for coupling in d.couplings:
        name = unique(coupling.name, taken)
        offset = coupling.offset - sum(coefficient * at[joint] for joint, coefficient in coupling.terms)
        (first, factor), *others = coupling.terms
        if len(others) > 1:
            tendon = root.find("tendon")
            fixed = add(add(root, "tendon") if tendon is None else tendon, "fixed", name=name)
            for joint, coefficient in coupling.terms:
                add(fixed, "joint", joint=joint, coef=coefficient)
            add(equality, "tendon", name=name, tendon1=name, polycoef=(offset, 0, 0, 0, 0))
            continue
        second, coefficient = others[0] if others else (None, 0.0)
        polynomial = (offset / factor, -coefficient / factor, 0, 0, 0)
        add(equality, "joint", name=name, joint1=first, joint2=second, polycoef=polynomial)
