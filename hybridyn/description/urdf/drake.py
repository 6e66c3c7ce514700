"""Read the elements that Drake adds to URDF and that state constraints: `<drake:ball_constraint>`."""

from __future__ import annotations

import numpy as np

from ..closure_forms import FORMS
from ..placement import placement_from
from ..records import Closure
from .xml_node import Node

ENDS = (("body_A", "p_AP"), ("body_B", "p_BQ"))


def read_ball_constraints(root: Node) -> list[Closure]:
    """Read every `<drake:ball_constraint>`: point P of body A and point Q of body B coincide.

    The element has no name; the closures are called `ball_constraint1`, ...

    Raises:
        ModelError: A body or point is missing, or a number does not parse.
    """
    form = FORMS["spherical"]
    out = []
    for number, node in enumerate(root.children("drake:ball_constraint"), 1):
        prefix = "drake:ball_constraint_"
        node.only(["name"], [prefix + word for end in ENDS for word in end])
        sides = []
        for body, point in ENDS:
            link, place = node.required_child(prefix + body), node.required_child(prefix + point)
            link.only(["name"], [])
            place.only(["value"], [])
            at = placement_from(np.eye(3), place.numbers("value", 3))
            sides.append((link.text("name"), at))
        (link_a, frame_a), (link_b, frame_b) = sides
        name = node.xml.get("name", "").strip() or f"ball_constraint{number}"
        ends = (link_a, frame_a, link_b, frame_b)
        out.append(Closure(name, "spherical", *ends, form.translations, form.rotation, node.line))
    return out
