"""Physical effects of the models: only the effects that a call names are computed.

Read `terms` (gravity, inertia, the legs' inertia, velocity terms), `joints`, `joint_laws`, `springs` and
`tendons` (efforts of joints), `link_effect`, `links`, `bodies`, `bushings` (wrenches on links), `inputs`
(limits, a prescribed base), `load_friction` and `gears` (losses that grow with load), `others` (laws of other
packages), `catalogue` (every effect by name), `choice` (the selection of effects for one call),
`dry_friction` (joints that stick), `rebuild` (`hybridyn.with_effects`).

May import: `structure`, `tables` and below.
"""

from ..structure.bodies import Payload
from .bodies import GravityCompensation, LineSprings
from .bushings import Bushings
from .catalogue import DEFAULT, UNITS
from .choice import Effects, choose
from .gears import GearEfficiency
from .inputs import BaseMotion, Limits
from .joint_laws import (
    CoulombFriction,
    Damper,
    DirectedFriction,
    RotorInertia,
    StribeckFriction,
    ViscousFriction,
)
from .joints import JointEffect
from .link_effect import LinkEffect, Moving
from .links import GroundContact, Wrench
from .load_friction import LoadFriction
from .rebuild import with_effects
from .springs import BallSpring, PolynomialDamper, PolynomialSpring, Spring, Stop
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
    "DirectedFriction",
    "Effects",
    "GearEfficiency",
    "Gravity",
    "GravityCompensation",
    "GroundContact",
    "Inertia",
    "JointEffect",
    "LegInertia",
    "Limits",
    "LineSprings",
    "LinkEffect",
    "LoadFriction",
    "MasslessLegs",
    "Moving",
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
