"""Where the frames of an SDF file stand in the posture that it states, and the link that carries each."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter

import numpy as np

from ..names import listed
from ..placement import inverse
from ..records import Array
from ..urdf.xml_node import Node
from .scopes import Item, Scope, resolve


class Poses:
    """The pose of every element in the world, and the links that carry frames."""

    def __init__(self, world: Scope) -> None:
        """Compute every pose.

        Raises:
            ModelError: A frame is unknown, or frames are defined relative to each other in a circle.
        """
        self._world = world
        self._in_scope: dict[Item, Array] = {}
        self._links: dict[Item, Item | None] = {}
        base = {item: _base(item) for scope in world.models() for item in _elements(scope)}
        pinned = {item: _placement_frame(item) for item in base if item.inner is not None}
        needs = {
            item: {
                *_between(target, item.scope),
                *(_between(item.scope.item, world) if _hangs_on_world(item) else ()),
                *(_between(pinned[item], item.inner) if item in pinned else ()),
            }
            for item, target in base.items()
        }  # fmt: skip
        try:
            order = list(TopologicalSorter(needs).static_order())
        except CycleError as error:
            circle = list(error.args[1][1:])
            names = listed(item.name for item in circle)
            raise circle[0].node.error(f"poses are relative to each other in a circle: {names}") from None
        for item in order:
            start = self._within(base[item], item.scope)
            if _hangs_on_world(item):
                start = inverse(self.of_scope(item.scope))
            at = start @ item.pose
            if pinned.get(item) is not None:
                at = at @ inverse(self._within(pinned[item], item.inner))
            self._in_scope[item] = at

    def world(self, item: Item | None) -> Array:
        """Return the pose of an element in the world, shape (4, 4); None is the world itself."""
        return self._within(item, self._world)

    def of_scope(self, scope: Scope) -> Array:
        """Return the pose of a model's own frame in the world, shape (4, 4)."""
        return self.world(scope.item)

    def named(self, scope: Scope, name: str, node: Node) -> Array:
        """Return the pose of a frame in the world by its name, shape (4, 4).

        Raises:
            ModelError: There is no such frame.
        """
        item = resolve(scope, name, node)
        return self.of_scope(scope) if item is None else self.world(item)

    def link(self, scope: Scope, name: str, node: Node) -> Item | None:
        """Return the link that carries a frame, None for the world.

        Args:
            scope: Where the name stands.
            name: Name of a link, frame, joint or model, or "world".
            node: The element that states it.

        Raises:
            ModelError: There is no such frame, or frames are attached to each other in a circle.
        """
        if name == "world":
            return None
        item = resolve(scope, name, node)
        if item is None:
            item = scope.item
        passed: dict[Item, None] = {}
        while item is not None and item.kind != "link":
            if item in self._links:
                item = self._links[item]
                break
            if item in passed:
                raise item.node.error("frames are attached to each other in a circle")
            passed[item] = None
            item = _carrier(item)
        for step in passed:
            self._links[step] = item
        return item

    def _within(self, item: Item | None, scope: Scope | None) -> Array:
        """Return the pose of an element in a scope around it."""
        at = np.eye(4)
        while item is not None:
            at = self._in_scope[item] @ at
            if item.scope is scope:
                break
            item = item.scope.item
        return at


def _elements(scope: Scope) -> list[Item]:
    """Return every element of a scope, the frames of merged models too."""
    own = [item for items in scope.items.values() for item in items.values()]
    return [*own, *(inner.item for inner in scope.merged if inner.item is not None)]


def _base(item: Item) -> Item | None:
    """Return the element relative to which a pose is stated, None for the frame of its scope."""
    if item.relative_to:
        return resolve(item.scope, item.relative_to, item.node)
    if item.kind == "frame" and item.attached_to:
        return resolve(item.scope, item.attached_to, item.node)
    if item.kind == "joint" and not _hangs_on_world(item):
        child = item.node.required_child("child")
        return resolve(item.scope, child.content(), child)
    return None


def _hangs_on_world(item: Item) -> bool:
    """Check whether the pose of a joint is relative to the world, which is its child."""
    return (
        item.kind == "joint"
        and not item.relative_to
        and item.node.required_child("child").content() == "world"
    )


def _placement_frame(item: Item) -> Item | None:
    """Return the element inside a model that the model's pose places, None for its own frame."""
    inner = item.inner
    if inner is None or not inner.placement_frame:
        return None
    return resolve(inner, inner.placement_frame, item.node)


def _between(item: Item | None, scope: Scope | None) -> list[Item]:
    """Return an element and the frames of the models between it and a scope around it."""
    out = []
    while item is not None:
        out.append(item)
        if item.scope is scope:
            break
        item = item.scope.item
    return out


def _carrier(item: Item) -> Item | None:
    """Return what carries a frame: of a joint its child, of a model its canonical link."""
    if item.kind == "joint":
        child = item.node.required_child("child")
        name = child.content()
        return None if name == "world" else resolve(item.scope, name, child) or item.scope.item
    if item.kind == "frame":
        if not item.attached_to:
            return item.scope.item
        return resolve(item.scope, item.attached_to, item.node) or item.scope.item
    inner = item.inner
    if inner is None:
        return None
    if name := str(inner.node.xml.get("canonical_link", "")).strip():
        return resolve(inner, name, inner.node)
    links = list(inner.items["link"].values())
    first = next(iter(links), None) or next(iter(inner.items["model"].values()), None)
    first = first or next((scope.item for scope in inner.merged), None)
    if first is None:
        raise inner.node.error("the model has no link")
    return first
