"""Couplings of a USD robot: PhysX's and Newton's mimic joints, and MuJoCo's equalities of joints."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..records import Coupling
from .joints import UsdJoint, unit_of
from .schema import SINGLE_PRECISION
from .stage import Prim, Stage

PHYSX, NEWTON, MUJOCO = "PhysxMimicJointAPI", "NewtonMimicAPI", "MjcEqualityJointAPI"


def coupled(stage: Stage) -> set[str]:
    """Return the paths of all joints that are coupled."""
    out: set[str] = set()
    for prim in stage.prims.values():
        leaders = [f"physxMimicJoint:{axis}:referenceJoint" for axis in prim.instances(PHYSX)]
        leaders += ["newton:mimicJoint", "mjc:target"] if prim.has(NEWTON, MUJOCO) else []
        if leaders:
            out |= {prim.path, *(path for name in leaders for path in prim.targets(name))}
    return out


def couplings(stage: Stage, joints: Mapping[str, UsdJoint], notes: list[str]) -> list[Coupling]:
    """Return the couplings of a stage.

    Args:
        stage: The stage.
        joints: The joints of the robot by path.
        notes: Remarks for the user, to which soft couplings are added.

    Raises:
        ModelError: A coupled joint is unknown or has several freedoms, a coupling is no linear one, or those
            of two engines differ.
    """
    out: list[Coupling] = []
    for prim in stage.prims.values():
        for axis in prim.instances(PHYSX):
            out.append(_physx(prim, axis, joints))
            if prim.number(f"physxMimicJoint:{axis}:naturalFrequency", 0.0) > 0:
                notes.append(
                    f"<{prim.path}> is a compliant mimic in PhysX (naturalFrequency); it is read as rigid"
                )
        if prim.has(NEWTON, MUJOCO) and prim.flag("newton:mimicEnabled", True):
            of_newton = _newton(prim, joints)
            of_physx = next((one for one in out if one.name == of_newton.name), None)
            if of_physx is None:
                out.append(of_newton)
            elif not _same(of_physx, of_newton):
                raise prim.error("couples this joint otherwise for PhysX than for Newton; keep one coupling")
    return out


def _same(one: Coupling, other: Coupling) -> bool:
    """Return whether two couplings of a joint are one, to the single precision of files."""
    (ours, a), (theirs, b) = (zip(*of.terms, strict=True) for of in (one, other))
    numbers = [*a, one.offset], [*b, other.offset]
    return ours == theirs and np.allclose(*numbers, rtol=SINGLE_PRECISION, atol=SINGLE_PRECISION)


def _physx(prim: Prim, axis: str, joints: Mapping[str, UsdJoint]) -> Coupling:
    """Return position + gearing x position of the other + offset = 0, in the units of the file."""
    space = f"physxMimicJoint:{axis}"
    own, unit, _ = _axis(prim, prim.path, axis, joints)
    reference = prim.word(f"{space}:referenceJointAxis", "")
    other, its_unit, _ = _axis(prim, _leader(prim, f"{space}:referenceJoint"), reference, joints)
    factor = prim.number(f"{space}:gearing", 1.0) * unit / its_unit
    return Coupling(own, ((own, 1.0), (other, factor)), -prim.number(f"{space}:offset", 0.0) * unit)


def _newton(prim: Prim, joints: Mapping[str, UsdJoint]) -> Coupling:
    """Return position = coefficient 0 + coefficient 1 x position of the other.

    Newton's coefficients are in the units of the file; MuJoCo's, which rank above, know no degrees.
    """
    mujoco = prim.has(MUJOCO)
    for number in (2, 3, 4):
        if mujoco and prim.number(f"mjc:coef{number}", 0.0):
            raise prim.error(f"'mjc:coef{number}' makes the equality no linear one; set it to 0")
    own, unit, native = _axis(prim, prim.path, "", joints)
    offset = prim.number("newton:mimicCoef0", 0.0) * unit
    if mujoco and prim.value("mjc:coef0") is not None:
        offset = prim.number("mjc:coef0", 0.0) * native
    relation = "mjc:target" if mujoco and prim.targets("mjc:target") else "newton:mimicJoint"
    if mujoco and not prim.targets(relation):
        return Coupling(own, ((own, 1.0),), offset)
    other, its_unit, its_native = _axis(prim, _leader(prim, relation), "", joints)
    factor = prim.number("newton:mimicCoef1", 1.0) * unit / its_unit
    if mujoco and prim.value("mjc:coef1") is not None:
        factor = prim.number("mjc:coef1", 1.0) * native / its_native
    return Coupling(own, ((own, 1.0), (other, -factor)), offset)


def _leader(prim: Prim, relation: str) -> str:
    """Return the one path that a relationship names."""
    targets = prim.targets(relation)
    if len(targets) != 1:
        raise prim.error(f"'{relation}' names {len(targets)} joints; name one")
    return targets[0]


def _axis(prim: Prim, path: str, axis: str, joints: Mapping[str, UsdJoint]) -> tuple[str, float, float]:
    """Return the name of the record of a joint's axis, and the units of its positions and of MuJoCo's.

    PhysX's names of axes do not matter where a joint has only one.
    """
    if path not in joints:
        raise prim.error(f"couples <{path}>, which is no joint that is read")
    names = joints[path].names
    free = [own for own in names if own != "ball" and (own == axis or len(names) == 1)]
    if len(free) != 1:
        word = f"has no free axis '{axis}'" if axis else "does not have one freedom"
        raise prim.error(f"couples <{path}>, which {word}; couple joints with one freedom")
    if prim.has(MUJOCO) and joints[path].prim.number("mjc:ref", 0.0):
        raise prim.error(f"couples <{path}>, whose 'mjc:ref' shifts its zero; set it to 0")
    unit = unit_of(prim, free[0])
    return names[free[0]], unit, 1.0 if free[0].startswith("rot") else unit
