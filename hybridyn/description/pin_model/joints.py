"""The joints of a Pinocchio model as chains of joints of the description.

A joint that the description has not becomes a chain with massless links between its joints: composite,
universal and translation joints, three angles. Coordinates stay those of Pinocchio.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np
import pinocchio as pin

from ..joint_graph import step
from ..records import FREEDOMS, Array, Coupling, Joint, JointKind
from .checking import joint_error

#: Limits of this size or more are those of a joint without limit: Pinocchio fills in the largest float.
UNLIMITED = 1e300
#: Kinds of joint by the start of Pinocchio's name for it.
KINDS: dict[str, JointKind] = {
    "JointModelRUB": "continuous",
    "JointModelRevoluteUnbounded": "continuous",
    "JointModelR": "revolute",
    "JointModelP": "prismatic",
}
#: Joints with several freedoms that the description has too.
WHOLE: dict[str, JointKind] = {
    "JointModelSpherical": "spherical",
    "JointModelPlanar": "planar",
    "JointModelFreeFlyer": "floating",
}
#: Joints that become chains of revolute or prismatic joints about or along the axes that their endings name.
CHAINS: dict[str, tuple[JointKind, str]] = {
    "JointModelTranslation": ("prismatic", "xyz"),
    "JointModelSphericalZYX": ("revolute", "zyx"),
}
#: Joints that the description does not have, with the reason.
REFUSED = {
    "JointModelEllipsoid": "moves on an ellipsoid",
    "JointModelSpline": "follows a spline",
    "JointModelH": "is a screw",
}


def joints_of(model: pin.Model, number: int) -> list[Joint]:
    """Return the chain of joints that stands for a joint, with its numbers, but without links.

    Raises:
        ModelError: The description has no such joint, or not its numbers.
    """
    chain = _pieces(model, number, model.joints[number], str(model.names[number]))
    placement = np.asarray(model.jointPlacements[number].homogeneous)
    chain[0] = replace(chain[0], placement=placement @ chain[0].placement)
    if model.nvs[number] == 0:  # a mimicking joint has no numbers of its own
        return chain
    firsts = accumulate((FREEDOMS[joint.kind] for joint in chain), initial=0)
    pieces = zip(chain, firsts, strict=False)
    return [replace(joint, **_numbers_of(model, number, joint, at)) for joint, at in pieces]


def coupling_of(model: pin.Model, number: int, leaders: dict[int, list[Joint]]) -> Coupling | None:
    """Return the coupling of a mimicking joint, None for any other joint.

    Args:
        number: Number of the joint in the model.
        leaders: The joints that stand for the joints before it, by number.

    Raises:
        ModelError: It follows a joint with several freedoms.
    """
    if not model.joints[number].shortname().startswith("JointModelMimic"):
        return None
    mimic = model.joints[number].extract()
    leader, *others = leaders[int(model.mimicked_joints[list(model.mimicking_joints).index(number)])]
    if others or leader.kind not in KINDS.values():
        raise joint_error(
            model, number, f"mimics '{leader.name}', which has several freedoms; mimic a single one"
        )
    name = str(model.names[number])
    return Coupling(name, ((name, 1.0), (leader.name, -float(mimic.scaling))), float(mimic.offset))


def _pieces(model: pin.Model, number: int, joint: pin.JointModel, name: str) -> list[Joint]:
    """Return the joints that stand for a joint or for a part of it, each placed behind the one before."""
    word = joint.shortname()
    for start, reason in REFUSED.items():
        if word.startswith(start):
            raise joint_error(
                model, number, f"{word} {reason}, which hybridyn does not have; build it from revolute and "
                "prismatic joints",
            )  # fmt: skip
    if word in WHOLE:
        return [step(name, WHOLE[word], np.array([0.0, 0.0, 1.0]))]
    if word in CHAINS:
        kind, letters = CHAINS[word]
        return [step(f"{name}_{letter}", kind, np.eye(3)["xyz".index(letter)]) for letter in letters]
    if word == "JointModelUniversal":
        universal = joint.extract()
        axes = (np.array(universal.axis1), np.array(universal.axis2))
        return [step(f"{name}_{i}", "revolute", axis) for i, axis in enumerate(axes, 1)]
    if word == "JointModelComposite":
        return _composite(model, number, joint, name)
    if word.startswith("JointModelMimic"):
        return [_mimicking(model, number, joint, name)]
    for start, kind in KINDS.items():
        if word.startswith(start):
            alone = pin.Model()
            alone.addJoint(0, joint, pin.SE3.Identity(), "alone")
            return [step(name, kind, _axis(alone, 1, kind))]
    raise joint_error(model, number, f"{word} is a kind of joint that hybridyn does not have")


def _composite(model: pin.Model, number: int, joint: pin.JointModel, name: str) -> list[Joint]:
    """Return the joints of a composite one behind the other."""
    composite = joint.extract()
    out: list[Joint] = []
    for place, (part, at) in enumerate(zip(composite.joints, composite.jointPlacements, strict=True), 1):
        first, *others = _pieces(model, number, part, f"{name}_{place}")
        out += [replace(first, placement=np.asarray(at.homogeneous) @ first.placement), *others]
    return out if len(out) > 1 else [replace(out[0], name=name)]


def _mimicking(model: pin.Model, number: int, joint: pin.JointModel, name: str) -> Joint:
    """Return a mimicking joint as a joint of its own; `coupling_of` ties it to its leader."""
    mimic = joint.extract()
    if mimic.scaling == 0:
        raise joint_error(model, number, "mimics with scaling 0, so it does not move; weld it")
    inner = next(
        (line.split(":")[1].strip() for line in str(mimic).splitlines() if "Mimicking joint type" in line), ""
    )
    kind = next((kind for start, kind in KINDS.items() if inner.startswith(start)), None)
    if kind is None:
        raise joint_error(
            model, number, f"mimics by a {inner}, which has several freedoms; mimic by revolute or prismatic"
        )
    return step(name, kind, _axis(model, number, kind) / float(mimic.scaling))


def _axis(model: pin.Model, number: int, kind: JointKind) -> Array:
    """Return the axis of a joint with one freedom: its motion subspace when neutral, shape (3,)."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    S = np.array(data.joints[number].S, dtype=float).reshape(6)
    return S[:3] if kind == "prismatic" else S[3:]


def _numbers_of(model: pin.Model, joint: int, piece: Joint, freedom: int) -> dict[str, Any]:
    """Return limits, friction and rotor of a joint or of a part of it, as arguments of `records.Joint`.

    Armature is what Pinocchio's algorithms add to the mass matrix. It becomes the rotor's inertia, unless
    rotor inertia and gear ratio of the model state the same armature.

    Args:
        freedom: Number of freedoms before this part.
    """
    if FREEDOMS[piece.kind] > 1:
        return _numbers_of_all(model, joint, piece, freedom)
    at = int(model.idx_vs[joint]) + freedom
    inertia, ratio = float(model.rotorInertia[at]), float(model.rotorGearRatio[at])
    armature = float(model.armature[at])
    if armature != inertia * ratio**2 and (armature or not (inertia and ratio)):
        inertia, ratio = armature, 1.0
    damping, friction = float(model.damping[at]), float(model.friction[at])
    for word, value in (("armature", inertia), ("damping", damping), ("friction", friction)):
        if value < 0:
            raise joint_error(model, joint, f"negative {word} {value:g}; set it to 0 or more")
    out: dict[str, Any] = {
        "damping": damping,
        "friction": friction,
        "rotor_inertia": inertia,
        "gear_ratio": ratio or 1.0,
        "velocity": _bound(model.velocityLimit[at]),
        "effort": _bound(model.effortLimit[at]),
    }
    if int(model.nqs[joint]) == int(model.nvs[joint]):  # no cosines and sines among the coordinates
        place = int(model.idx_qs[joint]) + freedom
        lower, upper = (float(x[place]) for x in (model.lowerPositionLimit, model.upperPositionLimit))
        if lower < upper:
            out |= {"lower": -_bound(-lower), "upper": _bound(upper)}
    return out


def _numbers_of_all(model: pin.Model, joint: int, piece: Joint, freedom: int) -> dict[str, Any]:
    """Return damping and, of a ball, rotor of a joint with several freedoms; refuse what it cannot have here.

    The joint may be a part of a composite, behind other freedoms.

    Raises:
        ModelError: Its freedoms differ in damping or armature, or have dry friction, rotors or, unless it is
            a ball, armature.
    """
    first = int(model.idx_vs[joint]) + freedom
    numbers = {
        word: np.asarray(getattr(model, word))[first : first + FREEDOMS[piece.kind]]
        for word in ("friction", "rotorInertia", "armature", "damping")
    }
    for word in ("friction", "rotorInertia", *(["armature"] if piece.kind != "spherical" else [])):
        if numbers[word].any():
            raise joint_error(
                model, joint, f"{word} of a joint with several freedoms is not read; set model.{word} to 0"
            )
    for word in ("damping", "armature"):
        if np.ptp(numbers[word]) or numbers[word][0] < 0:
            message = f"the freedoms of one joint have different {word}; set model.{word} to one value"
            raise joint_error(model, joint, message)
    return {"damping": float(numbers["damping"][0]), "rotor_inertia": float(numbers["armature"][0])}


def _bound(value: float) -> float:
    """Return a limit, infinite where the model states none."""
    return np.inf if value >= UNLIMITED else float(value)
