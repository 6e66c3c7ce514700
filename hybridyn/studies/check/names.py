"""Check names, shapes and meshes: duplicates, links without a role, what is missing, the reader's remarks."""

from __future__ import annotations

from collections.abc import Iterator

from ...description.urdf.xml_node import Node
from ...errors import install_advice
from .finding import Finding
from .shapes import UNREAD
from .subject import Subject

NAMED = ("link", "joint", "loop", "constraint", "loop_joint", "coupling")
REPORTED_ELSEWHERE = ("unphysical inertia", "no file says which joints", "both ignored")


def duplicated_names(root: Node) -> list[Finding]:
    """Return a finding for every name that two elements of one kind share. Such a file cannot be read."""
    out = []
    for kind in NAMED:
        known: dict[str, tuple[str, int | None]] = {}
        for node in root.children(kind):
            name = str(node.xml.get("name", "")).strip()
            if name and name in known:
                place = node.place
                first = "" if known[name] == place else ", first in {}:{}".format(*known[name])
                out.append(
                    Finding(
                        "duplicate-name",
                        f"{kind} '{name}'",
                        f"is stated twice{first}",
                        "a reference to the name may mean either element",
                        "rename one of the two, and every reference to it",
                        *place,
                    )
                )
            elif name:
                known[name] = node.place
    return out


def check_names(subject: Subject) -> Iterator[Finding]:
    """Check names and roles, and pass on the reader's remarks."""
    description = subject.description
    for name in subject.links.keys() & subject.joints.keys():
        yield subject.of_link(
            "same-name",
            name,
            "a joint has the same name",
            "Pinocchio's getFrameId rejects a name of two frames; hybridyn distinguishes them",
            "rename one of them if you use robot.model directly",
        )
    yield from _unused(subject)
    for note in description.notes:
        if not any(text in note for text in REPORTED_ELSEWHERE):
            yield Finding(
                "reader",
                "",
                note,
                "something in the file was ignored or interpreted in a particular way",
                "nothing to do if that is what you intend",
                description.source,
            )


def _unused(subject: Subject) -> Iterator[Finding]:
    """Find links that could be omitted: no mass, no shape, no child link and no closure."""
    description = subject.description
    used = {joint.parent for joint in description.joints}
    used |= {link for closure in description.closures for link in (closure.link_a, closure.link_b)}
    text = repr(description.effects)
    for link in description.links:
        joint = subject.joint_above.get(link.name)
        idle = not (link.mass or link.inertia.any() or link.name in used or link.name in subject.shapes)
        if idle and joint is not None and joint.kind == "fixed" and f"'{link.name}'" not in text:
            yield subject.of_link(
                "unused-link",
                link.name,
                f"has no mass, no shape and no child link (fixed joint '{joint.name}')",
                "it costs nothing, and is correct if it marks a frame (a tool, a sensor)",
                "remove it if the frame is not needed",
            )


def check_shapes(subject: Subject) -> Iterator[Finding]:
    """Check that the shapes can be read, and that their mesh files exist and can be read."""
    yield from _broken_shapes(subject)
    reported: set[str] = set()
    unread = 0
    for link, shapes in subject.shapes.items():
        for shape in shapes:
            if shape.wrong is None or shape.mesh is None or shape.mesh in reported:
                continue
            reported.add(shape.mesh)
            if shape.wrong == UNREAD:
                unread += 1
                continue
            missing = shape.wrong == "missing"
            uses = sum(other.mesh == shape.mesh for group in subject.shapes.values() for other in group)
            again = f" (used {uses} times)" if uses > 1 else ""
            yield subject.of_link(
                "missing-mesh" if missing else "broken-mesh",
                link,
                f"mesh '{shape.mesh}' {'is missing' if missing else shape.wrong}{again}",
                "the link is not drawn, and its mass cannot be compared with its shape",
                "add the file, or name the folder of its package with --package-dir"
                if missing
                else "export it again as STL, DAE or OBJ",
                shape.line,
            )
    if unread:
        yield Finding(
            "unread-meshes",
            "",
            f"{unread} mesh file{'s were' if unread > 1 else ' was'} not read: trimesh is not installed",
            "masses, inertias and units cannot be compared with these shapes",
            install_advice("view"),
            subject.description.source,
        )


def _broken_shapes(subject: Subject) -> Iterator[Finding]:
    """Find shapes that cannot be read; those that one macro writes are one finding."""
    reported: set[tuple[str, str]] = set()
    for link, shapes in subject.shapes.items():
        for shape in shapes:
            if shape.kind or shape.wrong is None:
                continue
            finding = subject.of_link(
                "broken-shape",
                link,
                f"its {shape.role} shape cannot be read: {shape.wrong}",
                "it is not drawn or converted, and the link's mass cannot be compared with it",
                "correct the element that the message names, or remove the shape",
                shape.line,
            )
            if (finding.message, finding.place) not in reported:
                reported.add((finding.message, finding.place))
                yield finding
