"""Merge an MJCF file with its includes, open the models that it attaches, and screen what MuJoCo compiles.

hybridyn opens these files, not MuJoCo: only in the robot's folders, and with the limits of all robot files.
Visuals, sensors, cameras, lights and contacts are removed: they do not change the dynamics that hybridyn
computes. Meshes are read only where inertias are computed from them; a tetrahedron of the same name stands
for any other. MuJoCo then opens no files, and allocates memory for the robot only.
"""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import cast

from lxml import etree

from ..bounds import refuse_above
from ..urdf.robot_folders import Includes
from ..urdf.xml_node import LARGEST_NUMBER, XmlNode

#: Folders whose neighbours belong to the robot, too: `robot/mjcf/robot.xml` reads `robot/meshes/`.
FILE_FOLDERS = ("mjcf", "xml", "mujoco")

#: Attribute that marks the elements of an included file: its number in `Document.files`.
FILE = "{hybridyn}file"

#: Root elements of an included file.
INCLUDED_ROOTS = ("mujoco", "mujocoinclude")


#: File and line of an element, as in `XmlNode.place`.
Place = tuple[str, int | None]


class Document:
    """An MJCF file merged with its includes.

    Attributes:
        root: Root element; included elements replace their `<include>`.
        includes: Opens files.
        key: Name of the file in the tree that attaches it, "" of the robot's own.
        files: Paths of the files, the robot's own first.
        notes: What is not well-formed in included files, and what is read past.
        models: The files of `<model>`.
    """

    def __init__(self, root: XmlNode, package_dirs: list[str], within: Document | None = None) -> None:
        """Merge all included files, and open all attached ones.

        Args:
            root: Root element; it is changed.
            package_dirs: Folders that the user allows.
            within: The file that attaches this one: its folders and limits hold for both.

        Raises:
            ModelError: A file cannot be read, or is named twice.
        """
        main = os.path.abspath(root.file)
        around = Path(main).parent
        granted = [str(around.parent)] if around.name in FILE_FOLDERS else []
        self.root, self.key, self.files, self._paths = root, "", [root.file], [main]
        self.notes = [*root.notes] if within else list[str]()
        self.includes: Includes = within.includes if within else Includes(main, package_dirs, granted)
        self._seen: set[str] = within._seen if within else {os.path.realpath(main)}
        waiting = [*root.xml.iter("include")]
        while waiting:
            waiting += self._include(waiting.pop(0))
        self.models: list[Document] = []
        for node in self.nodes("//model[@file]"):
            inner, _ = self._opened(node, self.files.index(node.file))
            self.models.append(Document(inner, package_dirs, self))
            self.models[-1].key = f"model{len(self._seen)}.xml"  # unlike those of the other files
            node.xml.set("file", self.models[-1].key)

    def every(self) -> list[Document]:
        """Return this file and all that it attaches."""
        return [self, *(inner for model in self.models for inner in model.every())]

    def nodes(self, path: str = "//*") -> list[XmlNode]:
        """Return the elements of an XPath, by default all, a parent before its children, with their files."""
        found = cast("list[etree._Element]", self.root.xml.getroottree().xpath(path))
        return [XmlNode(xml, self.files[int(xml.get(FILE, 0))]) for xml in found]

    def text(self) -> tuple[str, list[Place]]:
        """Write the tree, one start or end of an element a line; return also the place of each line."""
        places: list[Place] = []
        for event, xml in etree.iterwalk(self.root.xml, events=("start", "end")):
            xml.text, xml.tail = "\n" if len(xml) else None, "\n"
            if event == "start" or len(xml):
                places.append(XmlNode(xml, self.files[int(xml.get(FILE, 0))]).place)
        etree.strip_attributes(self.root.xml, FILE)
        etree.cleanup_namespaces(self.root.xml)
        return etree.tostring(self.root.xml, encoding="unicode"), places

    def _include(self, xml: etree._Element) -> list[etree._Element]:
        """Put the elements of a file in place of `<include>`, and return the includes among them."""
        number = int(xml.attrib.pop(FILE, "0"))
        node, parent = XmlNode(xml, self.files[number]), xml.getparent()
        node.only(["file"], [])
        inner, path = self._opened(node, number)
        if inner.tag not in INCLUDED_ROOTS or parent is None:
            name = node.text("file")
            raise node.error(f"the root element of '{name}' is <{inner.tag}> instead of <mujocoinclude>")
        self.files.append(inner.file)
        self._paths.append(path)
        self.notes += inner.notes
        for one in inner.xml.iter("*"):
            one.set(FILE, str(len(self.files) - 1))
        includes, at = [*inner.xml.iter("include")], parent.index(xml)
        parent[at : at + 1] = [*inner.xml]
        return includes

    def _opened(self, node: XmlNode, number: int) -> tuple[XmlNode, str]:
        """Return the root of a file that an element of file `number` names, and the file's path.

        Its path starts at the robot's file, else at the file that names it.
        """
        name = node.text("file")
        inner, path = self.includes.opened(node, name, (self.beside(name, start) for start in (0, number)))
        real = os.path.realpath(path)
        if real in self._seen:
            raise node.error(f"file '{name}' is included twice; MuJoCo includes a file once")
        self._seen.add(real)
        return inner, path

    def beside(self, path: str, number: int = 0) -> str:
        """Return a path that starts at the folder of a file, by default the robot's own."""
        return os.path.join(os.path.dirname(self._paths[number]), path)


#: Elements that do not change the dynamics that hybridyn computes.
LEFT_OUT = {
    "visual", "statistic", "size", "sensor", "custom", "contact", "camera", "light", "texture", "material",
    "skin", "pair", "exclude", "extension",
}  # fmt: skip

#: How to mend a file with deformable bodies.
RIGID = "hybridyn's bodies are rigid: describe it by rigid bodies and springs"

#: Elements that are refused, with a description and the correction.
REFUSED = {
    "flexcomp": f"a deformable body; {RIGID}",
    "flex": f"a deformable body; {RIGID}",
    "plugin": "a plugin, whose forces hybridyn cannot know; remove it, and put springs and dampers on joints",
}

#: Attributes that hold names, which may look like numbers.
NAMES = {
    "name", "class", "childclass", "joint", "joint1", "joint2", "body", "body1", "body2", "site", "site1",
    "site2", "tendon", "tendon1", "tendon2", "mesh", "hfield", "material", "prefix", "file", "model", "geom",
    "geom1", "geom2", "jointinparent", "cranksite", "slidersite", "refsite", "target", "meshdir",
    "texturedir", "assetdir",
}  # fmt: skip

#: Attributes that `<plugin>` in `<actuator>` has in common with motors.
OF_ACTUATORS = {
    "name", "class", "joint", "jointinparent", "tendon", "site", "refsite", "body", "cranksite", "slidersite",
    "gear", "forcerange", "forcelimited", "armature", "damping",
}  # fmt: skip

#: Largest number of a built-in mesh: the count of its subdivisions.
MOST_SUBDIVISIONS = 100.0

#: Corners of the mesh that replaces a mesh that is not needed.
TETRAHEDRON = "0 0 0 1 0 0 0 1 0 0 0 1"

#: Meshes that MuJoCo reads.
ENDINGS = (".stl", ".obj", ".msh")

#: Elements whose children belong to the body around them.
TRANSPARENT = ("frame", "replicate")


def screen(document: Document, meshes: dict[str, bytes]) -> None:
    """Refuse what cannot be read, and remove what does not change the dynamics.

    Args:
        document: The file; its tree is changed: paths of meshes become names of contents.
        meshes: Content of each mesh by the name that the tree now has for it; filled in place.

    Raises:
        ModelError: An element is refused, a number is not finite, a mesh that is needed cannot be read, or
            elements are too many.
    """
    for node in document.nodes():
        if node.tag in LEFT_OUT:
            _take_out(node.xml)
        elif node.tag == "plugin":
            _take_plugin(document, node)
    _take_meshes(document, meshes)
    for node in document.nodes():
        if node.tag in REFUSED:
            raise node.error(REFUSED[node.tag])
        for name in {*node.attributes()} - NAMES:
            _refuse_unbounded(node, name)
        node.xml.attrib.pop("material", "")
        if node.tag == "hfield":  # a terrain has no mass, and may be large: a flat one stands for it
            _stand_in(node, "size", nrow="2", ncol="2")
    _refuse_too_many(document)


def mesh_folder(document: Document) -> str:
    """Take the folder of meshes out of `<compiler>`; what is stated last counts."""
    stated = {
        name: str(node.xml.attrib.pop(name))
        for node in document.nodes("//compiler")
        for name in ("assetdir", "meshdir", "texturedir", "strippath")
        if name in node.xml.attrib
    }
    if stated.get("strippath") == "true":
        for node in document.nodes("//mesh[@file]"):
            node.xml.set("file", os.path.basename(str(node.xml.get("file"))))
    return stated.get("meshdir", stated.get("assetdir", ""))


def _take_plugin(document: Document, node: XmlNode) -> None:
    """Take a plugin out that only makes a shape; one in `<actuator>` becomes a servo, whose law is not read.

    A geom of such a shape is taken out where the body states its inertia. Others are refused later.
    """
    above = node.xml.getparent()
    assert above is not None
    what = f"<plugin> in <{above.tag}> is not read: it only makes a shape"
    if above.tag == "actuator":
        node.xml.tag = "general"
        for name in {*node.attributes()} - OF_ACTUATORS:
            del node.xml.attrib[name]
        node.xml.set("biastype", "affine")
        del node.xml[:]
    elif above.tag == "geom" and _has_mass(_body(above)):
        _take_out(above)
        document.notes.append(f"{node.at}: {what}, without mass")
    elif above.tag == "mesh":
        _take_out(node.xml)
        document.notes.append(f"{node.at}: {what}")


def _take_meshes(document: Document, contents: dict[str, bytes]) -> None:
    """Read the meshes that inertias need, and replace all others."""
    always = document.nodes("//compiler[@inertiafromgeom='true' or @settotalmass]")
    needed: dict[str, str] = {}
    for node in document.nodes("//geom[@mesh]"):
        body = _body(node.xml)
        if body.tag != "worldbody" and (always or not _has_mass(body)):
            needed.setdefault(str(node.xml.get("mesh")), str(body.get("name", "")))
    folder = document.beside(mesh_folder(document))
    for node in document.nodes("//asset/mesh"):
        name = _name(node)
        if name not in needed:
            _stand_in(node, "class", vertex=TETRAHEDRON)
        elif "file" in node.xml.attrib:
            mend = (
                f"; the inertia of body '{needed[name]}' comes from it: put the file there, or give the body "
                "an <inertial> (then hybridyn reads no mesh)"
            )
            ending = os.path.splitext(node.text("file"))[1].lower()
            if ending not in ENDINGS:
                raise node.error(f"mesh '{node.text('file')}' is none of {', '.join(ENDINGS)}{mend}")
            key = f"mesh{len(contents)}{ending}"
            file = node.text("file")
            contents[key], _ = document.includes.named(node, file, _places(document, node, folder), mend)
            node.xml.attrib.update({"name": name, "file": key})


def _places(document: Document, node: XmlNode, folder: str) -> list[str]:
    """Return where a mesh may be: in the folder of meshes, else beside the included file that names it."""
    file, number = node.text("file"), document.files.index(node.file)
    return [os.path.join(folder, file), *([document.beside(file, number)] if number else [])]


def _body(xml: etree._Element) -> etree._Element:
    """Return the body, world or class to which an element in it belongs."""
    return next(above for above in xml.iterancestors() if above.tag not in TRANSPARENT)


def _has_mass(body: etree._Element) -> bool:
    """Say whether a body needs no geom for its mass: it states it, or it is the world."""
    return body.tag == "worldbody" or body.find("inertial") is not None


def _name(node: XmlNode) -> str:
    """Return the name of an asset, which is that of its file where it states none."""
    stem, _ = os.path.splitext(os.path.basename(str(node.xml.get("file", ""))))
    return str(node.xml.get("name") or stem)


def _take_out(xml: etree._Element) -> None:
    if (parent := xml.getparent()) is not None:
        parent.remove(xml)


def _stand_in(node: XmlNode, kept: str, **attributes: str) -> None:
    """Replace an asset by another one of the same name, which keeps one of its attributes."""
    attributes["name"] = _name(node)
    for name in {*map(str, node.xml.attrib)} - {kept, FILE}:
        del node.xml.attrib[name]
    del node.xml[:]
    for name, value in attributes.items():
        node.xml.set(name, value)


def _refuse_unbounded(node: XmlNode, name: str) -> None:
    """Refuse numbers that are not finite or absurdly large; ranges may be infinite."""
    limit = MOST_SUBDIVISIONS if name == "params" else LARGEST_NUMBER
    for word in str(node.xml.get(name)).split():
        try:
            size = abs(float(word))
        except ValueError:
            continue  # MuJoCo refuses what is no number where it needs one
        if math.isnan(size) or (math.isinf(size) and word[-1].isalpha() and not name.endswith("range")):
            raise node.error(f"attribute '{name}': '{word}' is not a finite number")
        if size > limit and not word[-1].isalpha():
            raise node.error(f"attribute '{name}': '{word[:40]}' is too large (limit {limit:g})")


def _counts(node: XmlNode) -> list[float]:
    """Return the counts of a composite along its axes; MuJoCo refuses what is no number."""
    words = str(node.xml.get("count", "")).split()
    return [float(word) for word in words if word.lstrip("+-").replace(".", "", 1).isdigit()]


def _refuse_too_many(document: Document) -> None:
    """Refuse a robot that would take MuJoCo minutes, or all memory."""
    factors: dict[object, float] = {}
    total, attached = 0.0, sum(len(model.nodes()) for model in document.every()[1:])
    for node in document.nodes():
        factor = factors.get(node.xml.getparent(), 1.0)
        if node.tag == "replicate":
            factor *= max(1.0, abs(node.number("count")))
        if node.tag == "composite":
            factor *= math.prod(max(1.0, abs(x)) for x in _counts(node))
        factors[node.xml] = factor
        total += factor * (1 + attached if node.tag == "attach" else 1)
        refuse_above("replicas", total, node.error)
