"""Write closures as `<loop>`, couplings as `<mimic>`, or `<coupling>` where no joint can follow another."""

from __future__ import annotations

from collections.abc import Mapping
from xml.etree import ElementTree as ET

import numpy as np

from ...description.closure_forms import FORMS
from ...description.placement import turned
from ...description.records import Array, Closure, Coupling, Description, Joint
from ...description.urdf.loops import terms_between
from ..numerals import add, angles_of, put
from ..request import Losses, add_name, rows_of


def add_origin(element: ET.Element, placement: Array) -> None:
    """Add `<origin>` to an element, unless the placement is the identity."""
    if not np.array_equal(placement, np.eye(4)):
        add(element, "origin", xyz=placement[:3, 3], rpy=angles_of(placement[:3, :3]))


def add_closure(root: ET.Element, closure: Closure, losses: Losses) -> None:
    """Add a closure to a URDF. `losses`: receives a closure whose axes `<loop>` cannot say."""
    locked = (closure.translations, closure.rotation)
    forms = [kind for kind, form in FORMS.items() if (form.translations, form.rotation) == locked]
    kind = closure.kind if closure.kind in forms else forms[0] if forms else "rows"
    words, turn = rows_of(closure, losses) if kind == "rows" else (None, closure.turn)
    element = add(root, "loop", name=closure.name, type=kind, rows=words)
    other = np.eye(3) if kind == "universal" else turn
    for tag, link, frame, own in (
        ("predecessor", closure.link_a, closure.frame_a, turn),
        ("successor", closure.link_b, closure.frame_b, other),
    ):
        add_origin(add(element, tag, link=link), turned(frame, own.T))
    if kind != "rows" and FORMS[kind].has_axis:
        add(element, "axis", xyz=turn[:, 2])
    if kind == "universal":
        add(element, "axis2", xyz="0 0 1")


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
            element = add(root, "coupling", name=coupling.name)
            add(element, "predecessor", link=ends[0])
            add(element, "successor", link=ends[1])
            add(element, "ratio", value=ends[2])
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
            mimic = add(joints[follower], "mimic", joint=leader, multiplier=-other / own)
            put(mimic, offset=coupling.offset / own if coupling.offset else None)
            return True
    return False


def _gear(
    coupling: Coupling, d: Description, above: Mapping[str, Joint | None]
) -> tuple[str, str, float] | None:
    """Return predecessor, successor and ratio of the `<coupling>` with the same terms, or None."""
    if coupling.offset or coupling.name == coupling.terms[0][0]:
        return None
    terms = dict(coupling.terms)
    ends = [joint.child for name in terms for joint in d.joints if joint.name == name]
    for link_b in ends:
        for link_a in (*ends, d.root):
            signs = {joint.name: sign for joint, sign in terms_between(link_a, link_b, above)}
            gears = {
                sign: {sign * terms.get(name, 0) for name in signs if signs[name] == sign} for sign in (1, -1)
            }
            if signs.keys() == terms.keys() and len(gears[-1]) == 1 and len(gears[1]) <= 1:
                (unit,) = gears[-1]
                return link_a, link_b, gears[1].pop() / unit if gears[1] else 1.0
    return None
