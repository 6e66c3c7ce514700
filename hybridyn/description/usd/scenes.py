"""Gravity of a USD stage: its PhysicsScene, else the earth's against the up axis."""

from __future__ import annotations

import numpy as np

from ..records import Array
from .stage import Prim, Stage

#: Gravity where a file does not state it [m/s^2].
EARTH = 9.81


def gravity_of(stage: Stage) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity in the world [m/s^2], or None if the file states nothing about it.

    Raises:
        ModelError: Several scenes state different gravity.
    """
    scenes = [prim for prim in stage.prims.values() if prim.kind == "PhysicsScene"]
    if not scenes:
        if stage.up == "Z":
            return None
        return _tuple(_down(stage) * EARTH)
    first, *others = [_of_scene(scene) for scene in scenes]
    for scene, other in zip(scenes[1:], others, strict=True):
        if not np.array_equal(first, other):
            raise scene.error(f"states another gravity than <{scenes[0].path}>; keep one scene")
    return _tuple(first)


def _of_scene(scene: Prim) -> Array:
    stage = scene.stage
    if not scene.flag("newton:gravityEnabled", True) or not scene.flag("mjc:flag:gravity", True):
        return np.zeros(3)
    direction = scene.vector("physics:gravityDirection", (0.0, 0.0, 0.0))
    length = float(np.linalg.norm(direction))
    if not np.isfinite(length):
        raise scene.error("physics:gravityDirection is too long")
    down = direction / length if length else _down(stage)
    magnitude = scene.any_number("physics:gravityMagnitude", -np.inf)
    if magnitude == np.inf:
        raise scene.error("physics:gravityMagnitude is not a finite number")
    return down * (EARTH if magnitude == -np.inf else magnitude * stage.meters)


def _down(stage: Stage) -> Array:
    down: Array = -np.eye(3)["XYZ".index(stage.up)]
    return down


def _tuple(vector: Array) -> tuple[float, float, float]:
    x, y, z = (float(part) + 0.0 for part in vector)
    return x, y, z
