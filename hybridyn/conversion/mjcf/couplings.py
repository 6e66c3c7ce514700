"""Write couplings as equalities of joints, or of a fixed tendon where they hold more than two joints.

MuJoCo counts positions in equalities from those at `qpos0`.
"""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

from ...description.records import Coupling
from ..numerals import numerals


def add_couplings(
    root: ET.Element, equality: ET.Element, couplings: tuple[Coupling, ...], refs: Mapping[str, float]
) -> None:
    """Add the couplings of a robot.

    Args:
        root: The root element, which receives `<tendon>`.
        equality: The element `<equality>`; its names stay unique.
        refs: Positions of joints at `qpos0`, by name [m or rad].
    """
    taken = {str(element.get("name")) for element in equality}
    for coupling in couplings:
        name = coupling.name
        while name in taken:
            name += "_"
        taken.add(name)
        offset = coupling.offset - sum(coefficient * refs[joint] for joint, coefficient in coupling.terms)
        (first, factor), *others = coupling.terms
        if len(others) > 1:
            tendon = root.find("tendon")
            tendon = ET.SubElement(root, "tendon") if tendon is None else tendon
            fixed = ET.SubElement(tendon, "fixed", name=name)
            for joint, coefficient in coupling.terms:
                ET.SubElement(fixed, "joint", joint=joint, coef=numerals([coefficient]))
            polynomial = (offset, 0, 0, 0, 0)
            ET.SubElement(equality, "tendon", name=name, tendon1=name, polycoef=numerals(polynomial))
            continue
        element = ET.SubElement(equality, "joint", name=name, joint1=first)
        slope = 0.0
        for second, coefficient in others:
            element.set("joint2", second)
            slope = -coefficient / factor
        element.set("polycoef", numerals((offset / factor, slope, 0, 0, 0)))
