"""Links without mass or with too little, and the least that stands for it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..description.records import Description, Link

#: Mass and inertia of a moving link without any, relative to those of the lightest link. Smaller ones would
#: change the robot less, but make its closures softer.
LIGHT = 1e-3
#: Inertia of a point mass, relative to mass and size of the robot: far above MuJoCo's least one, 1e-15.
POINT_INERTIA = 1e-9
#: Least principal moment that MuJoCo takes, with a margin [kg m^2].
LEAST_MOMENT = 1e-14


class Sizes(NamedTuple):
    """Sizes of a robot.

    Attributes:
        light: A link with the least mass and inertia.
        size: The median distance between joints [m].
    """

    light: Link
    size: float


def sizes_of(d: Description) -> Sizes:
    """Return the sizes of a robot."""
    steps = [float(np.linalg.norm(joint.placement[:3, 3])) for joint in d.joints]
    size = float(np.median([step for step in steps if step] or [1.0]))
    mass = min((link.mass for link in d.links if link.mass > 0), default=1.0)
    moments = [float(np.linalg.eigvalsh(link.inertia)[-1]) for link in d.links if link.mass > 0]
    moment = min((moment for moment in moments if moment > 0), default=mass * size**2)
    return Sizes(Link("", LIGHT * mass, np.zeros(3), LIGHT * moment * np.eye(3)), size)


def is_solid(link: Link) -> bool:
    """Say whether a link has mass and a positive definite inertia."""
    return link.mass > 0 and bool(np.linalg.eigvalsh(link.inertia)[0] > 4 * LEAST_MOMENT)


def is_weightless(link: Link) -> bool:
    """Say whether a link has neither mass nor inertia."""
    return not link.mass and not link.inertia.any()
