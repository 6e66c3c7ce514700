"""Rigid bodies of a USD stage: which prims move, to which body a prim belongs, and where it stands.

Poses are rotations and positions [m]; the scale of a prim stretches what is stated in it, and is no part of
its pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..placement import inverse, placement_from
from ..records import Array
from ..urdf.xml_node import LARGEST_NUMBER
from .stage import Prim, Stage

#: Largest deviation of axes from right angles, and of scales from 1, that is rounding: transforms of many
#: files pass through single precision (6e-8) a few times.
SINGLE_PRECISION = 1e-5


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a prim stands in the world.

    Attributes:
        frame: Its axes and origin, shape (4, 4), [m].
        scale: Factors along its axes, shape (3,).
    """

    frame: Array
    scale: Array

    def point(self, position: Array, meters: float) -> Array:
        """Return a point stated in the prim, in its axes without scale, shape (3,), [m]."""
        return self.scale * position * meters


class Bodies:
    """The bodies of a stage, and poses of its prims.

    Attributes:
        stage: The stage.
        moving: Rigid bodies that move, by path.
        still: Rigid bodies that a program moves or that are disabled, by path: parts of the world.
    """

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.moving: dict[str, Prim] = {}
        self.still: dict[str, Prim] = {}
        self._matrices: dict[str, Array] = {}
        self._poses: dict[str, Pose] = {}
        for path, prim in stage.prims.items():
            if prim.has("PhysicsRigidBodyAPI"):
                fixed = prim.flag("physics:kinematicEnabled", False) or not prim.flag(
                    "physics:rigidBodyEnabled", True
                )
                (self.still if fixed else self.moving)[path] = prim

    def body_of(self, prim: Prim) -> Prim | None:
        """Return the moving body to which a prim belongs, or None for the world."""
        above: Prim | None = prim
        while above is not None:
            if above.path in self.moving:
                return above
            if above.path in self.still:
                return None
            above = above.parent
        return None

    def pose(self, prim: Prim) -> Pose:
        """Return where a prim stands in the world.

        Raises:
            ModelError: Its transform shears, mirrors, shrinks to nothing, is animated or not finite.
        """
        if prim.path not in self._poses:
            self._poses[prim.path] = self._pose(prim)
        return self._poses[prim.path]

    def in_body(self, prim: Prim) -> Array:
        """Return the frame of a prim in its body, or in the world if it has none, shape (4, 4), [m]."""
        body = self.body_of(prim)
        if body is prim:
            return np.eye(4)
        frame = self.pose(prim).frame
        return frame if body is None else inverse(self.pose(body).frame) @ frame

    def _pose(self, prim: Prim) -> Pose:
        matrix = self._matrix(prim)
        if not (np.abs(matrix) <= LARGEST_NUMBER).all():
            raise prim.error("its transform is not finite, or too large")
        rows = matrix[:3, :3]
        scale = np.linalg.norm(rows, axis=1)
        if not scale.all() or abs(matrix[3, 3] - 1) > SINGLE_PRECISION or np.any(matrix[:3, 3]):
            raise prim.error("its transform has no inverse, or is a projection; scale it by positive numbers")
        axes = (rows / scale[:, None]).T
        if np.abs(axes.T @ axes - np.eye(3)).max() > SINGLE_PRECISION:
            raise prim.error(
                "its transform shears (a turned prim below one with different scales); apply the scale to "
                "what is stated below it, and remove it"
            )
        if np.linalg.det(axes) < 0:
            raise prim.error("its transform mirrors; scale it by positive numbers")
        scale = np.where(np.abs(scale - 1) <= SINGLE_PRECISION, 1.0, scale)
        position = matrix[3, :3] * self.stage.meters
        return Pose(placement_from(_nearest_rotation(axes), position), scale)

    def _matrix(self, prim: Prim) -> Array:
        """Return the transform of a prim in the world, as USD writes it, shape (4, 4)."""
        found = self._matrices.get(prim.path)
        if found is None:
            if any(name.startswith("xformOp") for name in prim.animated):
                raise prim.error("its transform is animated (time samples); give it one default value")
            _check_order(prim)
            found = np.eye(4) if prim.matrix is None else prim.matrix
            if prim.parent is not None and not prim.resets:
                with np.errstate(over="ignore", invalid="ignore"):
                    found = found @ self._matrix(prim.parent)
            self._matrices[prim.path] = found
        return found


def _check_order(prim: Prim) -> None:
    """Refuse steps of a transform that the prim does not have; OpenUSD leaves them out."""
    order = prim.values.get("xformOpOrder") or []
    for step in order if isinstance(order, list) else [order]:
        name = str(step).removeprefix("!invert!")
        if name != "!resetXformStack!" and (not name.startswith("xformOp:") or name not in prim.values):
            raise prim.error(
                f"xformOpOrder names '{name}', which the prim does not state; state or remove it"
            )


def _nearest_rotation(axes: Array) -> Array:
    """Return the rotation nearest to a matrix that is one to single precision; an exact one is returned."""
    if np.array_equal(axes.T @ axes, np.eye(3)):
        return axes
    u, _, vt = np.linalg.svd(axes)
    out: Array = u @ vt
    return out
