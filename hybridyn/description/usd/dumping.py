"""The prims of a stage as plain data: types, schemas, authored values, targets, transforms."""

from __future__ import annotations

import math
import struct
from typing import Any

from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

from .layers import RefusedError

#: Longest array and text that are passed on; meshes have longer ones, which the dynamics do not need.
LONGEST = 64
LONGEST_TEXT = 100_000

#: C++ types of single precision.
SINGLE = ("float", "GfVec2f", "GfVec3f", "GfVec4f", "GfQuatf", "GfHalf", "GfVec3h", "GfQuath")

#: Attributes of pictures, which are not passed on.
PICTURES = ("primvars:", "inputs:", "outputs:", "extent", "ui:", "info:")


def dump(stage: Any, most: int) -> dict[str, Any]:
    """Return the content of a stage.

    Returns:
        "meters", "kilograms", "up", "authored" (names of the stated ones among them), "default" (path of the
        default prim, or ""), and "prims": each with path, type, schemas, values, and more where it has it.

    Raises:
        RefusedError: There are too many prims, or values come from clips.
    """
    prims: list[dict[str, Any]] = []
    every = Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies(Usd.PrimDefaultPredicate))
    for prim in every:
        if prim.IsPseudoRoot():
            continue
        if len(prims) >= most:
            raise RefusedError(f"it has more than {most:,} prims")
        if prim.HasAuthoredMetadata("clips"):
            raise RefusedError(f"<{prim.GetPath()}>: value clips are not read; remove them")
        prims.append(_prim(prim))
    default = stage.GetDefaultPrim()
    return {
        "meters": UsdGeom.GetStageMetersPerUnit(stage),
        "kilograms": UsdPhysics.GetStageKilogramsPerUnit(stage),
        "up": str(UsdGeom.GetStageUpAxis(stage)),
        "authored": [
            word
            for word in ("metersPerUnit", "kilogramsPerUnit", "upAxis")
            if stage.HasAuthoredMetadata(word)
        ],
        "default": str(default.GetPath()) if default else "",
        "prims": prims,
    }


def _prim(prim: Any) -> dict[str, Any]:
    """Return a prim; what it does not have is left out."""
    out: dict[str, Any] = {
        "path": str(prim.GetPath()),
        "type": str(prim.GetTypeName()),
        "schemas": [str(name) for name in prim.GetPrimTypeInfo().GetAppliedAPISchemas()],
    }
    values, animated = {}, []
    for attribute in prim.GetAuthoredAttributes():
        name = str(attribute.GetName())
        if name.startswith(PICTURES):
            continue
        if attribute.GetNumTimeSamples() or attribute.HasSpline():
            animated.append(name)
        elif attribute.HasAuthoredValue():
            values[name] = _plain(attribute)
    out |= {"values": values} if values else {}
    out |= {"animated": animated} if animated else {}
    targets = {
        str(relation.GetName()): [str(path) for path in relation.GetForwardedTargets()]
        for relation in prim.GetAuthoredRelationships()
    }
    out |= {"targets": targets} if targets else {}
    if prim.IsA(UsdGeom.Xformable):
        place = UsdGeom.Xformable(prim)
        matrix = place.GetLocalTransformation()
        if matrix != Gf.Matrix4d(1.0):
            out["matrix"] = [list(row) for row in matrix]
        if place.GetResetXformStack():
            out["resets"] = True
    return out


def _plain(attribute: Any) -> Any:
    """Return a value as numbers, texts and lists, None for a long array or an unknown type."""
    kind = attribute.GetTypeName()
    value = attribute.Get()
    if kind.isArray:
        if value is None or len(value) > LONGEST:
            return None
        return [_simple(item) for item in value]
    value = _simple(value)
    return _shortest(value) if str(kind.scalarType.cppTypeName) in SINGLE else value


def _shortest(value: Any) -> Any:
    """Return single-precision numbers as the shortest decimals that round to them: 0.1, not 0.10000000149."""
    if isinstance(value, list):
        return [_shortest(item) for item in value]
    if not isinstance(value, float) or not math.isfinite(value):
        return value
    single = struct.pack("f", value)
    decimals = (float(f"{value:.{digits}g}") for digits in range(6, 9))
    return next((number for number in decimals if _packed(number) == single), value)


def _packed(number: float) -> bytes:
    """Return a number in single precision; empty if it overflows."""
    try:
        return struct.pack("f", number)
    except OverflowError:
        return b""


def _simple(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | float):
        return value
    if isinstance(value, str):
        return value if len(value) <= LONGEST_TEXT else None
    if isinstance(value, Gf.Quatf | Gf.Quatd | Gf.Quath):
        return [float(value.GetReal()), *(float(x) for x in value.GetImaginary())]
    if isinstance(value, Sdf.AssetPath):
        return {"asset": value.path}
    try:
        return [_simple(item) for item in value]
    except TypeError:
        return None
