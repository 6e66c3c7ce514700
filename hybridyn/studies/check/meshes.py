"""Checks of shapes and meshes: that they can be read, and have the robot's unit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...description.names import counted
from ...errors import install_advice
from .finding import Finding
from .shapes import UNREAD, LinkShape
from .subject import Subject

#: A mesh that is larger than its robot by this factor has another unit.
MESH = 50.0


def check_shapes(subject: Subject) -> Iterator[Finding]:
    """Check that shapes and meshes can be read, and that meshes have the robot's unit; each mesh once."""
    known, unread = set[object](), set[str]()
    for link, shape in ((link, shape) for link, shapes in subject.shapes.items() for shape in shapes):
        if shape.mesh is None and shape.wrong is not None:
            finding = subject.of_link(
                "broken-shape",
                link,
                f"its {shape.role} shape cannot be read: {shape.wrong}",
                "it is not drawn or converted, and the link's mass cannot be compared with it",
                "correct the element that the message names, or remove the shape",
                shape.line,
            )
            if (said := (finding.message, finding.place)) not in known:  # one macro writes many
                known.add(said)
                yield finding
        elif shape.mesh is not None and shape.mesh not in known:
            known.add(shape.mesh)
            unread |= {shape.mesh} if shape.wrong == UNREAD else set()
            yield from _mesh(subject, link, shape, shape.mesh)
    if unread:
        yield Finding(
            "unread-meshes",
            "",
            f"{counted(len(unread), 'mesh file')} not read: trimesh is not installed",
            "masses, inertias and units cannot be compared with these shapes",
            install_advice("view"),
            subject.description.source,
        )


def _mesh(subject: Subject, link: str, shape: LinkShape, mesh: str) -> Iterator[Finding]:
    """Check a mesh of a link."""
    unseen = "the link is not drawn, and its mass cannot be compared with its shape"
    if shape.wrong == "missing":
        mend = "add the file, or name the folder of its package with --package-dir"
        yield subject.of_link("missing-mesh", link, f"mesh '{mesh}' is missing", unseen, mend, shape.line)
    elif shape.wrong not in (None, UNREAD):
        mend = "export it again as STL, DAE or OBJ"
        yield subject.of_link("broken-mesh", link, f"mesh '{mesh}' {shape.wrong}", unseen, mend, shape.line)
    elif shape.corners is not None:
        own = float(np.linalg.norm(np.ptp(shape.corners, axis=0)))
        if own > MESH * subject.extent > 0:
            yield subject.of_link(
                "mesh-scale",
                link,
                f"mesh '{mesh}' spans {own:.3g} m in a robot of {subject.extent:.3g} m",
                "drawings, and checks that use shapes, are meaningless",
                'meshes in millimetres need <mesh scale="0.001 0.001 0.001">',
                shape.line,
            )
