"""Mass, centre of mass and inertia of bodies, as MassAPI states them.

USD computes what a body does not state from the shapes of its colliders; this is refused.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..records import Array, Link
from .bodies import Bodies
from .stage import Prim

MASS, CENTRE = "physics:mass", "physics:centerOfMass"
INERTIA, AXES, PER_VOLUME = "physics:diagonalInertia", "physics:principalAxes", "physics:density"

#: Schemas by which a body, a collider or a material states masses.
MASS_SCHEMAS = ("PhysicsMassAPI", "NewtonMassAPI", "PhysicsMaterialAPI")


def links_of(bodies: Bodies, names: Mapping[str, str]) -> list[Link]:
    """Return the moving bodies as links.

    Args:
        bodies: The bodies.
        names: Names of the links by path.

    Raises:
        ModelError: A mass is negative, or would follow from shapes.
    """
    colliders: dict[str, Prim] = {}
    for prim in bodies.stage.prims.values():
        body = bodies.body_of(prim)
        if prim.has("PhysicsCollisionAPI") and body is not None:
            colliders.setdefault(body.path, prim)
        elif prim.has("PhysicsMassAPI") and body is not None and prim is not body:
            raise prim.error(
                "states a mass but is neither a body nor a collider; apply PhysicsRigidBodyAPI to it, or "
                "state the mass on its body"
            )
    return [_link(bodies, prim, colliders.get(path), names[path]) for path, prim in bodies.moving.items()]


def _link(bodies: Bodies, body: Prim, collider: Prim | None, name: str) -> Link:
    if body.states("newton:inertia") or body.states("newton:massModel"):
        raise body.error("newton:inertia and newton:massModel are not read; author physics:diagonalInertia")
    mass = _stated(body, MASS) * bodies.stage.kilograms
    com, inertia = _centre(bodies, body), _inertia(body)
    missing = [
        word for word, value in ((MASS, mass or None), (CENTRE, com), (INERTIA, inertia)) if value is None
    ]
    if collider is not None and missing:
        raise body.error(
            f"{' and '.join(missing)} would follow from its colliders (<{collider.path}>, a "
            f"{collider.kind or 'prim'}), which is not computed; author {MASS}, {CENTRE} and {INERTIA}"
        )
    if mass and inertia is None:
        raise body.error(f"states a mass but no inertia, and has no collider; author {INERTIA}")
    if not mass and _stated(body, PER_VOLUME):
        raise body.error(f"states a density but has no collider; author {MASS} and {INERTIA}")
    com = np.zeros(3) if com is None else com
    return Link(name, mass, com, np.zeros((3, 3)) if inertia is None else inertia)


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
