"""Physical effects of the models: only the effects that a call names are computed.

Read `terms` (gravity, inertia, the legs' inertia, velocity terms), `joints` and `joint_laws` (efforts of
joints), `links` (wrenches on links), `inputs` (limits, a prescribed base), `choice` (the
selection of effects for one call), `rebuild` (`hybridyn.with_effects`).

May import: `structure`, `tables` and below.
"""

from ..structure.bodies import Payload
from .choice import DEFAULT, UNITS, Effects, choose
from .inputs import BaseMotion, Limits
from .joint_laws import (
    CoulombFriction,
    Damper,
    RotorInertia,
    Spring,
    Stop,
    StribeckFriction,
    ViscousFriction,
)
from .links import GroundContact, Wrench
from .rebuild import with_effects
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms

__all__ = [
    "DEFAULT",
    "UNITS",
    "BaseMotion",
    "CoulombFriction",
    "Damper",
    "Effects",
    "Gravity",
    "GroundContact",
    "Inertia",
    "LegInertia",
    "Limits",
    "MasslessLegs",
    "Payload",
    "RotorInertia",
    "Spring",
    "Stop",
    "StribeckFriction",
    "VelocityTerms",
    "ViscousFriction",
    "Wrench",
    "choose",
    "with_effects",
]
