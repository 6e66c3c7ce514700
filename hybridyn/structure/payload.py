"""Payloads: rigid bodies that are attached to links."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ..description.names import did_you_mean
from ..description.records import Description, Link, Load
from ..errors import ModelError
from ..spatial import LARGEST
from .bodies import Body


@dataclass(frozen=True)
class Payload:
    """A rigid body that is attached to a link; its mass, centre and inertia are added to those of the link.

    A payload changes the robot. `hybridyn.with_effects` returns the changed robot, which then has the payload
    under any effects.

    Attributes:
        link: Name of the link.
        mass: Mass [kg].
        com: Centre of mass, shape (3,), [m], link frame.
        inertia: Inertia about the centre of mass, shape (3, 3), [kg m^2], link axes.
    """

    link: str
    mass: float
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    inertia: tuple[tuple[float, ...], ...] = ((0.0,) * 3,) * 3
    name: ClassVar[str] = "payload"

    def __post_init__(self) -> None:
        # Tuples, so that equal payloads compare equal, whatever sequences they were built from.
        com, inertia = np.asarray(self.com, dtype=float), np.asarray(self.inertia, dtype=float)
        if com.shape != (3,) or inertia.shape != (3, 3):
            raise ModelError(f"payload on '{self.link}': com has 3 numbers, inertia 3 x 3", element=self.link)
        object.__setattr__(self, "com", tuple(com.tolist()))
        object.__setattr__(self, "inertia", tuple(tuple(row) for row in inertia.tolist()))
        numbers = np.array([self.mass, *com, *inertia.ravel()])
        if not (np.abs(numbers) <= LARGEST).all():  # not a number, too
            raise ModelError(
                f"payload on '{self.link}': numbers must be finite, and at most {LARGEST:.0e}",
                element=self.link,
            )
        if self.mass < 0 or not np.array_equal(inertia, inertia.T):
            raise ModelError(
                f"payload on '{self.link}': mass must not be negative, inertia symmetric", element=self.link
            )
        moments = np.linalg.eigvalsh(inertia)
        if moments[0] < -1e-12 * abs(moments[-1]) or moments[0] + moments[1] < moments[2] * (1 - 1e-9):
            raise ModelError(
                f"payload on '{self.link}': no body has principal moments {moments}", element=self.link
            )

    def onto(self, description: Description) -> Description:
        """Return the description with the payload added to its link.

        Raises:
            ModelError: The link is unknown.
        """
        links = {link.name: link for link in description.links}
        if self.link not in links:
            raise ModelError(
                f"payload on unknown link '{self.link}'{did_you_mean(self.link, links)}", element=self.link
            )
        own = links[self.link]
        com, inertia = np.array(self.com), np.array(self.inertia)
        load = Load(self.link, self.mass, com, inertia, own.mass, own.com, own.inertia)
        every = tuple(loaded(link, load) if link.name == self.link else link for link in description.links)
        return replace(description, links=every, loads=(*description.loads, load))


def loaded(link: Link, load: Load) -> Link:
    """Return a link with the numbers of its own in a load and of the body that was added."""
    body, origin = Body("", -1), (np.eye(3), np.zeros(3))
    body.add(replace(link, mass=load.own_mass, com=load.own_com, inertia=load.own_inertia), *origin)
    body.add(Link("", load.mass, load.com, load.inertia), *origin)
    return replace(link, mass=body.mass, com=body.com, inertia=body.inertia)


def payloads_of(description: Description) -> tuple[Payload, ...]:
    """Return the payloads that were added to the links of a description.

    Raises:
        ModelError: A payload has numbers of no body.
    """
    return tuple(
        Payload(load.name, load.mass, tuple(load.com.tolist()), tuple(map(tuple, load.inertia.tolist())))
        for load in description.loads
    )
