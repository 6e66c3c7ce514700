"""A robot scaled in length and mass, built from records: factors of two are exact, so nothing is rounded.

Times are not scaled. A quantity of dimension kg^a m^b s^c is multiplied by mass^a length^b.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hybridyn import HybridRobot
from hybridyn.description import Description
from hybridyn.description.records import Coupling, Joint, Link
from hybridyn.structure.building import build_robot
from hybridyn.structure.robot import Base

GRAVITY = np.array([0.0, 0.0, -9.81])
SLIDES = {"prismatic": 1, "planar": 2, "floating": 3}  # coordinates in metres: a joint's first


@dataclass(frozen=True)
class Scale:
    """Factors of length and mass."""

    length: float = 1.0
    mass: float = 1.0

    @property
    def force(self) -> float:
        """The factor of forces."""
        return self.mass * self.length

    @property
    def torque(self) -> float:
        """The factor of torques."""
        return self.force * self.length

    def description(self, given: Description) -> Description:
        """Scale a robot."""
        kinds = {joint.name: joint.kind for joint in given.joints}
        return replace(
            given,
            links=tuple(self._link(link) for link in given.links),
            joints=tuple(self._joint(joint) for joint in given.joints),
            closures=tuple(
                replace(c, frame_a=self._placed(c.frame_a), frame_b=self._placed(c.frame_b))
                for c in given.closures
            ),
            couplings=tuple(self._coupling(c, kinds) for c in given.couplings),
            home={
                name: tuple(np.array(x) * self._coordinates(kinds[name], len(x)))
                for name, x in given.home.items()
            },
        )

    def robot(self, given: Description, base: Base = "fixed") -> HybridRobot:
        """Build a scaled robot under scaled gravity."""
        return build_robot(self.description(given), base=base, gravity=GRAVITY * self.length)

    def _placed(self, M: np.ndarray) -> np.ndarray:
        out = np.array(M, dtype=float)
        out[:3, 3] *= self.length
        return out

    def _link(self, link: Link) -> Link:
        inertia = self.mass * self.length**2 * link.inertia
        return replace(link, mass=self.mass * link.mass, com=self.length * link.com, inertia=inertia)

    def _joint(self, joint: Joint) -> Joint:
        slide = self.length if joint.kind == "prismatic" else 1.0
        effort = self.force if joint.kind == "prismatic" else self.torque
        return replace(
            joint,
            placement=self._placed(joint.placement),
            lower=slide * joint.lower,
            upper=slide * joint.upper,
            velocity=slide * joint.velocity,
            effort=effort * joint.effort,
            damping=effort / slide * joint.damping,
            friction=effort * joint.friction,
            rotor_inertia=self.torque * joint.rotor_inertia,
        )

    def _coupling(self, coupling: Coupling, kinds: Mapping[str, str]) -> Coupling:
        terms = [
            (name, k / (self.length if kinds[name] == "prismatic" else 1.0)) for name, k in coupling.terms
        ]
        return replace(coupling, terms=tuple(terms))

    def _coordinates(self, kind: str, size: int) -> np.ndarray:
        out = np.ones(size)
        out[: SLIDES.get(kind, 0)] = self.length
        return out

    def of_q(self, robot: HybridRobot) -> np.ndarray:
        """Return the factor of each position, shape (nq,)."""
        sizes = [at.stop - at.start for at in robot.q_slices]
        return np.concatenate([self._coordinates(k, n) for k, n in zip(robot.kinds, sizes, strict=True)])

    def of_v(self, robot: HybridRobot) -> np.ndarray:
        """Return the factor of each rate and acceleration, shape (nv,)."""
        sizes = [at.stop - at.start for at in robot.v_slices]
        return np.concatenate([self._coordinates(k, n) for k, n in zip(robot.kinds, sizes, strict=True)])

    def of_tau(self, robot: HybridRobot) -> np.ndarray:
        """Return the factor of each effort, shape (motors,)."""
        kinds = dict(zip(robot.joints, robot.kinds, strict=True))
        return np.array([self.force if kinds[m] == "prismatic" else self.torque for m in robot.motors])

    @property
    def of_wrench(self) -> np.ndarray:
        """The factor of each component of a wrench, shape (6,)."""
        return np.array([self.force] * 3 + [self.torque] * 3)

    @property
    def of_twist(self) -> np.ndarray:
        """The factor of each component of a twist, shape (6,)."""
        return np.array([self.length] * 3 + [1.0] * 3)
