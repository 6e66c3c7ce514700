"""Write couplings as `<mimic>`, or as `<coupling>` where one joint cannot follow another."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

from ...description.records import Coupling, Description, Joint
from ...description.urdf.loops import path_to_root
from ..numerals import numeral
from ..request import Losses, add_name


def add_couplings(
    root: ET.Element, d: Description, joints: Mapping[str, ET.Element], losses: Losses
) -> list[Coupling]:
    """Add the couplings of a robot to a URDF.

    Args:
        joints: Element of each joint.
        losses: Receives names of couplings.

    Returns:
        The couplings that URDF cannot say.
    """
    out = []
    above: dict[str, Joint | None] = {d.root: None} | {joint.child: joint for joint in d.joints}
    for coupling in d.couplings:
        if (ends := _gear(coupling, d, above)) is not None:
            link_a, link_b, ratio = ends
            element = ET.SubElement(root, "coupling", name=coupling.name)
            ET.SubElement(element, "predecessor", link=link_a)
            ET.SubElement(element, "successor", link=link_b)
            ET.SubElement(element, "ratio", value=numeral(ratio))
        elif not _add_mimic(coupling, joints, losses):
            out.append(coupling)
    return out


def _add_mimic(coupling: Coupling, joints: Mapping[str, ET.Element], losses: Losses) -> bool:
    """Add `<mimic>` to one of the two joints of a coupling that follows no other yet; False if none can."""
    if len(coupling.terms) != 2:
        return False
    for (follower, own), (leader, other) in (coupling.terms, coupling.terms[::-1]):
        if joints[follower].find("mimic") is None:
            add_name(coupling, follower, losses)
            mimic = ET.SubElement(joints[follower], "mimic", joint=leader, multiplier=numeral(-other / own))
            if coupling.offset:
                mimic.set("offset", numeral(coupling.offset / own))
            return True
    return False


def _gear(
    coupling: Coupling, d: Description, above: dict[str, Joint | None]
) -> tuple[str, str, float] | None:
    """Return predecessor, successor and ratio of the `<coupling>` with the same terms, or None.

    `<coupling>` is ratio x (sum over the predecessor's path) - (sum over the successor's path) = 0.
    """
    if coupling.offset or coupling.name == coupling.terms[0][0]:
        return None
    terms = dict(coupling.terms)
    child = {joint.name: joint.child for joint in d.joints}
    ends = [child[name] for name in terms]
    for link_b in ends:
        for link_a in (*ends, d.root):
            if link_a == link_b:
                continue
            paths = [
                [joint.name for joint in path_to_root(link, above) if joint.kind != "fixed"]
                for link in (link_a, link_b)
            ]
            own = [[name for name in path if name not in other] for path, other in (paths, paths[::-1])]
            if {*own[0], *own[1]} != terms.keys() or not own[1]:
                continue
            unit = -terms[own[1][0]]
            ratios = {terms[name] / unit for name in own[0]} or {1.0}
            if {-terms[name] / unit for name in own[1]} == {1.0} and len(ratios) == 1:
                return link_a, link_b, ratios.pop()
    return None
