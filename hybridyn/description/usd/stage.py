"""The composed prims of a USD file, and their values with units and checks.

Poses are rotations and positions [m]; the scale of a prim stretches what is stated in it, and is no part of
its pose.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics

from ...errors import ModelError
from ..bounds import refuse_above
from ..placement import placement_from, rotation_from_quaternion
from ..records import Array
from ..urdf.xml_node import LARGEST_NUMBER
from .schema import BODY, SINGLE_PRECISION

#: Numbers beyond this are no limit; USD's own parser uses it, since files state the largest float.
UNBOUNDED = 0.5e38

#: C++ types of single precision.
SINGLE = ("float", "GfVec2f", "GfVec3f", "GfVec4f", "GfQuatf", "GfHalf", "GfVec3h", "GfQuath")

#: Types of values that are plain, and those of quaternions.
PLAIN = (bool, int, float, str, type(None))
QUATERNIONS = (Gf.Quatf, Gf.Quatd, Gf.Quath)


class Prim:
    """A prim.

    Attributes:
        stage: The stage that holds it.
        usd: The prim of OpenUSD.
        parent: The prim above it, or None.
        path: Its path.
        kind: Its type, "" for none.
        schemas: Names of its applied schemas; instances of one are named "PhysicsDriveAPI:angular".
        attributes: Its authored attributes by name.
        body: The moving body to which it belongs, None for the world.
    """

    def __init__(self, stage: UsdStage, usd: Any, parent: Prim | None) -> None:
        self.stage, self.usd, self.parent = stage, usd, parent
        self.path, self.kind = str(usd.GetPath()), str(usd.GetTypeName())
        self.schemas = tuple(str(name) for name in usd.GetPrimTypeInfo().GetAppliedAPISchemas())
        self.attributes = {
            str(one.GetName()): one
            for one in usd.GetAuthoredAttributes() if one.HasAuthoredValue() or _is_animated(one)
        }  # fmt: skip
        self.body: Prim | None = None if parent is None else parent.body
        if self.has(BODY):
            if not usd.IsA(UsdGeom.Xformable):
                kind = f"a {self.kind}" if self.kind else "a prim without a type"
                raise self.error(f"{BODY} is of prims that have a place, not of {kind}; write an Xform")
            moves = self.flag("physics:rigidBodyEnabled", True) and not self.flag(
                "physics:kinematicEnabled", False
            )
            self.body = self if moves else None

    def has(self, *schemas: str) -> bool:
        """Return whether one of some schemas is applied."""
        return any(schema in self.schemas for schema in schemas)

    def instances(self, schema: str) -> list[str]:
        """Return the names of the instances of a schema that are applied ("angular")."""
        return [name.partition(":")[2] for name in self.schemas if name.startswith(schema + ":")]

    def error(self, message: str) -> ModelError:
        """Return (not raise) the error that names this prim."""
        return ModelError(f"<{self.path}>: {message}", file=self.stage.file, element=self.path)

    def targets(self, relation: str) -> list[str]:
        """Return the paths that a relationship names."""
        found = self.usd.GetRelationship(relation)
        return [str(path) for path in found.GetForwardedTargets()] if found else []

    def value(self, name: str) -> Any:
        """Return an authored value as number, text or list, None where none is authored.

        Numbers beyond `UNBOUNDED` are infinite.

        Raises:
            ModelError: It is animated.
        """
        attribute = self.attributes.get(name)
        if attribute is None:
            return None
        if _is_animated(attribute):
            raise self.error(f"'{name}' is animated (time samples); give it one default value")
        value = attribute.Get()
        if isinstance(value, QUATERNIONS):
            value = [value.GetReal(), *value.GetImaginary()]
        elif not isinstance(value, PLAIN):
            if not hasattr(value, "__getitem__"):
                raise self.error(f"'{name}' is neither a number, a text nor a list of them")
            value = [*value]
        if attribute.GetTypeName().scalarType.cppTypeName in SINGLE:
            value = _shortest(value)
        unbounded = isinstance(value, float) and abs(value) > UNBOUNDED
        return math.copysign(math.inf, value) if unbounded else value

    def number(self, name: str, default: float, *, finite: bool = True) -> float:
        """Return a number; a default may be infinite."""
        value = float(self._stated(name, default, (int, float), "a number"))
        if np.isnan(value):
            raise self.error(f"'{name}' is not a number (nan)")
        if finite and value != default and not np.isfinite(value):
            raise self.error(f"'{name}' is not a finite number")
        return value

    def stated(self, name: str, infinite: bool) -> float | None:
        """Return a number, None where none is authored, as `rows.Stating`."""
        return None if self.value(name) is None else self.number(name, 0.0, finite=not infinite)

    def flag(self, name: str, default: bool) -> bool:
        """Return a truth value."""
        return bool(self._stated(name, default, (bool, int), "true or false"))

    def word(self, name: str, default: str) -> str:
        """Return a text."""
        return str(self._stated(name, default, (str,), "a word"))

    def vector(self, name: str, default: Sequence[float], *, finite: bool = True) -> Array:
        """Return a vector, shape (len(default),)."""
        value = self._stated(name, [*default], (list,), f"a vector of {len(default)} numbers")
        if len(value) != len(default) or any(type(x) not in (int, float) for x in value):
            raise self.error(f"'{name}' is not a vector of {len(default)} numbers")
        out = np.array(value, dtype=float)
        if finite and not (np.abs(out) <= LARGEST_NUMBER).all():
            raise self.error(f"'{name}' is not finite, or too large")
        return out

    def rotation(self, name: str) -> Array:
        """Return the rotation matrix of a quaternion w, x, y, z, shape (3, 3); identity without one."""
        stated = self.vector(name, (1.0, 0.0, 0.0, 0.0))
        length = float(np.linalg.norm(stated))
        if not length:
            raise self.error(f"'{name}' is the zero quaternion, which is no rotation")
        w, x, y, z = (float(part) for part in stated / length)
        return rotation_from_quaternion(x, y, z, w)

    def _stated(self, name: str, default: Any, kinds: Collection[type], what: str) -> Any:
        """Return a value, which has to be of some kind, or the default."""
        value = self.value(name)
        if value is not None and type(value) not in kinds:
            raise self.error(f"'{name}' is not {what}")
        return default if value is None else value

    @property
    def pose(self) -> Array:
        """Where it stands in the world, shape (4, 4), [m]."""
        return self._place[0]

    def point(self, position: Array) -> Array:
        """Return a point stated in the prim, in its axes without scale, shape (3,), [m]."""
        out: Array = self._place[1] * position * self.stage.meters
        return out

    @functools.cached_property
    def _place(self) -> tuple[Array, Array]:
        """Its frame in the world, shape (4, 4), [m], and the factors along its axes, shape (3,).

        Raises:
            ModelError: Its transform shears, mirrors, shrinks to nothing, is animated or not finite.
        """
        self._check_steps()
        matrix = np.array(self.stage.transforms.GetLocalToWorldTransform(self.usd))  # rows are images of axes
        if not (np.abs(matrix) <= LARGEST_NUMBER).all():
            raise self.error("its transform is not finite, or too large")
        scale = np.linalg.norm(matrix[:3, :3], axis=1)
        if not scale.all() or abs(matrix[3, 3] - 1) > SINGLE_PRECISION or np.any(matrix[:3, 3]):
            raise self.error("its transform has no inverse, or is a projection; scale it by positive numbers")
        axes = (matrix[:3, :3] / scale[:, None]).T
        if np.abs(axes.T @ axes - np.eye(3)).max() > SINGLE_PRECISION:
            raise self.error(
                "its transform shears (a turned prim below one with different scales); apply the scale to "
                "what is stated below it, and remove it"
            )
        if np.linalg.det(axes) < 0:
            raise self.error("its transform mirrors; scale it by positive numbers")
        if not np.array_equal(axes.T @ axes, np.eye(3)):
            u, _, vt = np.linalg.svd(axes)
            axes = u @ vt  # the nearest rotation
        scale = np.where(np.abs(scale - 1) <= SINGLE_PRECISION, 1.0, scale)
        return placement_from(axes, matrix[3, :3] * self.stage.meters), scale

    def _check_steps(self) -> None:
        """Refuse animated transforms, here and above, and steps without a value, which OpenUSD leaves out."""
        prim: Prim | None = self
        while prim is not None:
            if any(name.startswith("xformOp") and _is_animated(one) for name, one in prim.attributes.items()):
                raise prim.error("its transform is animated (time samples); give it one default value")
            for step in prim.value("xformOpOrder") or ():
                name = step.removeprefix("!invert!")
                if name != "!resetXformStack!" and (
                    name not in prim.attributes or not name.startswith("xformOp:")
                ):
                    raise prim.error(
                        f"xformOpOrder names '{name}', which the prim does not state; state or remove it"
                    )
            prim = prim.parent


def _is_animated(attribute: Any) -> bool:
    return bool(attribute.GetNumTimeSamples() or attribute.HasSpline())


def _shortest(value: Any) -> Any:
    """Return single-precision numbers as the shortest decimals that round to them: 0.1, not 0.10000000149."""
    if isinstance(value, list):
        return [_shortest(item) for item in value]
    if not isinstance(value, float):
        return value
    decimals = (float(f"{value:.{digits}g}") for digits in range(6, 9))
    return next((number for number in decimals if np.float32(number) == value), value)


class UsdStage:
    """A USD file.

    Attributes:
        file: Its path, for messages.
        usd: The stage of OpenUSD.
        meters: Length unit [m].
        kilograms: Mass unit [kg].
        down: Unit vector against the axis that points up, shape (3,).
        prims: Its prims by path, each after its parent.
        transforms: OpenUSD's transforms of prims in the world.
    """

    def __init__(self, usd: Any, file: str) -> None:
        """Read the prims of a stage.

        Raises:
            ModelError: There are too many prims, values come from clips, or a unit is wrong.
        """
        self.file, self.usd, self.transforms = file, usd, UsdGeom.XformCache()
        self.meters = float(UsdGeom.GetStageMetersPerUnit(usd))
        self.kilograms = float(UsdPhysics.GetStageKilogramsPerUnit(usd))
        if not all(0 < unit < LARGEST_NUMBER for unit in (self.meters, self.kilograms)):
            raise ModelError("metersPerUnit and kilogramsPerUnit must be positive numbers", file=file)
        up = str(UsdGeom.GetStageUpAxis(usd))
        if up not in ("X", "Y", "Z"):
            raise ModelError(f"upAxis '{up}' is none of X, Y, Z", file=file)
        self.down: Array = -np.eye(3)["XYZ".index(up)]
        self.prims: dict[str, Prim] = {}
        every = Usd.PrimRange(usd.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
        for one in itertools.islice(every, 1, None):  # the first is the root of all
            refuse_above("prims", len(self.prims) + 1, functools.partial(ModelError, file=file))
            prim = Prim(self, one, self.prims.get(str(one.GetParent().GetPath())))
            if one.HasAuthoredMetadata("clips"):
                raise prim.error("value clips are not read; remove them")
            self.prims[prim.path] = prim

    @property
    def moving(self) -> dict[str, Prim]:
        """The rigid bodies that move, by path; the others are parts of the world."""
        return {path: prim for path, prim in self.prims.items() if prim.body is prim}
