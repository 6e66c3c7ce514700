"""Check links: masses and inertias that no body has."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...description.loop_signs import has_mass, weightless
from ...description.records import Link
from ...description.validate import INERTIA_SLACK
from .finding import Finding
from .subject import Subject

#: Largest density [kg/m^3]. The densest material, osmium, has 22,590 kg/m^3.
DENSEST = 23_000.0
#: A centre of mass may be outside its link's box by this part of the box's diagonal, since some links have
#: only partial shapes.
OUTSIDE = 0.5
#: A radius of gyration may exceed the distance to the farthest point of the shape by this factor.
LARGER = 1.5
#: A radius of gyration below this part of the shape's half diagonal looks like a placeholder.
SMALLER = 0.02
#: Largest radius of gyration of a link without a shape, relative to the whole robot's size.
WHOLE = 3.0
#: An inertia below this part of mass x (robot's size)^2 counts as zero, as that of a point mass.
POINT = 1e-12
#: Confusions of units, and the factor of a radius of gyration beyond which each is likely.
UNITS = (
    (3e3, "it looks like g mm^2 (1 g mm^2 = 1e-9 kg m^2) beside a mass in kg: "),
    (1e2, "it looks like kg mm^2 (1e-6 kg m^2), or g mm^2 with the mass in grams: "),
    (8, "it looks like kg cm^2 (1e-4 kg m^2): "),
)
FAR_POINT = "perhaps it is taken about a point far from the centre of mass: "


def check_masses(subject: Subject) -> Iterator[Finding]:
    """Check every link's mass, centre of mass and inertia."""
    for link in subject.description.links:
        yield from _inertia(subject, link)
        yield from _size(subject, link)
    yield from _missing(subject)


def _inertia(subject: Subject, link: Link) -> Iterator[Finding]:
    if not link.inertia.any():
        return
    moments = np.linalg.eigvalsh(link.inertia)
    largest = float(np.abs(moments).max())
    if largest < POINT * link.mass * subject.extent**2:
        return
    slack = INERTIA_SLACK * largest
    stated = f"principal moments {moments[0]:.3g}, {moments[1]:.3g}, {moments[2]:.3g} kg m^2"
    if moments[0] < -slack:
        yield subject.of_link(
            "negative-inertia",
            link.name,
            f"{stated}: one is negative",
            "kinetic energy may become negative, and a simulation may blow up",
            "look for a wrong sign, or products of inertia larger than the moments; state the tensor about "
            "the centre of mass",
        )
    elif moments[2] > moments[0] + moments[1] + slack:
        yield subject.of_link(
            "triangle-inequality",
            link.name,
            f"{stated}: the largest exceeds the sum of the others by "
            f"{moments[2] - moments[0] - moments[1]:.2g}",
            "no distribution of mass has such an inertia, so torques about these axes are wrong",
            "export the tensor again, about the centre of mass, in the axes that <inertial><origin> states",
        )
    if link.mass == 0.0:
        yield subject.of_link(
            "inertia-without-mass",
            link.name,
            f"has inertia ({stated}) but no mass",
            "its weight is missing",
            "state its mass; for a rotor write rotor_inertia in model.toml instead",
        )


def _size(subject: Subject, link: Link) -> Iterator[Finding]:
    """Compare mass and inertia with the link's shape, or with the robot's size if it has no shape."""
    if link.mass <= 0.0:
        return
    box = subject.box(link.name)
    gyration = float(np.sqrt(max(np.linalg.eigvalsh(link.inertia)[-1], 0.0) / link.mass))
    if box is None:
        if subject.extent > 0 and gyration > WHOLE * subject.extent:
            yield _too_large(subject, link, gyration, subject.extent, "the whole robot's size")
        return
    lower, upper = box
    diagonal = float(np.linalg.norm(upper - lower))
    if diagonal == 0.0:
        return
    far = float(np.linalg.norm(np.maximum(np.abs(lower - link.com), np.abs(upper - link.com))))
    outside = float(np.linalg.norm(np.maximum(0.0, np.maximum(lower - link.com, link.com - upper))))
    if outside > OUTSIDE * diagonal:
        com = ", ".join(f"{x:.3g}" for x in link.com)
        yield subject.of_link(
            "com-outside",
            link.name,
            f"its centre of mass ({com}) m is {outside:.3g} m outside its shape, whose diagonal is "
            f"{diagonal:.3g} m",
            "gravity and inertia act with a wrong lever arm",
            "state <inertial><origin> in metres in the link's frame, not in the CAD's or the world's",
        )
    elif gyration > LARGER * far:
        yield _too_large(subject, link, gyration, far, "the farthest point of its shape")
    if 0.0 < gyration < SMALLER * diagonal / 2:
        yield subject.of_link(
            "inertia-too-small",
            link.name,
            f"its radius of gyration is {gyration:.2g} m, its shape's half diagonal {diagonal / 2:.2g} m",
            "the torques that accelerate it are computed too small",
            "perhaps a placeholder or a wrong unit: write the inertia in kg m^2, about the centre of mass",
        )
    yield from _density(subject, link, float(np.prod(upper - lower)))


def _density(subject: Subject, link: Link, volume: float) -> Iterator[Finding]:
    """Compare a mass with the volume of the box around its shape [m^3]."""
    if volume > 0 and link.mass > DENSEST * volume:
        yield subject.of_link(
            "too-dense",
            link.name,
            f"{link.mass:.4g} kg in a box of {volume:.3g} m^3: {link.mass / volume:.3g} kg/m^3",
            "its weight and inertia are too large, or its shape too small",
            "write masses in kg and lengths in m; check the scale of the mesh",
        )


def _too_large(subject: Subject, link: Link, gyration: float, size: float, what: str) -> Finding:
    """Return the finding that an inertia is too large, with the unit that would explain it."""
    return subject.of_link(
        "inertia-too-large",
        link.name,
        f"its radius of gyration is {gyration:.3g} m; {what} is {size:.3g} m"
        + (" away" if "point" in what else ""),
        "no mass inside the shape has such an inertia, and it dominates the efforts of fast motions",
        unit_guess(gyration / size) + "write the inertia in kg m^2, about the centre of mass",
    )


def _missing(subject: Subject) -> Iterator[Finding]:
    """Find moving links without mass. If no link has mass, return a single finding."""
    moving = [joint for joint in subject.description.joints if joint.kind != "fixed"]
    if moving and not has_mass(subject.description):
        yield subject.of_link(
            "massless-robot",
            moving[0].child,
            "moves and has no mass, and no other link has mass",
            "efforts of gravity and inertia are zero, and direct dynamics has no solution",
            "add <inertial> to the links; perhaps the file was exported without masses",
        )
        return
    for joint in weightless(subject.description, subject.shapes):
        yield subject.of_link(
            "missing-inertial",
            joint.child,
            f"moves (joint '{joint.name}') and has no mass",
            "efforts do not include its weight and inertia",
            "add <inertial> with mass, centre of mass and inertia, or merge it with a link that has them",
        )


def unit_guess(ratio: float) -> str:
    """Return the confusion of units that makes a radius of gyration too large by about this ratio.

    Args:
        ratio: Radius of gyration over the size of the shape, about 0.3 to 1 if the units are right.
    """
    return next((text for least, text in UNITS if ratio > least), FAR_POINT)
