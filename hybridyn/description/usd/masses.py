"""Mass, centre of mass and inertia of bodies: as MassAPI states them, else from the shapes of colliders.

The rules are those of `UsdPhysics.RigidBodyAPI.ComputeMassProperties`: what the body states ranks above what
its colliders give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..placement import inverse
from ..records import Array
from .bodies import Bodies
from .shapes import FLAT, solid_of
from .stage import Prim

#: Density where nothing states one [kg/m^3].
DENSITY = 1000.0

MASS, CENTRE = "physics:mass", "physics:centerOfMass"
INERTIA, AXES, PER_VOLUME = "physics:diagonalInertia", "physics:principalAxes", "physics:density"

#: Schemas by which a body, a collider or a material states masses.
MASS_SCHEMAS = ("PhysicsMassAPI", "NewtonMassAPI", "PhysicsMaterialAPI")

#: Flag by which hybridyn writes that a body has no inertia: USD takes zeros for nothing stated.
POINT = "hybridyn:pointMass"


@dataclass(frozen=True, eq=False)
class Mass:
    """Mass properties in the axes of a body.

    Attributes:
        mass: Mass [kg].
        com: Centre of mass, shape (3,), [m].
        inertia: Inertia about it, shape (3, 3), [kg m^2].
    """

    mass: float
    com: Array
    inertia: Array


def masses(bodies: Bodies) -> dict[str, Mass]:
    """Return the mass properties of the moving bodies by path.

    Raises:
        ModelError: A mass is negative, or follows from a shape that is not computed.
    """
    colliders: dict[str, list[Prim]] = {path: [] for path in bodies.moving}
    for prim in bodies.stage.prims.values():
        body = bodies.body_of(prim)
        if prim.has("PhysicsCollisionAPI") and body is not None:
            colliders[body.path].append(prim)
        elif prim.has("PhysicsMassAPI") and body is not None and prim is not body:
            raise prim.error(
                "states a mass but is neither a body nor a collider; apply PhysicsRigidBodyAPI or "
                "PhysicsCollisionAPI to it, or state the mass on its body"
            )
    return {path: _mass(bodies, prim, colliders[path]) for path, prim in bodies.moving.items()}


def _mass(bodies: Bodies, body: Prim, colliders: list[Prim]) -> Mass:
    stage = bodies.stage
    if body.states("newton:inertia") or body.states("newton:massModel"):
        raise body.error("newton:inertia and newton:massModel are not read; author physics:diagonalInertia")
    mass = _stated(body, MASS) * stage.kilograms
    com, inertia = _centre(bodies, body), _inertia(body)
    if body.flag(POINT, False) and inertia is None:
        inertia = np.zeros((3, 3))
    if mass and com is not None and inertia is not None:
        return Mass(mass, com, inertia)
    if not colliders:
        return _without_shape(body, mass, com, inertia)
    whole = _sum([_of_collider(bodies, body, prim) for prim in colliders], body)
    factor = mass / whole.mass if mass and whole.mass else 1.0
    if mass and not whole.mass and inertia is None:
        raise body.error(
            f"its colliders have no volume, from which its inertia would follow; author {INERTIA}"
        )
    total = mass or whole.mass
    if inertia is None:
        shift = np.zeros(3) if com is None else com - whole.com
        inertia = whole.inertia * factor + total * _steiner(shift)
    return Mass(total, whole.com if com is None else com, inertia)


def _steiner(arm: Array) -> Array:
    """Return the inertia of a unit mass at the end of an arm, shape (3, 3)."""
    return arm @ arm * np.eye(3) - np.outer(arm, arm)


def _without_shape(body: Prim, mass: float, com: Array | None, inertia: Array | None) -> Mass:
    """Return the mass properties of a body without colliders; the missing centre is its origin."""
    if mass and inertia is None:
        raise body.error(
            f"states a mass but no inertia, and has no collider from which it would follow; author {INERTIA}"
        )
    if not mass and _stated(body, PER_VOLUME):
        raise body.error(f"states a density but has no collider with a volume; author {MASS} and {INERTIA}")
    return Mass(mass, np.zeros(3) if com is None else com, np.zeros((3, 3)) if inertia is None else inertia)


def _states_masses(prim: Prim) -> bool:
    """Return whether the schema is applied without which USD leaves masses out."""
    return any(prim.has(schema) for schema in MASS_SCHEMAS)


def _stated(prim: Prim, name: str) -> float:
    """Return a mass or density, 0 where none is stated."""
    value = prim.number(name, 0.0) if _states_masses(prim) else 0.0
    if value < 0:
        raise prim.error(f"'{name}' is negative")
    return value


def _centre(bodies: Bodies, body: Prim) -> Array | None:
    """Return the stated centre of mass, shape (3,), [m], or None; USD's "none" is -inf."""
    value = body.vector(CENTRE, (-np.inf, -np.inf, -np.inf), finite=False)
    if np.isneginf(value).any() or not _states_masses(body):
        return None
    if not np.isfinite(value).all():
        raise body.error(f"'{CENTRE}' is not finite")
    return bodies.pose(body).point(value, bodies.stage.meters)


def _inertia(body: Prim) -> Array | None:
    """Return the stated inertia, shape (3, 3), [kg m^2], or None; USD's "none" is zero."""
    moments = body.vector(INERTIA, (0.0, 0.0, 0.0)) * body.stage.kilograms * body.stage.meters**2
    if not moments.any() or not _states_masses(body):
        return None
    axes = np.eye(3)
    if body.states(AXES) and body.vector(AXES, (0.0,) * 4).any():
        axes = body.rotation(AXES)
    inertia: Array = axes @ np.diag(moments) @ axes.T
    return (inertia + inertia.T) / 2


def _of_collider(bodies: Bodies, body: Prim, prim: Prim) -> Mass:
    """Return the mass properties of a collider, in the axes of its body."""
    stage = bodies.stage
    for name in (CENTRE, INERTIA) if prim is not body and _states_masses(prim) else ():
        values = prim.vector(name, (0.0,) * 3, finite=False)
        if np.isfinite(values).all() and values.any():
            raise prim.error(f"'{name}' of a collider is not read; state it on the body <{body.path}>")
    if prim.kind in FLAT:
        return Mass(0.0, np.zeros(3), np.zeros((3, 3)))
    pose = bodies.pose(prim)
    solid = solid_of(prim, pose.scale * stage.meters)
    if solid is None:
        raise prim.error(
            f"the mass of <{body.path}> would follow from this {prim.kind or 'prim'}, which is not computed; "
            f"author {MASS}, {CENTRE} and {INERTIA} on the body"
        )
    mass = _stated(prim, MASS) * stage.kilograms if prim is not body else 0.0
    density = mass / solid.volume if mass else _density(bodies, body, prim)
    frame = np.eye(4) if prim is body else inverse(bodies.pose(body).frame) @ pose.frame
    turn = frame[:3, :3]
    return Mass(
        density * solid.volume, turn @ solid.centre + frame[:3, 3], density * turn @ solid.inertia @ turn.T
    )


def _density(bodies: Bodies, body: Prim, prim: Prim) -> float:
    """Return the density of a collider [kg/m^3]: its own, its body's, its material's, else USD's 1000."""
    stage = bodies.stage
    material = stage.prims.get(prim.material or "")
    for of in (prim, body, material):
        if of is not None and (value := _stated(of, PER_VOLUME)):
            return value * stage.kilograms / stage.meters**3
    return DENSITY


def _sum(parts: list[Mass], body: Prim) -> Mass:
    """Return the mass properties of several parts together."""
    mass = sum(part.mass for part in parts)
    if not mass:
        return Mass(0.0, np.zeros(3), np.zeros((3, 3)))
    com: Array = np.sum([part.mass * part.com for part in parts], axis=0) / mass
    inertia = np.zeros((3, 3))
    for part in parts:
        inertia += part.inertia + part.mass * _steiner(part.com - com)
    if not np.isfinite(inertia).all():
        raise body.error("the inertia that its colliders give is not finite")
    return Mass(float(mass), com, (inertia + inertia.T) / 2)
