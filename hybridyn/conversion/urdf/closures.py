"""Write closures as `<loop>`."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.closure_forms import FORMS, words_of_rows
from ...description.placement import rotation_to_axis, turned
from ...description.records import Array, Closure
from ..losses import Losses
from ..numerals import angles_of, numerals

#: Difference of two rotations that is rounding.
SAME_ROTATION = 1e-14


def add_closure(root: ET.Element, closure: Closure, losses: Losses) -> None:
    """Add a closure to a URDF. `losses`: receives a closure that `<loop>` cannot say."""
    kind = kind_of(closure)
    if kind is None:
        losses.add("closures left out, since they have no row", closure.name)
        return
    turn = closure.turn
    stated = kind != "rows" and FORMS[kind].has_axis
    if not stated or np.abs(rotation_to_axis(turn[:, 2]) - turn).max() > SAME_ROTATION:
        turn = np.eye(3)
    other = np.eye(3) if kind == "universal" else turn
    element = ET.SubElement(root, "loop", name=closure.name, type=kind)
    if kind == "rows":
        element.set("rows", " ".join(words_of_rows(closure.translations, closure.rotation)))
    _add_end(element, "predecessor", closure.link_a, turned(closure.frame_a, turn.T))
    _add_end(element, "successor", closure.link_b, turned(closure.frame_b, other.T))
    if stated:
        ET.SubElement(element, "axis", xyz=numerals(turn[:, 2]))
    if kind == "universal":
        ET.SubElement(element, "axis2", xyz="0 0 1")


def kind_of(closure: Closure) -> str | None:
    """Return the type of `<loop>` with the rows of a closure; None if there is none."""
    form = FORMS.get(closure.kind)
    if form is not None and (form.translations, form.rotation) == (closure.translations, closure.rotation):
        return closure.kind
    for kind, form in FORMS.items():
        if (form.translations, form.rotation) == (closure.translations, closure.rotation):
            return kind
    return "rows" if words_of_rows(closure.translations, closure.rotation) else None


def _add_end(element: ET.Element, tag: str, link: str, frame: Array) -> None:
    end = ET.SubElement(element, tag, link=link)
    if not np.array_equal(frame, np.eye(4)):
        ET.SubElement(end, "origin", xyz=numerals(frame[:3, 3]), rpy=numerals(angles_of(frame[:3, :3])))
