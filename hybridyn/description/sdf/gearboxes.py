"""Gearboxes of SDF: couplings between the angles of two links against a third one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...errors import ModelError
from ..closure_forms import LARGEST_COSINE
from ..joint_graph import WORLD, Tree
from ..records import Array, Coupling
from .elements import numbers
from .models import Item, Models
from .stated import Stated

#: The joint above each link, whether it leads there forwards, and the link before.
Above = dict[str, tuple[Stated, bool, str]]


def couplings_of(
    gearboxes: list[Stated], tree: Tree[Stated], models: Models, steps: Mapping[Item, list[str]]
) -> list[Coupling]:
    """Return the couplings of gearboxes: angle of the child = -ratio x angle of the parent.

    Both angles are those against the reference body, the parent's about <axis>, the child's about <axis2>.

    Args:
        gearboxes: The gearboxes.
        tree: The tree of the joints.
        models: Where everything stands.
        steps: Names of the joints that each joint became.

    Raises:
        ModelError: No sum of joint positions is such an angle.
    """
    above: Above = {}
    for joint, forward in tree.branches:
        parent, child = joint.ends if forward else joint.ends[::-1]
        above[child] = joint, forward, parent
    out = []
    for box in gearboxes:
        node = box.item.node
        body = node.required_child("gearbox_reference_body")
        base = models.link(box.item.scope, body.content(), body)
        terms: dict[str, float] = {}
        for end, axis, factor in zip(
            box.ends, box.axes, (numbers(node, "joint")["gearbox_ratio"], 1.0), strict=True
        ):
            turns = _turns(box, WORLD if base is None else base.full_name, end, axis.direction, above, steps)
            for name, sense in turns.items():
                terms[name] = terms.get(name, 0.0) + factor * sense
        kept = tuple((name, factor) for name, factor in reversed(terms.items()) if factor)
        if not kept:
            raise node.error("couples nothing; check its links, its reference body and its ratio")
        out.append(Coupling(box.name, kept, 0.0, box.line))
    return out


def _turns(
    box: Stated, start: str, end: str, axis: Array, above: Above, steps: Mapping[Item, list[str]]
) -> dict[str, float]:
    """Return the factors of joint positions whose sum is the angle from one link to another about an axis."""
    up, down = _path(start, above), _path(end, above)
    while up and down and up[-1][0] is down[-1][0]:
        up.pop()
        down.pop()
    out: dict[str, float] = {}
    for way, toward in ((up, -1.0), (down, 1.0)):
        for joint, forward, _ in way:
            if joint.kind == "ball":
                raise _no_angle(box, joint)
            turning = joint.axes if joint.kind != "prismatic" else []
            for name, about in zip(steps.get(joint.item, ()), turning, strict=False):
                if np.linalg.norm(np.cross(about.direction, axis)) > LARGEST_COSINE:
                    raise _no_angle(box, joint)
                sense = toward * (1.0 if forward else -1.0) * float(np.sign(about.direction @ axis))
                out[name] = out.get(name, 0.0) + sense
    return out


def _path(link: str, above: Above) -> list[tuple[Stated, bool, str]]:
    """Return the joints from a link up to its root."""
    out = []
    while link in above:
        out.append(above[link])
        link = out[-1][2]
    return out


def _no_angle(box: Stated, joint: Stated) -> ModelError:
    return box.item.node.error(
        f"joint '{joint.name}' is between the reference body and a link of the gearbox and does not turn "
        "about its axis; no sum of joint positions is the angle that the gearbox ties"
    )
