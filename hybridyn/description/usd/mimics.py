"""Couplings of a USD robot: PhysX's and Newton's mimic joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from ...errors import ModelError
from ..records import Coupling
from .joints import DEGREES, UsdJoint
from .stage import Prim, Stage

PHYSX, NEWTON = "PhysxMimicJointAPI", "NewtonMimicAPI"

#: Names of joints by path and axis.
Names = Mapping[str, Mapping[str, str]]


def bound_joints(stage: Stage) -> set[str]:
    """Return the paths of all joints that are coupled."""
    out: set[str] = set()
    for prim in stage.prims.values():
        followers = [f"physxMimicJoint:{axis}:referenceJoint" for axis in prim.instances(PHYSX)]
        followers += ["newton:mimicJoint"] if prim.has(NEWTON) else []
        if followers:
            out |= {prim.path, *(path for name in followers for path in prim.targets.get(name, ()))}
    return out


def couplings(stage: Stage, joints: Mapping[str, UsdJoint], names: Names, notes: list[str]) -> list[Coupling]:
    """Return the couplings of a stage.

    Args:
        names: Names of the joints of the tree.
        notes: Remarks for the user, to which soft couplings are added.

    Raises:
        ModelError: A coupled joint is unknown, has several freedoms, or closes a loop.
    """
    out = []
    for prim in stage.prims.values():
        if prim.has(NEWTON) and prim.flag("newton:mimicEnabled", True):
            out.append(_newton(prim, joints, names))
        for axis in prim.instances(PHYSX):
            out.append(_physx(prim, axis, joints, names))
            if prim.number(f"physxMimicJoint:{axis}:naturalFrequency", 0.0) > 0:
                notes.append(
                    f"<{prim.path}> is a compliant mimic in PhysX (naturalFrequency); it is read as rigid"
                )
    return out


def _newton(prim: Prim, joints: Mapping[str, UsdJoint], names: Names) -> Coupling:
    """Return position = coefficient 0 + coefficient 1 x position of the other, in the units of the file."""
    leader = _target(prim, "newton:mimicJoint")
    own, unit = _axis(prim, prim.path, "", joints, names)
    other, its_unit = _axis(prim, leader, "", joints, names)
    factor = prim.number("newton:mimicCoef1", 1.0) * unit / its_unit
    return Coupling(own, ((own, 1.0), (other, -factor)), prim.number("newton:mimicCoef0", 0.0) * unit)


def _physx(prim: Prim, axis: str, joints: Mapping[str, UsdJoint], names: Names) -> Coupling:
    """Return position + gearing x position of the other + offset = 0, in the units of the file."""
    space = f"physxMimicJoint:{axis}"
    leader = _target(prim, f"{space}:referenceJoint")
    own, unit = _axis(prim, prim.path, axis, joints, names)
    reference = prim.word(f"{space}:referenceJointAxis", "")
    other, its_unit = _axis(prim, leader, reference, joints, names)
    factor = prim.number(f"{space}:gearing", 1.0) * unit / its_unit
    return Coupling(own, ((own, 1.0), (other, factor)), -prim.number(f"{space}:offset", 0.0) * unit)


def _target(prim: Prim, name: str) -> str:
    """Return the one path that a relationship names."""
    targets = prim.targets.get(name, [])
    if len(targets) != 1:
        raise prim.error(f"'{name}' names {len(targets)} joints; name one")
    return targets[0]


def _axis(
    prim: Prim, path: str, axis: str, joints: Mapping[str, UsdJoint], names: Names
) -> tuple[str, float]:
    """Return the name of the record of a joint's axis, and the unit of its positions [m or rad]."""
    if path not in joints:
        raise prim.error(f"couples <{path}>, which is no joint that is read")
    if path not in names:
        raise prim.error(
            f"couples <{path}>, which closes a loop; close the loop by another joint "
            "(physics:excludeFromArticulation = true on that)"
        )
    found = list(_matching(names[path], axis))
    if len(found) != 1:
        raise _several(prim, path, axis)
    (own,) = found
    return names[path][own], DEGREES if own.startswith("rot") else prim.stage.meters


def _matching(axes: Mapping[str, str], axis: str) -> Iterator[str]:
    """Yield the axis of a name, or the only axis of a joint: PhysX's names of axes do not matter there."""
    single = [own for own in axes if own.startswith(("rot", "trans"))]
    yield from [axis] if axis in single else single if len(axes) == 1 else []


def _several(prim: Prim, path: str, axis: str) -> ModelError:
    word = f"has no free axis '{axis}'" if axis else "does not have one freedom"
    return prim.error(f"couples <{path}>, which {word}; couple joints with one freedom")
