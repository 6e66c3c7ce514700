"""Find the mesh files that an MJCF or SDF file names and that are missing. `shapes` reads those of a URDF."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from ...description.mjcf.document import Document, mesh_folder
from ...description.sdf.models import Library
from ...description.shape_files import MeshFiles, MissingMeshError
from ...description.urdf.xml_node import Node
from ...errors import ModelError
from .finding import Finding
from .subject import Subject


def check_meshes(subject: Subject) -> Iterator[Finding]:
    """Find missing mesh files of MJCF and SDF, each once; the root element may be changed."""
    readers = {"mujoco": _of_mjcf, "sdf": _of_sdf}
    reported: set[str] = set()
    for node, name, missing in readers[subject.root.tag](subject) if subject.root.tag in readers else ():
        if missing and name not in reported:
            reported.add(name)
            yield Finding(
                "missing-mesh",
                _owner(node),
                f"mesh '{name}' is missing",
                "no inertia comes from it, but other programs refuse the file or do not draw the shape",
                "add the file, or name the folder of its package with --package-dir",
                *node.place,
            )


def _of_mjcf(subject: Subject) -> Iterator[tuple[Node, str, bool]]:
    """Yield each mesh of an MJCF file, its file's name, and whether there is no such file."""
    document = Document(subject.root, [os.fspath(folder) for folder in subject.package_dirs])
    folder = mesh_folder(document)
    for node in document.nodes("//asset/mesh[@file]"):
        name = node.text("file")
        yield node, name, not os.path.isfile(document.beside(folder, name))


def _of_sdf(subject: Subject) -> Iterator[tuple[Node, str, bool]]:
    """Yield each mesh of an SDF file and of the files that it includes, as `_of_mjcf`."""
    library = Library(subject.root, subject.package_dirs)
    waiting = [(subject.root, library.own)]
    while waiting:
        root, files = waiting.pop()
        find = MeshFiles(Path(files[-1]).parent, subject.package_dirs)
        for node in root.descendants():
            if node.tag == "include":
                with contextlib.suppress(ModelError):  # of a model that is not read
                    waiting.append(library.open(node, files))
            elif node.tag == "mesh" and (uri := node.child("uri")) is not None:
                try:
                    find(uri.content())
                    missing = False
                except MissingMeshError:
                    missing = True
                yield uri, uri.content(), missing


def _owner(node: Node) -> str:
    """Return the link around a mesh, in words, or the mesh itself."""
    link = next(node.xml.iterancestors("link"), None)
    return (
        f"mesh '{node.xml.get('name') or node.text('file')}'"
        if link is None
        else f"link '{link.get('name')}'"
    )
