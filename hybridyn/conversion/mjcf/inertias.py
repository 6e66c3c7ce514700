"""Masses and inertias that MuJoCo accepts: positive ones, with principal moments that a body can have."""

from __future__ import annotations

from dataclasses import dataclass, replace
from xml.etree import ElementTree as ET

import numpy as np

from ...description.records import Array, Description, Link
from ..numerals import numeral, numerals, principal, quaternion_of
from ..request import Losses

#: Mass and inertia of a moving link without any, relative to those of the lightest link. Smaller ones would
#: change the robot less, but make its closures softer.
LIGHT = 1e-3
#: Inertia of a point mass, relative to mass and size of the robot: far above MuJoCo's least one, 1e-15.
POINT_INERTIA = 1e-9
#: Least principal moment that MuJoCo takes, with a margin [kg m^2].
LEAST_MOMENT = 1e-14
#: Excess of the largest principal moment over the sum of the others that is rounding, relative to it.
MOMENT_ROUNDING = 1e-12


@dataclass
class Inertias:
    """The inertias of the links as they are written, of which followers of closures take their shares.

    Attributes:
        links: The links by name.
        light: A link with the least mass and inertia.
        size: Size of the robot: the median distance between joints [m].
    """

    links: dict[str, Link]
    light: Link
    size: float

    def share(self, name: str, frame: Array) -> Link:
        """Halve the inertia of a link, and return the other half as that of a body rigid with it.

        Args:
            name: Name of the link.
            frame: Frame of the body in the link, shape (4, 4).
        """
        half = self.links[name]
        half = replace(half, mass=half.mass / 2, inertia=half.inertia / 2)
        self.links[name] = half
        turn = frame[:3, :3]
        com = turn.T @ (half.com - frame[:3, 3])
        return replace(half, com=com, inertia=turn.T @ half.inertia @ turn)

    def is_solid(self, name: str) -> bool:
        """Say whether a link has mass and a positive definite inertia."""
        link = self.links[name]
        return link.mass > 0 and bool(np.linalg.eigvalsh(link.inertia)[0] > 4 * LEAST_MOMENT)


def inertias_of(d: Description) -> Inertias:
    """Return the inertias of a robot's links."""
    steps = [float(np.linalg.norm(joint.placement[:3, 3])) for joint in d.joints]
    size = float(np.median([step for step in steps if step] or [1.0]))
    mass = min((link.mass for link in d.links if link.mass > 0), default=1.0)
    moments = [float(np.linalg.eigvalsh(link.inertia)[-1]) for link in d.links if link.mass > 0]
    moment = min((moment for moment in moments if moment > 0), default=mass * size**2)
    light = Link("", LIGHT * mass, np.zeros(3), LIGHT * moment * np.eye(3))
    return Inertias({link.name: link for link in d.links}, light, size)


def add_inertial(body: ET.Element, link: Link, inertias: Inertias, moving: bool, losses: Losses) -> None:
    """Add `<inertial>` to a body, with principal moments and axes, which MuJoCo keeps as they are.

    Args:
        body: The body's element.
        inertias: Inertias of the robot.
        moving: Whether MuJoCo needs mass and inertia: the body has a joint.
        losses: Receives what is changed.
    """
    mass, inertia = link.mass, link.inertia
    if not moving and not mass and not inertia.any():
        return
    light = f"written with {numeral(inertias.light.mass)} kg"
    if not mass and not inertia.any():
        losses.add(f"moving links without mass, which MuJoCo refuses: {light}", link.name)
        inertia = inertias.light.inertia
    elif not mass:
        losses.add(f"links with inertia but without mass: {light}", link.name)
    mass = mass or inertias.light.mass
    moments, axes = principal(inertia)
    possible = moments.copy()
    if moving and moments.min() < LEAST_MOMENT:
        losses.add(
            "links without inertia about an axis, which MuJoCo refuses: written with a small one", link.name
        )
        possible = np.maximum(moments, max(LEAST_MOMENT, POINT_INERTIA * mass * inertias.size**2))
    largest = int(np.argmax(possible))
    bound = possible.sum() - possible[largest]
    if possible[largest] > bound * (1 + MOMENT_ROUNDING):
        losses.add("inertias that no body can have: the largest principal moment is reduced", link.name)
    others = [i for i in range(3) if i != largest]
    while possible[largest] > possible[others].sum():
        possible[largest] = np.nextafter(possible[others].sum(), 0)
    attributes = {"pos": numerals(link.com), "mass": numeral(mass), "diaginertia": numerals(possible)}
    if not np.array_equal(axes, np.eye(3)):
        attributes["quat"] = numerals(quaternion_of(axes))
    ET.SubElement(body, "inertial", attributes)
