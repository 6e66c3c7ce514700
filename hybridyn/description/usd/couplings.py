"""Couplings of a USD robot: PhysX's and Newton's mimic joints, and MuJoCo's equalities of joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ..records import Coupling
from .bodies import SINGLE_PRECISION
from .joints import UsdJoint, unit_of
from .stage import Prim, Stage

PHYSX, NEWTON, MUJOCO = "PhysxMimicJointAPI", "NewtonMimicAPI", "MjcEqualityJointAPI"

#: Names of joints by path and axis.
Names = Mapping[str, Mapping[str, str]]


def coupled(stage: Stage) -> set[str]:
    """Return the paths of all joints that are coupled."""
    out: set[str] = set()
    for prim in stage.prims.values():
        followers = [f"physxMimicJoint:{axis}:referenceJoint" for axis in prim.instances(PHYSX)]
        followers += ["newton:mimicJoint", "mjc:target"] if prim.has(NEWTON) or prim.has(MUJOCO) else []
        if followers:
            out |= {prim.path, *(path for name in followers for path in prim.targets.get(name, ()))}
    return out


def couplings(stage: Stage, joints: Mapping[str, UsdJoint], names: Names, notes: list[str]) -> list[Coupling]:
    """Return the couplings of a stage.

    Args:
        names: Names of the joints of the robot.
        notes: Remarks for the user, to which soft couplings are added.

    Raises:
        ModelError: A coupled joint is unknown or has several freedoms, a coupling is no linear one, or those
            of two engines differ.
    """
    out: list[Coupling] = []
    for prim in stage.prims.values():
        for axis in prim.instances(PHYSX):
            out.append(_physx(prim, axis, joints, names))
            if prim.number(f"physxMimicJoint:{axis}:naturalFrequency", 0.0) > 0:
                notes.append(
                    f"<{prim.path}> is a compliant mimic in PhysX (naturalFrequency); it is read as rigid"
                )
        if (prim.has(NEWTON) or prim.has(MUJOCO)) and prim.flag("newton:mimicEnabled", True):
            of_newton = _newton(prim, joints, names)
            of_physx = next((one for one in out if one.name == of_newton.name), None)
            if of_physx is None:
                out.append(of_newton)
            elif not _same(of_physx, of_newton):
                raise prim.error("couples this joint otherwise for PhysX than for Newton; keep one coupling")
    return out


def _same(one: Coupling, other: Coupling) -> bool:
    """Return whether two couplings of a joint are one, to the single precision of files."""
    if [name for name, _ in one.terms] != [name for name, _ in other.terms]:
        return False
    ours, theirs = ([*(factor for _, factor in of.terms), of.offset] for of in (one, other))
    return np.allclose(ours, theirs, rtol=SINGLE_PRECISION, atol=SINGLE_PRECISION)


def _newton(prim: Prim, joints: Mapping[str, UsdJoint], names: Names) -> Coupling:
    """Return position = coefficient 0 + coefficient 1 x position of the other.

    Newton's coefficients are in the units of the file; MuJoCo's, which rank above, know no degrees.
    """
    own, unit, native = _axis(prim, prim.path, "", joints, names)
    terms, offset = [(own, 1.0)], prim.number("newton:mimicCoef0", 0.0) * unit
    relation = "newton:mimicJoint"
    if prim.has(MUJOCO):
        for number in (2, 3, 4):
            if prim.number(f"mjc:coef{number}", 0.0):
                raise prim.error(f"'mjc:coef{number}' makes the equality no linear one; set it to 0")
        if prim.states("mjc:coef0"):
            offset = prim.number("mjc:coef0", 0.0) * native
        relation = "mjc:target" if "mjc:target" in prim.targets else relation
    if prim.targets.get(relation) or not prim.has(MUJOCO):
        leader = _target(prim, relation)
        other, its_unit, its_native = _axis(prim, leader, "", joints, names)
        factor = prim.number("newton:mimicCoef1", 1.0) * unit / its_unit
        if prim.has(MUJOCO) and prim.states("mjc:coef1"):
            factor = prim.number("mjc:coef1", 1.0) * native / its_native
        terms.append((other, -factor))
    return Coupling(own, tuple(terms), offset)


def _physx(prim: Prim, axis: str, joints: Mapping[str, UsdJoint], names: Names) -> Coupling:
    """Return position + gearing x position of the other + offset = 0, in the units of the file."""
    space = f"physxMimicJoint:{axis}"
    leader = _target(prim, f"{space}:referenceJoint")
    own, unit, _ = _axis(prim, prim.path, axis, joints, names)
    reference = prim.word(f"{space}:referenceJointAxis", "")
    other, its_unit, _ = _axis(prim, leader, reference, joints, names)
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
) -> tuple[str, float, float]:
    """Return the name of the record of a joint's axis, and the units of its positions and MuJoCo's."""
    if path not in joints:
        raise prim.error(f"couples <{path}>, which is no joint that is read")
    found = list(_matching(names.get(path, {}), axis))
    if len(found) != 1:
        word = f"has no free axis '{axis}'" if axis else "does not have one freedom"
        raise prim.error(f"couples <{path}>, which {word}; couple joints with one freedom")
    (own,) = found
    if prim.has(MUJOCO) and joints[path].prim.number("mjc:ref", 0.0):
        raise prim.error(f"couples <{path}>, whose 'mjc:ref' shifts its zero; set it to 0")
    native = 1.0 if own.startswith("rot") else prim.stage.meters
    return names[path][own], unit_of(prim, own), native


def _matching(axes: Mapping[str, str], axis: str) -> Iterator[str]:
    """Yield the axis of a name, or the only axis of a joint: PhysX's names of axes do not matter there."""
    single = [own for own in axes if own.startswith(("rot", "trans"))]
    yield from [axis] if axis in single else single if len(axes) == 1 else []
