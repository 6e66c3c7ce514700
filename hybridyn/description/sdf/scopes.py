"""The models of an SDF file as scopes of names: nested models, included and merged ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

from ..names import did_you_mean, listed
from ..records import Array
from ..urdf.xml_node import Node
from . import fields
from .library import DEEPEST, Library, Source

Kind = Literal["link", "joint", "frame", "model"]

#: Kinds of elements with a name, in the order in which a name before SDFormat 1.7 is looked up.
KINDS: tuple[Kind, ...] = ("link", "frame", "joint", "model")

#: Name of a model's own frame.
MODEL = "__model__"


@dataclass(eq=False)
class Item:
    """An element with a frame.

    Attributes:
        kind: What it is; the frame of a nested model has kind "model".
        scope: The model, or world, in which it stands.
        node: The element.
        pose: What `<pose>` states, shape (4, 4).
        relative_to: Name of the frame in which the pose is expressed, "" for the default.
        attached_to: Name of the frame to which a `<frame>` is attached, "" for the default.
        inner: The scope of a model.
    """

    kind: Kind
    name: str
    scope: Scope
    node: Node
    pose: Array
    relative_to: str
    attached_to: str = ""
    inner: Scope | None = None

    @property
    def full_name(self) -> str:
        """Its name with the names of the nested models around it, as Gazebo joins them."""
        return self.scope.prefix + self.name


@dataclass(eq=False)
class Scope:
    """A model or a world: the elements in it by kind and name.

    Attributes:
        node: The element `<model>` or `<world>`.
        source: The file in which it stands.
        item: The model's own frame in the scope around it, or None for the world.
        prefix: What comes before the names of its elements.
        placement_frame: Name of the frame that the model's pose places, "" for its own.
        items: Elements by kind and name.
        merged: Scopes whose names belong to this one, too.
    """

    node: Node
    source: Source
    item: Item | None = None
    prefix: str = ""
    placement_frame: str = ""
    items: dict[Kind, dict[str, Item]] = field(default_factory=lambda: {kind: {} for kind in KINDS})
    merged: list[Scope] = field(default_factory=list)

    def add(self, item: Item) -> None:
        """Add an element.

        Raises:
            ModelError: An element of the same kind has its name, or the name is SDFormat's own.
        """
        if item.name == "world" or (item.name.startswith("__") and item.name.endswith("__")):
            raise item.node.error(f"the name '{item.name}' is SDFormat's own; rename it")
        if item.name in self.items[item.kind]:
            first = self.items[item.kind][item.name].node.line
            raise item.node.error(f"is stated twice (first in line {first}); rename one")
        self.items[item.kind][item.name] = item

    def add_node(self, node: Node) -> None:
        """Add a link, joint or frame.

        Raises:
            ModelError: As for `add`, or its name or pose is invalid.
        """
        pose = node.child("pose")
        kind: Kind = "link" if node.tag == "link" else "joint" if node.tag == "joint" else "frame"
        attached = str(node.xml.get("attached_to", "")).strip() if kind == "frame" else ""
        name = node.text("name")
        self.add(Item(kind, name, self, node, fields.pose(pose), fields.relative_to(pose), attached))

    def find(self, name: str) -> list[Item]:
        """Return the elements that a name can mean here, one a kind.

        Args:
            name: Names of nested models and of the element, joined by `::`.
        """
        found = [self.items[kind][name] for kind in KINDS if name in self.items[kind]]
        model, _, rest = name.partition("::")
        if not found and rest and model in self.items["model"]:
            nested = self.items["model"][model]
            if rest == MODEL:
                return [nested]
            found = nested.inner.find(rest) if nested.inner is not None else []
        for scope in self.merged:
            found = found or scope.find(name)
        return found

    def names(self) -> list[str]:
        """Return the names that can be used here, without those inside nested models."""
        own = [name for kind in KINDS for name in self.items[kind]]
        return [*own, *(name for scope in self.merged for name in scope.names())]

    def everything(self, kind: Kind) -> Iterator[Item]:
        """Yield every element of a kind, here and in all models inside."""
        yield from self.items[kind].values()
        for nested in self.items["model"].values():
            if nested.inner is not None:
                yield from nested.inner.everything(kind)
        for scope in self.merged:
            yield from scope.everything(kind)

    def models(self) -> Iterator[Scope]:
        """Yield this scope, and those of all models inside."""
        yield self
        for nested in self.items["model"].values():
            if nested.inner is not None:
                yield from nested.inner.models()
        for scope in self.merged:
            yield from scope.models()


def resolve(scope: Scope, name: str, node: Node) -> Item | None:
    """Return the element that a name means, None for the scope's own frame.

    Raises:
        ModelError: There is no such element, or several.
    """
    if not name:
        raise node.error("is empty; name a link or frame")
    if name == MODEL or (name == "world" and scope.item is None):
        return None
    found = scope.find(name)
    if not found:
        known = scope.names()
        hint = did_you_mean(name, known) or f"; known: {listed(known) or 'none'}"
        raise node.error(f"unknown frame '{name[:80]}'{hint}")
    if len(found) > 1 and scope.source.minor >= 7:
        kinds = " and a ".join(item.kind for item in found)
        raise node.error(
            f"'{name[:80]}' is the name of a {kinds}; since SDFormat 1.7 names differ: rename one"
        )
    return found[0]


def fill(scope: Scope, library: Library, depth: int = 0) -> None:
    """Read the elements of a model or world into its scope, with the models that it nests and includes.

    Raises:
        ModelError: A name is missing or doubled, a file cannot be included, or a nested model is static.
    """
    if depth > DEEPEST:
        raise scope.node.error(f"models are nested more than {DEEPEST} deep")
    for node in scope.node.children("link", "joint", "frame"):
        scope.add_node(node)
    for node in scope.node.children("model", "include"):
        inner, source, own = node, scope.source, node
        if node.tag == "include":
            inner, source = library.open(node, scope.source)
        add_model(scope, inner, source, own, library, depth)


def add_model(scope: Scope, model: Node, source: Source, own: Node, library: Library, depth: int = 0) -> None:
    """Add a nested or included model to a scope.

    Args:
        model: The element `<model>`.
        source: The file in which the model stands.
        own: The element `<include>`, or the model itself.
        library: Opens included files.
        depth: How many models are around the scope.

    Raises:
        ModelError: As for `fill`.
    """
    name = fields.word(own, "name") if own.tag == "include" else ""
    merge = own.tag == "include" and own.flag("merge", False)
    placed = own if own.child("pose") is not None else model
    frame = fields.word(own, "placement_frame") if own.tag == "include" else ""
    if scope.item is not None and fields.flag(own, "static", fields.flag(model, "static")):
        raise own.error(
            "a static model inside another stands still in the world; remove <static>, and join it to the "
            "world by a fixed joint"
        )
    pose = placed.child("pose")
    name = name or model.text("name")
    item = Item("model", name, scope, own, fields.pose(pose), fields.relative_to(pose))
    if placed is model and own is not model and item.relative_to:
        raise own.error(
            f"the model of the included file has a pose relative to '{item.relative_to}', which the file "
            "does not have; write <pose> in <include>"
        )
    frame = frame or str(model.xml.get("placement_frame", "")).strip()
    prefix = scope.prefix if merge or scope.item is None else f"{scope.prefix}{name}::"
    inner = Scope(model, source, item, prefix, frame)
    item.inner = inner
    fill(inner, library, depth + 1)
    if merge:
        scope.merged.append(inner)
    else:
        scope.add(item)
