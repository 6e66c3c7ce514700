"""Rigid bodies of a USD stage as links, with the masses that MassAPI states, and the gravity of its scene.

USD computes what a body does not state from the shapes of its colliders; this is refused.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..records import Array, Link
from .stage import Prim, Stage

MASS, CENTRE = "physics:mass", "physics:centerOfMass"
INERTIA, AXES, PER_VOLUME = "physics:diagonalInertia", "physics:principalAxes", "physics:density"

#: Schemas by which a body, a collider or a material states masses; without one USD leaves them out.
MASS_SCHEMAS = ("PhysicsMassAPI", "NewtonMassAPI", "PhysicsMaterialAPI")

#: Gravity where a file does not state it [m/s^2].
EARTH = 9.81


def links_of(stage: Stage, names: Mapping[str, str]) -> list[Link]:
    """Return the moving bodies as links.

    Args:
        stage: The stage.
        names: Names of the links by path.

    Raises:
        ModelError: A mass is negative, or would follow from shapes.
    """
    colliders: dict[Prim, Prim] = {}
    for prim in stage.prims.values():
        if prim.has("PhysicsCollisionAPI") and prim.body is not None:
            colliders.setdefault(prim.body, prim)
        elif prim.has("PhysicsMassAPI") and prim.body not in (None, prim):
            raise prim.error(
                "states a mass but is neither a body nor a collider; apply PhysicsRigidBodyAPI to it, or "
                "state the mass on its body"
            )
    return [_link(prim, colliders.get(prim), names[path]) for path, prim in stage.moving.items()]


def _link(body: Prim, collider: Prim | None, name: str) -> Link:
    states = body.has(*MASS_SCHEMAS)
    mass, density = (body.number(word, 0.0) if states else 0.0 for word in (MASS, PER_VOLUME))
    if mass < 0:
        raise body.error(f"'{MASS}' is negative")
    com, inertia = (_centre(body), _inertia(body)) if states else (None, None)
    stated = {MASS: mass or None, CENTRE: com, INERTIA: inertia}
    missing = " and ".join(word for word, value in stated.items() if value is None)
    if collider is not None and missing:
        raise body.error(
            f"{missing} would follow from its colliders (<{collider.path}>, a {collider.kind or 'prim'}), "
            f"which is not computed; author {MASS}, {CENTRE} and {INERTIA}"
        )
    if mass and inertia is None:
        raise body.error(f"states a mass but no inertia, and has no collider; author {INERTIA}")
    if density and not mass:
        raise body.error(f"states a density but has no collider; author {MASS} and {INERTIA}")
    com = np.zeros(3) if com is None else com
    return Link(name, mass * body.stage.kilograms, com, np.zeros((3, 3)) if inertia is None else inertia)


def _centre(body: Prim) -> Array | None:
    """Return the stated centre of mass, shape (3,), [m], or None; USD's "none" is -inf."""
    value = body.vector(CENTRE, [-np.inf] * 3, finite=False)
    if np.isneginf(value).any():
        return None
    if not np.isfinite(value).all():
        raise body.error(f"'{CENTRE}' is not finite")
    return body.point(value)


def _inertia(body: Prim) -> Array | None:
    """Return the stated inertia, shape (3, 3), [kg m^2], or None; USD's "none" is zero."""
    moments = body.vector(INERTIA, (0.0, 0.0, 0.0)) * body.stage.kilograms * body.stage.meters**2
    if not moments.any():
        return None
    axes = body.rotation(AXES) if body.vector(AXES, (0.0,) * 4).any() else np.eye(3)
    inertia: Array = axes @ np.diag(moments) @ axes.T
    return (inertia + inertia.T) / 2


def gravity_of(stage: Stage) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity in the world [m/s^2], or None if the file states nothing about it.

    It is that of the scene, else the earth's against the up axis.

    Raises:
        ModelError: Several scenes state different gravity.
    """
    scenes = [prim for prim in stage.prims.values() if prim.kind == "PhysicsScene"]
    if not scenes and stage.down[2]:
        return None
    found = [_of_scene(scene) for scene in scenes] or [stage.down * EARTH]
    for scene, other in zip(scenes, found, strict=False):
        if not np.array_equal(found[0], other):
            raise scene.error(f"states another gravity than <{scenes[0].path}>; keep one scene")
    x, y, z = (float(part) + 0.0 for part in found[0])
    return x, y, z


def _of_scene(scene: Prim) -> Array:
    if not scene.flag("newton:gravityEnabled", True) or not scene.flag("mjc:flag:gravity", True):
        return np.zeros(3)
    direction = scene.vector("physics:gravityDirection", (0.0, 0.0, 0.0))
    length = float(np.linalg.norm(direction))
    down = direction / length if length else scene.stage.down
    magnitude = scene.number("physics:gravityMagnitude", -np.inf)
    return down * (EARTH if magnitude == -np.inf else magnitude * scene.stage.meters)
