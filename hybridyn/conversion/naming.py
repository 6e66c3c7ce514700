"""Give links, joints and closures names that a format allows: one name for one thing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from ..description.mjcf.naming import unique
from ..description.records import Description
from .losses import Losses


def allowed(d: Description, losses: Losses, words: str, change: Callable[[str], str]) -> Description:
    """Return a robot whose names a format allows.

    Args:
        losses: Receives the names that are changed.
        words: The format, for the reason.
        change: Returns the name that stands for one in the format.
    """
    taken: set[str] = set()
    joints = _names([joint.name for joint in d.joints], taken, change)
    closures = _names([closure.name for closure in d.closures], taken, change)
    root = {d.root: "world"} if d.root == "world" else {}
    links = _names([link.name for link in d.links if link.name not in root], taken, change) | root
    renamed = [
        f"{old} -> {new}" for names in (links, joints, closures) for old, new in names.items() if old != new
    ]
    if not renamed:
        return d
    for pair in renamed:
        losses.add(f"names that {words} does not allow, or that two things have, are changed", pair)
    return replace(
        d,
        links=tuple(replace(link, name=links[link.name]) for link in d.links),
        joints=tuple(
            replace(j, name=joints[j.name], parent=links[j.parent], child=links[j.child]) for j in d.joints
        ),
        closures=tuple(
            replace(c, name=closures[c.name], link_a=links[c.link_a], link_b=links[c.link_b])
            for c in d.closures
        ),
        couplings=tuple(
            replace(c, terms=tuple((joints[name], factor) for name, factor in c.terms)) for c in d.couplings
        ),
        motors=tuple(joints[name] for name in d.motors),
        home={joints[name]: x for name, x in d.home.items()},
        effects=tuple((name, _keys(numbers, joints | links)) for name, numbers in d.effects),
    )


def _names(names: list[str], taken: set[str], change: Callable[[str], str]) -> dict[str, str]:
    """Return a free name for each name, and add it to those that are taken."""
    out = {}
    for name in names:
        out[name] = unique(change(name), taken)
        taken.add(out[name])
    return out


def _keys(value: Any, names: Mapping[str, str]) -> Any:
    """Return the numbers of an effect with the new names of joints and links."""
    if isinstance(value, Mapping):
        return {names.get(key, key): _keys(item, names) for key, item in value.items()}
    return value
