"""Read the meshes that inertias are computed from; replace all others by a tetrahedron of the same name."""

from __future__ import annotations

import os

from ...errors import ModelError
from ..urdf.xml_node import Node
from .document import Document

#: Corners of the mesh that replaces a mesh that is not needed.
TETRAHEDRON = "0 0 0 1 0 0 0 1 0 0 0 1"

#: What MuJoCo reads.
ENDINGS = (".stl", ".obj", ".msh")

#: Largest number of a built-in mesh: the count of its subdivisions.
MOST_SUBDIVISIONS = 100.0

#: Elements whose children belong to the body around them.
TRANSPARENT = ("frame", "replicate")


def take_meshes(document: Document, contents: dict[str, bytes]) -> None:
    """Read the meshes that inertias need, and replace all others.

    Args:
        document: The file; its tree is changed: paths become names of contents.
        contents: Content of each mesh by the name that the tree now has for it; filled in place.

    Raises:
        ModelError: A mesh that is needed cannot be read.
    """
    needed = _needed(document)
    folder = mesh_folder(document)
    for node in list(document.nodes()):
        above = node.xml.getparent()
        if node.tag != "mesh" or above is None or above.tag != "asset":
            continue
        name = str(
            node.xml.get("name") or os.path.splitext(os.path.basename(str(node.xml.get("file", ""))))[0]
        )
        if name not in needed:
            _replace(node, name)
        elif "file" in node.xml.attrib:
            node.xml.set("name", name)
            key = f"mesh{len(contents)}{os.path.splitext(node.text('file'))[1].lower()}"
            contents[key] = _read(document, node, folder, needed[name])
            node.xml.set("file", key)
        elif "builtin" in node.xml.attrib and "params" in node.xml.attrib:
            _refuse_fine(node)


def _needed(document: Document) -> dict[str, str]:
    """Return the meshes of which an inertia may be made, each with the name of a body that has it."""
    compiler = [node for node in document.nodes() if node.tag == "compiler"]
    always = any(
        node.xml.get("inertiafromgeom") == "true" or "settotalmass" in node.xml.attrib for node in compiler
    )
    out: dict[str, str] = {}
    for node in document.nodes():
        mesh = node.xml.get("mesh")
        if node.tag != "geom" or not mesh:
            continue
        body = node.xml.getparent()
        while body is not None and body.tag in TRANSPARENT:
            body = body.getparent()
        if body is None or body.tag == "worldbody":
            continue
        if always or body.tag == "default" or body.find("inertial") is None:
            out.setdefault(str(mesh), str(body.get("name", "")))
    return out


def mesh_folder(document: Document) -> str:
    """Take the folder of meshes out of `<compiler>`; what is stated last counts."""
    folder = ""
    for tag in ("assetdir", "meshdir"):
        for node in document.nodes():
            if node.tag == "compiler":
                folder = str(node.xml.attrib.pop(tag, folder))
    for node in document.nodes():
        if node.tag == "compiler":
            node.xml.attrib.pop("texturedir", "")
            if node.xml.attrib.pop("strippath", "false") == "true":
                _strip_paths(document)
    return folder


def _strip_paths(document: Document) -> None:
    for node in document.nodes():
        if node.tag == "mesh" and "file" in node.xml.attrib:
            node.xml.set("file", os.path.basename(str(node.xml.get("file"))))


def _read(document: Document, node: Node, folder: str, body: str) -> bytes:
    name = node.text("file")
    if os.path.splitext(name)[1].lower() not in ENDINGS:
        raise node.error(f"mesh '{name}' is none of {', '.join(ENDINGS)}; {_mend(body)}")
    try:
        return document.folders.read(os.path.normpath(document.beside(folder, name)))
    except ModelError as error:
        raise node.error(f"{error}; {_mend(body)}") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise node.error(f"mesh '{name}' cannot be read: {reason}; {_mend(body)}") from None


def _mend(body: str) -> str:
    return (
        f"the inertia of body '{body}' comes from it: put the file there, or give the body an <inertial> "
        "(then hybridyn reads no mesh)"
    )


def _replace(node: Node, name: str) -> None:
    for attribute in set(node.attributes()) - {"class"}:
        del node.xml.attrib[attribute]
    node.xml.set("name", name)
    node.xml.set("vertex", TETRAHEDRON)
    for child in list(node.xml):
        node.xml.remove(child)


def _refuse_fine(node: Node) -> None:
    for word in node.text("params").split():
        try:
            large = abs(float(word)) > MOST_SUBDIVISIONS
        except ValueError:
            large = False
        if large:
            raise node.error(f"a built-in mesh with the parameter {word}, limit {MOST_SUBDIVISIONS:g}")
