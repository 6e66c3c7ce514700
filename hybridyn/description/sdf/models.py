"""The robot's model in SDF files, and its elements with a frame: what names mean, where they stand.

Included files are local ones, in the robot's folders, within limits.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter
from typing import Literal

import numpy as np

from ...errors import ModelError
from ..bounds import refuse_above
from ..groups import Groups
from ..names import did_you_mean, listed
from ..placement import inverse
from ..records import Array
from ..urdf.robot_folders import Includes
from ..urdf.xml_node import XmlNode
from .elements import Notes, check, flag, pose, relative_to, word

#: Oldest and newest version of SDFormat that is read, as (1, minor).
VERSIONS = (3, 12)

#: Models of Gazebo that are only scenery; they are not opened.
SCENERY = ("sun", "ground_plane")

ONE_ROBOT = "hybridyn reads one robot: name it after the file, 'FILE#MODEL', or tie them by joints in <world>"

LEFT_STILL = "static models are left out: {}"

STATIC = (
    "a static model does not move at all, nor do its joints; to hold only its base, remove <static> and "
    "write a fixed joint with <parent>world</parent>"
)

_VERSION = re.compile(r"1\.(\d{1,3})(\.\d+)?")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://(.*)", re.DOTALL)

#: Paths of a file and of those that include it, the outermost first.
Files = tuple[str, ...]

#: The element that places a model (`<include>`, or the model itself), the model, and the files around it.
Placed = tuple[XmlNode, XmlNode, Files]


class SdfFiles:
    """The robot's file and the files that it includes.

    Attributes:
        root: Root element of the robot's own file.
        own: The robot's own file.
        notes: What the files hold that is left out and noted.
        scenery: Names of the models that stand still and are not opened.
        still: The models that stand still, opened.
        chosen: Name of the model that is read, "" for the only one.
    """

    def __init__(
        self, root: XmlNode, package_dirs: Sequence[str | os.PathLike[str]], chosen: str = ""
    ) -> None:
        """Check the robot's own file.

        Args:
            root: Root element `<sdf>`.
            package_dirs: Folders, beside the robot's own, from which files may be included.
            chosen: As above.

        Raises:
            ModelError: The version is not read, or an element is unknown.
        """
        self.root, self.notes, self.chosen = root, Notes(), chosen
        self.scenery: set[str] = set()
        self.still: list[Placed] = []
        self.own: Files = (os.path.abspath(root.file),)
        self._includes = Includes(self.own[0], [os.fspath(folder) for folder in package_dirs])
        minor_of(root)
        check(root, self.notes)

    def moving(self) -> list[Placed]:
        """Return the models that can move; note the static ones.

        Raises:
            ModelError: There is no such model, or none of the chosen name.
        """
        world = self.root.child("world")
        found: list[Placed] = []
        for own in (*self.root.children("model"), *(world.children("model", "include") if world else ())):
            _, _, folder = word(own, "uri").rstrip("/").rpartition("/")
            if folder in SCENERY:
                self.scenery |= {folder, word(own, "name") or folder}
                self._leave_out(folder)
                continue
            model, files = self.open(own, self.own)
            if flag(own, "static", flag(model, "static")):
                self._leave_out(name_of(own, model))
                self.still.append((own, model, files))
            else:
                found.append((own, model, files))
        if not found:
            still = self.notes.get(LEFT_STILL)
            static = f"no model that moves, only {listed(still or ())}; {STATIC}"
            raise self.root.error(static if still else "no <model>; a robot is one")
        return self._chosen(found)

    def _leave_out(self, name: str) -> None:
        self.notes.setdefault(LEFT_STILL, []).append(name)

    def _chosen(self, found: list[Placed]) -> list[Placed]:
        """Return the models among which the robot is: the chosen one alone, unless the world ties models."""
        names = [name_of(own, model) for own, model, _ in found]
        if not self.chosen:
            return found
        if self.chosen not in names:
            hint = did_you_mean(self.chosen, names)
            raise self.root.error(
                f"no model that moves is named '{self.chosen}'{hint}; known: {listed(names)}"
            )
        world = self.root.child("world")
        if world is not None and world.children("joint", "frame"):
            return found
        return [one for one, name in zip(found, names, strict=True) if name == self.chosen]

    def open(self, node: XmlNode, files: Files) -> tuple[XmlNode, Files]:
        """Return the model of an `<include>` with the files around it, or a model itself.

        Raises:
            ModelError: The file is not local, cannot be read, includes itself, or holds no single model.
        """
        if node.tag != "include":
            return node, files
        uri = node.required_child("uri")
        name = uri.content()
        path = self._locate(uri, name, files[-1])
        if os.path.realpath(path) in map(os.path.realpath, files):
            raise uri.error(f"'{name}' includes itself")
        root, path = self._includes.opened(uri, name, [path])
        if root.tag != "sdf":
            raise uri.error(f"the root element of '{name}' is <{root.tag}> instead of <sdf>")
        self.notes |= {note: [name] for note in root.notes}
        minor_of(root)
        check(root, self.notes)
        models = root.children("model")
        if len(models) != 1 or root.children("world"):
            raise uri.error(f"'{name}' holds {len(models)} models; an included file holds one <model>")
        return models[0], (*files, path)

    def _locate(self, uri: XmlNode, name: str, file: str) -> str:
        """Return the path of the file that another one includes.

        Raises:
            ModelError: It is not local, or there is no such package.
        """
        match = _SCHEME.fullmatch(name)
        scheme, rest = (match[1].lower(), match[2]) if match else ("", name)
        if scheme in ("model", "package"):
            package, _, below = rest.strip("/").partition("/")
            try:
                path = os.path.join(self._includes.find(package), below)
            except ModelError as error:
                raise uri.error(str(error).replace("package", scheme, 1)) from None
        elif scheme in ("", "file"):
            path = os.path.join(os.path.dirname(file), rest)
        else:
            raise uri.error(f"'{name[:80]}' is not a local file; download it, and write its path")
        return os.path.join(path, self._file_of_model(uri, path)) if os.path.isdir(path) else path

    def _file_of_model(self, uri: XmlNode, folder: str) -> str:
        """Return the name of the SDF file in a folder: the newest that `model.config` states."""
        config = os.path.join(folder, "model.config")
        stated = {0: "model.sdf"}
        if os.path.isfile(config):
            root, _ = self._includes.opened(uri, config, [config])
            for node in root.children("sdf"):
                match = _VERSION.fullmatch(node.attrib.get("version", "1.4").strip())
                if match and VERSIONS[0] <= int(match[1]) <= VERSIONS[1]:
                    stated[int(match[1])] = node.content()
        return stated[max(stated)]


def name_of(own: XmlNode, model: XmlNode) -> str:
    """Return the name of a model, which the element `<include>` may name otherwise."""
    return (word(own, "name") if own.tag == "include" else "") or model.text("name")


def minor_of(node: XmlNode) -> int:
    """Return the minor number of the version of an element's file.

    Raises:
        ModelError: This version is not read.
    """
    root = XmlNode(node.xml.getroottree().getroot(), node.file)
    text = root.text("version")
    match = _VERSION.fullmatch(text)
    if not match or not VERSIONS[0] <= int(match[1]) <= VERSIONS[1]:
        raise root.error(
            f"version '{text[:20]}' of SDFormat is not read; known: 1.3 to 1.12 (`gz sdf -p` converts older "
            "ones)"
        )
    return int(match[1])


Kind = Literal["link", "joint", "frame", "model"]

#: Kinds of elements with a name, in the order in which a name before SDFormat 1.7 is looked up.
KINDS: tuple[Kind, ...] = ("link", "frame", "joint", "model")

#: Name of a model's own frame.
MODEL = "__model__"


@dataclass(eq=False)
class Item:
    """An element with a frame.

    Attributes:
        kind: What it is; the frame of a model has kind "model".
        name: Its name.
        scope: The model in which it stands, None for the world.
        node: The element.
        model: The element `<model>` of an included model, else the element itself.
        still: Whether it is of a static model.
        merged: Whether it is the frame of a model whose elements belong to the model around it.
        full_name: Its name with the names of the nested models around it, as Gazebo joins them.
    """

    kind: Kind
    name: str
    scope: Item | None
    node: XmlNode
    model: XmlNode
    still: bool = False
    merged: bool = False
    full_name: str = ""

    def __post_init__(self) -> None:
        stated = self.node.child("pose") or (self.model.child("pose") if self.kind == "model" else None)
        self.pose, self.relative_to = pose(stated), relative_to(stated)
        self.minor = minor_of(self.model)

    @property
    def path(self) -> str:
        """Its name with those of all models around it."""
        return inside(self.scope) + self.name

    @property
    def scopes(self) -> Iterator[Item]:
        """The models around it, the innermost first."""
        scope = self.scope
        while scope is not None:
            yield scope
            scope = scope.scope

    @property
    def placement_frame(self) -> str:
        """Name of the frame in a model that stands at the model's pose, "" for the model's own."""
        stated = word(self.node, "placement_frame") if self.node.tag == "include" else ""
        return stated or self.model.attrib.get("placement_frame", "").strip()


def inside(scope: Item | None) -> str:
    """Return what stands before the names of elements in a model or the world (None)."""
    if scope is None:
        return ""
    return inside(scope.scope) if scope.merged else f"{scope.path}::"


class SdfModels:
    """The elements of the robot's models and of the world around them, in the order of the file.

    Attributes:
        name: Name of the robot.
        robot: The robot's model, the first of several.
        world: The element `<world>`, or the root element.
    """

    def __init__(self, library: SdfFiles) -> None:
        """Read every element that has a name.

        Raises:
            ModelError: There is not one robot, a name is missing or doubled, a frame is unknown, frames stand
                relative to each other in a circle, or a nested model is static.
        """
        self._library = library
        self._items: dict[str, dict[Kind, Item]] = {}
        self.world = library.root.child("world") or library.root
        placed = library.moving()
        every = [self._add_model(own, model, None, files) for own, model, files in placed]
        around = self.world.children("frame", "joint") if self.world.tag == "world" else []
        for own, model, files in library.still if around else ():
            self._add_model(own, model, None, files, still=True)
        for node in around:
            self._add(node, None)
        self._links: dict[Item | None, Item | None] = {None: None}
        for item, holder in self._ordered(self._carrier, "frames are attached to each other in a circle: {}"):
            self._links[item] = self._links[holder] if item.kind != "link" or item.still else item
        roots = self._tied(every)
        self.robot = roots[0]
        self.name = self.robot.name if len(roots) == 1 else self.world.text("name")
        for item in self.every(*KINDS):
            item.full_name = item.path.removeprefix(f"{self.robot.path}::" if len(roots) == 1 else "")
        self._poses: dict[Item | None, Array] = {None: np.eye(4)}
        for item, base in self._ordered(self._base, "poses are relative to each other in a circle: {}"):
            self._poses[item] = self._poses[base] @ self._local(item)

    def _tied(self, models: list[Item]) -> list[Item]:
        """Return the models of the robot, which joints of the world tie, and take all others for still.

        Raises:
            ModelError: There are several robots, and none is chosen.
        """
        groups: Groups[str] = Groups()
        ties = [item for item in self.every("joint") if item.scope is None]
        ends = {item: self._ends(item) for item in ties}
        for one, other in ends.values():
            if one is not None and other is not None:
                groups.join(one.name, other.name)
        chosen = self._library.chosen
        first = next((one for one in models if one.name == chosen), models[0])
        robot = [one for one in models if groups.of(one.name) == groups.of(first.name)]
        if len(robot) < len(models) and not chosen:
            names = listed(one.name for one in models)
            raise self._library.root.error(f"{len(models)} models that move: {names}; {ONE_ROBOT}")
        for item in self.every(*KINDS):
            model = [*item.scopes][-1] if item.scope is not None else item
            owners = [one for one in ends.get(item, (model,)) if one is not None]
            item.still |= item.kind != "frame" and not any(one in robot for one in owners)
        return robot

    def _ends(self, joint: Item) -> list[Item | None]:
        """Return the outermost models that a joint of the world ties, None for the world."""
        ends = [joint.node.required_child(tag) for tag in ("parent", "child")]
        links = [self.link(None, end.content(), end) for end in ends]
        return [None if one is None else [*one.scopes][-1] for one in links]

    def every(self, *kinds: Kind) -> Iterator[Item]:
        """Yield the elements of some kinds, but for those of static models."""
        return (item for item in self._all(*kinds) if not item.still)

    def _all(self, *kinds: Kind) -> Iterator[Item]:
        for items in self._items.values():
            yield from (item for kind, item in items.items() if kind in kinds)

    def pose(self, item: Item | None) -> Array:
        """Return the pose of an element in the world, shape (4, 4); None is the world itself."""
        return self._poses[item]

    def find(self, scope: Item | None, name: str) -> dict[Kind, Item]:
        """Return the elements that a name can mean in a model or the world, one a kind."""
        return self._items.get(f"{inside(scope)}{name}".removesuffix(f"::{MODEL}"), {})

    def resolve(self, scope: Item | None, name: str, node: XmlNode) -> Item | None:
        """Return the element that a name means, None for the world.

        Args:
            scope: The model in which the name stands, None for the world.
            name: Name of a link, frame, joint or model; names of nested models stand before it, with `::`.
            node: The element that states it.

        Raises:
            ModelError: There is no such element, or several.
        """
        if name == MODEL or (name == "world" and scope is None):
            return scope
        if name == "world" and "link" in self.find(scope, name):
            return self.find(scope, name)["link"]
        if scope is None and name.partition("::")[0] in self._library.scenery:
            return None
        if name == "world":
            raise node.error(
                "the elements of a model do not know the frame of the world, as in sdformat; name a <frame> "
                "of the model, or state the pose of the model in <world>"
            )
        found = self.find(scope, name)
        if not found:
            known = [item.name for item in self._all(*KINDS) if inside(item.scope) == inside(scope)]
            hint = did_you_mean(name, known) or f"; known: {listed(known) or 'none'}"
            raise node.error(f"unknown frame '{name[:80]}'{hint}")
        kinds = [kind for kind in KINDS if kind in found]
        if len(kinds) > 1 and scope is not None and scope.minor >= 7:
            raise node.error(
                f"'{name[:80]}' is the name of a {' and a '.join(kinds)}; since SDFormat 1.7 names differ: "
                "rename one"
            )
        return found[kinds[0]]

    def link(self, scope: Item | None, name: str, node: XmlNode) -> Item | None:
        """Return the link that carries a frame, None for the world; the arguments are those of `resolve`."""
        return None if self._is_world(scope, name) else self._links[self.resolve(scope, name, node)]

    def _is_world(self, scope: Item | None, name: str) -> bool:
        """Return whether a name of a link is that of the world: no link of the model has it."""
        return name == "world" and "link" not in self.find(scope, name)

    def _add(
        self,
        node: XmlNode,
        scope: Item | None,
        model: XmlNode | None = None,
        *,
        still: bool = False,
        merged: bool = False,
    ) -> Item:
        kind: Kind = {"include": "model"}.get(node.tag, node.tag)  # type: ignore[assignment]
        name = name_of(node, model or node)
        name = f"_merged__{name}__model__" if merged else name
        item = Item(kind, name, scope, node, model or node, still, merged)
        own = item.name.startswith("__") and item.name.endswith("__")
        if own or (item.name == "world" and kind != "link"):
            raise node.error(f"the name '{item.name}' is SDFormat's own; rename it")
        items = self._items.setdefault(item.path, {})
        if kind in items:
            raise node.error(f"is stated twice (first in {items[kind].node.where}); rename one")
        items[kind] = item
        return item

    def _add_model(
        self,
        own: XmlNode,
        model: XmlNode,
        scope: Item | None,
        files: Files,
        depth: int = 0,
        *,
        still: bool = False,
    ) -> Item:
        """Add a model with all that it nests and includes."""
        refuse_above("depth of models", depth, model.error)
        merged = own.tag == "include" and own.flag("merge", False)
        if merged and scope is None:
            raise own.error(
                "links do not stand in a <world>; remove merge, or include the model in a <model>"
            )
        item = self._add(own, scope, model, still=still, merged=merged)
        if own is not model and own.child("pose") is None and item.relative_to:
            raise own.error(
                f"the model of the included file has a pose relative to '{item.relative_to}', which the file "
                "does not have; write <pose> in <include>"
            )
        for node in model.children("link", "joint", "frame"):
            self._add(node, item, still=still)
        for node in model.children("model", "include"):
            inner, around = self._library.open(node, files)
            if not still and flag(node, "static", flag(inner, "static")):
                raise node.error(
                    "a static model inside another stands still in the world; remove <static>, and join it "
                    "to the world by a fixed joint"
                )
            self._add_model(node, inner, item, around, depth + 1, still=still)
        return item

    def _ordered(
        self, before: Callable[[Item], Item | None], circle: str
    ) -> Iterator[tuple[Item, Item | None]]:
        """Yield every element after the one that it needs, with that; a `circle` of them is an error."""
        needs = {item: before(item) for item in self._all(*KINDS)}
        try:
            order = [*TopologicalSorter({item: [need] for item, need in needs.items()}).static_order()]
        except CycleError as error:
            found = [item for item in error.args[1][1:] if item is not None]
            raise found[0].node.error(circle.format(listed(item.name for item in found))) from None
        yield from ((item, needs[item]) for item in order if item is not None)

    def _base(self, item: Item) -> Item | None:
        """Return the element relative to which a pose is stated, None for the world."""
        if item.relative_to:
            return self.resolve(item.scope, item.relative_to, item.node)
        return item.scope if item.kind in ("link", "model") else self._holder(item)

    def _holder(self, item: Item) -> Item | None:
        """Return what holds the frame of a joint (its child) or of a `<frame>`; None for the world."""
        if item.kind == "frame":
            name = item.node.attrib.get("attached_to", "").strip()
            return self.resolve(item.scope, name, item.node) if name else item.scope
        child = item.node.required_child("child")
        if self._is_world(item.scope, child.content()):
            return None
        return self.resolve(item.scope, child.content(), child)

    def _carrier(self, item: Item) -> Item | None:
        """Return what carries a frame: of a model its first link."""
        if item.kind == "link":
            return None
        if item.kind != "model":
            return self._holder(item)
        if stated := item.model.attrib.get("canonical_link", "").strip():
            return self.resolve(item, stated, item.model)
        first = next((one for one in self._all("link") if item in one.scopes), None)
        if first is None:
            raise item.model.error("the model has no <link>; a robot has at least one")
        return first

    def _local(self, item: Item) -> Array:
        """Return the pose of an element in that relative to which it is stated, shape (4, 4).

        Raises:
            ModelError: The placement frame of a model is not in it.
        """
        if item.kind != "model" or not item.placement_frame:
            return item.pose
        at, one = np.eye(4), self.resolve(item, item.placement_frame, item.node)
        while one is not None and one is not item:
            at, one = self._local(one) @ at, self._base(one)
        if one is None:
            raise item.node.error(f"its placement frame '{item.placement_frame}' is not in the model")
        return item.pose @ inverse(at)
