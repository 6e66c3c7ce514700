"""The class of every effect by its name, those of other packages too."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import ModelError
from ..extensions import Extension, added, every_name, running
from ..structure.bodies import Payload
from .bodies import GravityCompensation, LineSprings
from .bushings import Bushings
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
from .link_effect import LinkEffect
from .links import GroundContact, Wrench
from .load_friction import LoadFriction
from .others import check_class, is_other, package_of
from .springs import BallSpring, PolynomialDamper, PolynomialSpring, Spring, Stop
from .tendons import Tendons
from .terms import Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms
from .words import WORDS

#: Classes of what acts on joints.
JOINTS = (JointEffect, Tendons)
#: Every effect of hybridyn by name.
UNITS: dict[str, type[Any]] = {
    unit.name: unit
    for unit in (
        Gravity, Inertia, LegInertia, MasslessLegs, VelocityTerms, RotorInertia, ViscousFriction,
        CoulombFriction, StribeckFriction, DirectedFriction,
        Spring, Damper, Stop, PolynomialSpring, PolynomialDamper,
        BallSpring, Tendons, Wrench, GroundContact, GravityCompensation, LineSprings, Bushings, LoadFriction,
        GearEfficiency, DcMotors, Payload, BaseMotion, Limits,
    )
}  # fmt: skip


def names(asked: Iterable[str] | None = None) -> tuple[str, ...]:
    """Return every name and word for effects; if those that are asked for are hybridyn's own, only these.

    Raises:
        ModelError: Two packages add effects of one name.
    """
    return every_name("effects", asked, WORDS)


def class_of(name: str) -> type[Any] | None:
    """Return the class of an effect, or None if there is none of this name.

    Raises:
        ModelError: A package adds it, and it cannot be used.
    """
    kind: type[Any] | None = UNITS[name] if name in UNITS else added("effects", name)
    return kind


def checked_effect(found: Extension) -> type[Any]:
    """Return the class of a law that a package adds.

    Raises:
        ModelError: It is no law, or has another name.
    """
    law, name = found.value, getattr(found.value, "name", None)
    if not (isinstance(law, type) and issubclass(law, JointEffect | LinkEffect)):
        why = f"leads to {law!r}, which is no subclass of JointEffect or LinkEffect of hybridyn.effects"
        raise found.refused("effects", why)
    if name != found.name:
        raise found.refused("effects", f"is the class {law.__name__}, whose name is {name!r}: make them one")
    check_class(law, UNITS)
    return law


def made(name: str, values: Mapping[str, Any]) -> Any:
    """Return an effect with the numbers of a file.

    Raises:
        ModelError: There is no such effect, or its numbers are wrong.
    """
    kind = class_of(name)
    if kind is None:
        raise ModelError(f"there is no effect '{name}': its package is not installed", element=name)
    if not is_other(kind):
        return kind(**values)
    with running("effects", name, package_of(kind)):
        return kind(**values)
