import hybridyn.structure.bodies

from .bodies import GravityCompensation, LineSprings
from .bushings import Bushings
from .catalogue import UNITS
from .choice import Effects, choose
from .dc_motors import DcMotors
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
from .words import DEFAULT

Payload = hybridyn.structure.bodies.Payload  # the lazy loader reads the imports of this folder alone

__all__ = [
    "DEFAULT",
    "UNITS",
    "BallSpring",
    "BaseMotion",
    "Bushings",
    "CoulombFriction",
    "Damper",
    "DcMotors",
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
