"""Write couplings as `<mimic>` of axes."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

from ...description.records import Coupling, Description
from ..request import Losses, add_name
from .joints import add_number


def add_couplings(d: Description, joints: Mapping[str, ET.Element], losses: Losses) -> list[Coupling]:
    """Add the couplings of two joints to a model.

    Args:
        joints: Element of each joint.
        losses: Receives names of couplings.

    Returns:
        The couplings that SDF cannot say.
    """
    return [coupling for coupling in d.couplings if not _add_mimic(coupling, joints, losses)]


def _add_mimic(coupling: Coupling, joints: Mapping[str, ET.Element], losses: Losses) -> bool:
    """Add `<mimic>` to one of the two joints of a coupling that follows no other yet; False if none can."""
    if len(coupling.terms) != 2:
        return False
    for (follower, own), (leader, other) in (coupling.terms, coupling.terms[::-1]):
        axis = joints[follower].find("axis")
        if axis is not None and axis.find("mimic") is None:
            add_name(coupling, follower, losses)
            mimic = ET.SubElement(axis, "mimic", joint=leader)
            add_number(mimic, "multiplier", -other / own)
            add_number(mimic, "offset", coupling.offset / own)
            add_number(mimic, "reference", 0.0)
            return True
    return False
