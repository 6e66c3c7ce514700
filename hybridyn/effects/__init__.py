"""Physical effects: only what is named is computed.

One small unit per effect, each stating its law, units and source. They act in four places: terms of the
recursions (`recursion`), efforts and inertia on joints (`joints`, `friction`, `elastic`), wrenches on links
(`links`), and changes of the robot or of what goes into a recursion (`inputs`). `choose` finds them in a
robot.
"""

from ..structure.payload import Payload
from .choice import DEFAULT, UNITS, Effects, choose
from .elastic import RotorInertia, Spring, Stop
from .friction import CoulombFriction, Damper, StribeckFriction, ViscousFriction
from .inputs import BaseMotion, Limits
from .links import GroundContact, Wrench
from .rebuild import with_effects
from .terms import Gravity, Inertia, LegInertia, VelocityTerms

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
