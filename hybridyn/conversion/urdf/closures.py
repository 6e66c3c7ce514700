"""Write closures as `<loop>`."""

from __future__ import annotations

from xml.etree import ElementTree as ET

import numpy as np

from ...description.closure_forms import FORMS
from ...description.placement import turned
from ...description.records import Array, Closure
from ..numerals import angles_of, numerals
from ..request import Losses, rows_of


def add_closure(root: ET.Element, closure: Closure, losses: Losses) -> None:
    """Add a closure to a URDF. `losses`: receives a closure whose axes `<loop>` cannot say."""
    kind, turn = kind_of(closure), closure.turn
    element = ET.SubElement(root, "loop", name=closure.name, type=kind)
    if kind == "rows":
        words, turn = rows_of(closure, losses)
        element.set("rows", words)
    other = np.eye(3) if kind == "universal" else turn
    _add_end(element, "predecessor", closure.link_a, turned(closure.frame_a, turn.T))
    _add_end(element, "successor", closure.link_b, turned(closure.frame_b, other.T))
    if kind != "rows" and FORMS[kind].has_axis:
        ET.SubElement(element, "axis", xyz=numerals(turn[:, 2]))
    if kind == "universal":
        ET.SubElement(element, "axis2", xyz="0 0 1")


def kind_of(closure: Closure) -> str:
    """Return the type of `<loop>` with the rows of a closure."""
    form = FORMS.get(closure.kind)
    if form is not None and (form.translations, form.rotation) == (closure.translations, closure.rotation):
        return closure.kind
    for kind, form in FORMS.items():
        if (form.translations, form.rotation) == (closure.translations, closure.rotation):
            return kind
    return "rows"


def _add_end(element: ET.Element, tag: str, link: str, frame: Array) -> None:
    end = ET.SubElement(element, tag, link=link)
    if not np.array_equal(frame, np.eye(4)):
        ET.SubElement(end, "origin", xyz=numerals(frame[:3, 3]), rpy=numerals(angles_of(frame[:3, :3])))
