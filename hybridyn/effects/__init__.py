"""Physical effects of the models: only the effects that a call names are computed.

Read `terms` (gravity, inertia, the legs' inertia, velocity terms), `joints` and `joint_laws` (efforts of
joints), `links`, `bodies`, `bushings` (wrenches on links), `inputs` (limits, a prescribed base), `choice`
(the selection of effects for one call), `rebuild` (`hybridyn.with_effects`).

May import: `structure`, `tables` and below.
"""

from ..structure.bodies import Payload
from .bodies import GravityCompensation, LineSprings
from .bushings import Bushings
from .choice import DEFAULT, UNITS, Effects, choose
from .inputs import BaseMotion, Limits
from .joint_laws import (
    BallSpring,
    CoulombFriction,
    Damper,
    PolynomialDamper,
    PolynomialSpring,
    RotorInertia,
    Spring,
    Stop,
    StribeckFriction,
    ViscousFriction,
)
from .links import GroundContact, Wrench
from .rebuild import with_effects
from .tendons import Tendons
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms

__all__ = [
    "DEFAULT",
    "UNITS",
    "BallSpring",
    "BaseMotion",
    "Bushings",
    "CoulombFriction",
    "Damper",
    "Effects",
    "Gravity",
    "GravityCompensation",
    "GroundContact",
    "Inertia",
    "LegInertia",
    "Limits",
    "LineSprings",
    "MasslessLegs",
    "Payload",
    "PolynomialDamper",
    "PolynomialSpring",
    "RotorInertia",
    "Spring",
    "Stop",
    "StribeckFriction",
    "Tendons",
    "VelocityTerms",
    "ViscousFriction",
    "Wrench",
    "choose",
    "with_effects",
]
