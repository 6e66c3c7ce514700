"""Check units: lengths that look like millimetres, angles in degrees, and meshes in another unit."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from .finding import Finding
from .subject import Subject

#: A median joint offset above this length suggests a file in millimetres [m].
GIANT = 5.0
#: A mesh that is larger than its robot by this factor has another unit.
MESH = 50.0
#: Whole-numbered angular limits of at least this many turns look like degrees.
TURNS = 2.0


def check_units(subject: Subject) -> Iterator[Finding]:
    """Check that lengths are in metres and angles in radians."""
    yield from _lengths(subject)
    yield from _angles(subject)
    yield from _meshes(subject)


def _lengths(subject: Subject) -> Iterator[Finding]:
    offsets = {
        joint.name: float(np.linalg.norm(joint.placement[:3, 3])) for joint in subject.description.joints
    }
    lengths = [length for length in offsets.values() if length > 0]
    for closure in subject.description.closures:
        ends = (closure.frame_a[:3, 3], closure.frame_b[:3, 3])
        lengths += [float(np.linalg.norm(end)) for end in ends if end.any()]
    if not lengths or np.median(lengths) < GIANT:
        return
    longest = max(offsets, key=lambda name: offsets[name])
    yield subject.of_joint(
        "millimetres",
        longest,
        f"half of all offsets between joints are longer than {float(np.median(lengths)):.3g} m; this one is "
        f"{offsets[longest]:.4g} m",
        "if lengths are a thousand times too large, every torque is wrong",
        "if the file is in millimetres, divide every xyz, radius, length and prismatic limit by 1000",
    )


def _angles(subject: Subject) -> Iterator[Finding]:
    for joint in subject.description.joints:
        if joint.kind != "revolute":
            continue
        ends = [end for end in (joint.lower, joint.upper) if math.isfinite(end) and end != 0]
        wide = [end for end in ends if abs(end) >= TURNS * 2 * math.pi]
        if wide and all(end == round(end) for end in ends):
            stated = f"{joint.lower:g} to {joint.upper:g}"
            yield subject.of_joint(
                "degrees",
                joint.name,
                f"its limits are {stated}, whole numbers beyond {TURNS:g} turns",
                "URDF angles are in radians, so these limits never stop the joint",
                "multiply them by pi / 180, or make the joint continuous",
            )


def _meshes(subject: Subject) -> Iterator[Finding]:
    size = subject.extent
    reported: set[str] = set()
    for link, shapes in subject.shapes.items():
        for shape in shapes:
            if shape.mesh is None or shape.corners is None or shape.mesh in reported or not size:
                continue
            own = float(np.linalg.norm(np.ptp(shape.corners, axis=0)))
            if not own or own <= MESH * size:
                continue
            reported.add(shape.mesh)
            yield subject.of_link(
                "mesh-scale",
                link,
                f"mesh '{shape.mesh}' spans {own:.3g} m in a robot of {size:.3g} m",
                "drawings, and checks that use shapes, are meaningless",
                'meshes in millimetres need <mesh scale="0.001 0.001 0.001">',
                shape.line,
            )
