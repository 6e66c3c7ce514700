"""Every effect by its name, and what names and words stand for."""

from __future__ import annotations

from typing import Any

from ..structure.bodies import Payload
from .bodies import GravityCompensation, LineSprings
from .bushings import Bushings
from .inputs import BaseMotion, Limits
from .joint_laws import CoulombFriction, Damper, RotorInertia, StribeckFriction, ViscousFriction
from .links import GroundContact, Wrench
from .load_friction import LoadFriction
from .springs import BallSpring, PolynomialDamper, PolynomialSpring, Spring, Stop
from .tendons import Tendons
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms

JOINTS = (
    RotorInertia, ViscousFriction, CoulombFriction, StribeckFriction, Spring, Damper, Stop, PolynomialSpring,
    PolynomialDamper, BallSpring, Tendons,
)  # fmt: skip
LINKS = (Wrench, GroundContact, GravityCompensation, LineSprings, Bushings)
#: Laws of wrenches that depend on the motion of links alone.
OF_MOTION = (GroundContact, GravityCompensation, LineSprings, Bushings)
OfMotion = GroundContact | GravityCompensation | LineSprings | Bushings
#: Every effect by name.
UNITS: dict[str, type[Any]] = {
    unit.name: unit
    for unit in (
        Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms, *JOINTS, *LINKS, LoadFriction, Payload,
        BaseMotion, Limits,
    )
}  # fmt: skip

#: Effects selected by `effects=None` and by the word "default".
DEFAULT = ("gravity", "inertia", "leg_inertia", "velocity")

#: Effects whose parameters are joint attributes in URDF or model.toml.
FROM_FILES = ("rotor_inertia", "viscous_friction", "coulomb_friction")

WORDS = ("default", "model", "none")
