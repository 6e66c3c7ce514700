"""A robot whose links and joints have other names, or stand for others: its effects follow."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..description.effect_names import acts_on, named_by
from ..description.names import unique
from ..description.records import Coupling, Description
from ..description.residuals import Residual
from .request import Losses


def allowed(d: Description, losses: Losses, words: str, change: Callable[[str], str]) -> Description:
    """Return a robot whose names a format allows: one name for one thing.

    Args:
        losses: Receives the names that are changed.
        words: The format, for the reason.
        change: Returns the name that stands for one in the format.
    """
    taken: set[str] = set()
    joints, closures = _named(d.joints, change, taken), _named(d.closures, change, taken)
    root = {d.root: "world"} if d.root == "world" else {}
    links = _named([link for link in d.links if link.name not in root], change, taken) | root
    changed = [pair for names in (links, joints, closures) for pair in names.items() if pair[0] != pair[1]]
    for old, new in changed:
        losses.add(
            f"names that {words} does not allow, or that two things have, are changed", f"{old} -> {new}"
        )
    if not changed:
        return d
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
        couplings=tuple(_on_links(c.of(joints), links) for c in d.couplings),
        motors=tuple(joints[name] for name in d.motors),
        home={joints[name]: x for name, x in d.home.items()},
        effects=effects_on(d, links, {joint: (name,) for joint, name in joints.items()}),
    )


def _on_links(coupling: Coupling, links: Mapping[str, str]) -> Coupling:
    """Return a coupling whose frames are those of links of other names."""
    if not isinstance(coupling.curve, Residual):
        return coupling
    return replace(coupling, curve=replace(coupling.curve, frames=tuple(links[x] for x in coupling.frames)))


def _named(items: Sequence[Any], change: Callable[[str], str], taken: set[str]) -> dict[str, str]:
    """Return a free name for the name of each item, and take it."""
    out = {}
    for item in items:
        out[item.name] = unique(change(item.name), taken)
        taken.add(out[item.name])
    return out


def effects_on(
    d: Description, links: Mapping[str, str], joints: Mapping[str, Sequence[str]]
) -> tuple[tuple[str, dict[str, Any]], ...]:
    """Return the effects of a robot on links and joints of other names.

    Args:
        links: New names of links; those left out keep theirs.
        joints: The joints that stand for a joint, each of which has its numbers; none if it has no more. An
            effect on none of its joints is left out.
    """
    out = []
    for effect, numbers in d.effects:
        here = {link: (name,) for link, name in links.items()} if acts_on(effect) == "link" else joints
        known = named_by(effect, numbers)
        left = [new for _, name in known for new in here.get(name, (name,))]
        if left or not known:
            out.append((effect, _with_names(numbers, {key for key, _ in known}, here)))
    return tuple(out)


def without_joints(d: Description, gone: Collection[str], losses: Losses) -> Description:
    """Return a robot without effects on joints that are written as others; `losses` receives their names."""
    for effect, numbers in d.effects:
        for _, name in named_by(effect, numbers):
            if name in gone and acts_on(effect) == "joint":
                losses.add(f"{effect} of joints that are written as others", name)
    return replace(d, effects=effects_on(d, {}, dict.fromkeys(gone, ())))


def held_links(d: Description) -> set[str]:
    """Return the links that effects and closures of packages name, which have to be links of the file."""
    framed = {link for coupling in d.couplings for link in coupling.frames}
    acting = (named_by(effect, x) for effect, x in d.effects if acts_on(effect) == "link")
    return framed | {name for found in acting for _, name in found}


def _with_names(
    numbers: Mapping[str, Any], keys: Collection[str], names: Mapping[str, Sequence[str]]
) -> dict[str, Any]:
    """Return the numbers of an effect with other names; `keys`: those that hold names, as in `named_by`."""

    def renamed(key: str, value: Any) -> Any:
        """Return the value of a key."""
        if isinstance(value, str):  # the link of a payload
            return names.get(value, (value,))[0]
        if key == "ends":
            return {
                line: [new for link in links for new in names.get(link, (link,))]
                for line, links in value.items()
            }
        return {new: x for name, x in value.items() for new in names.get(name, (name,))}

    return {key: renamed(key, value) if key in keys else value for key, value in numbers.items()}
