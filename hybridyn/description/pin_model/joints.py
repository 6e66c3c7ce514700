"""The joints of a Pinocchio model as chains of joints of the description.

A joint that the description has not becomes a chain with massless links between its joints: composite,
universal and translation joints, three angles. Coordinates stay those of Pinocchio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from ..records import Array, Coupling, Joint, JointKind
from .numbers import joint_error, numbers_of, numbers_of_all

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
#: Joints that become chains of revolute or prismatic joints about or along these axes, with their endings.
CHAINS: dict[str, tuple[JointKind, tuple[tuple[str, tuple[float, float, float]], ...]]] = {
    "JointModelTranslation": ("prismatic", (("x", (1, 0, 0)), ("y", (0, 1, 0)), ("z", (0, 0, 1)))),
    "JointModelSphericalZYX": ("revolute", (("z", (0, 0, 1)), ("y", (0, 1, 0)), ("x", (1, 0, 0)))),
}
#: Joints that the description does not have, with the reason.
REFUSED = {
    "JointModelEllipsoid": "moves on an ellipsoid",
    "JointModelSpline": "follows a spline",
    "JointModelH": "is a screw",
}


@dataclass(frozen=True, eq=False)
class Piece:
    """One joint of the description that stands for a Pinocchio joint or a part of it.

    Attributes:
        ending: Ending of its name after the name of the Pinocchio joint; "" if it stands for the whole joint.
        placement: Its placement behind the piece before, shape (4, 4).
        axis: Unit axis, shape (3,).
    """

    kind: JointKind
    ending: str
    placement: Array
    axis: Array


def pieces_of(model: pin.Model, number: int) -> list[Piece]:
    """Return the chain of joints that stands for a joint; the model's placement of the joint is left out.

    Raises:
        ModelError: The description has no such joint.
    """
    return _pieces(model, number, model.joints[number])


def joints_of(model: pin.Model, number: int, pieces: list[Piece]) -> list[Joint]:
    """Return the joints of a chain with their numbers; the links are those of the caller."""
    name = str(model.names[number])
    at = np.asarray(model.jointPlacements[number].homogeneous)
    out: list[Joint] = []
    freedom = 0
    for piece in pieces:
        ending = f"_{piece.ending}" if piece.ending else ""
        joint = Joint(name + ending, piece.kind, "", "", at @ piece.placement, piece.axis)
        if piece.kind in WHOLE.values():
            numbers = numbers_of_all(model, number, piece.kind) if len(pieces) == 1 else {}
            out.append(replace(joint, **numbers))
        elif model.nvs[number] == 0:  # a mimicking joint has no numbers of its own
            out.append(joint)
        else:
            out.append(replace(joint, **numbers_of(model, number, freedom)))
            freedom += 1
        at = np.eye(4)
    return out


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
    leader = leaders[int(model.mimicked_joints[list(model.mimicking_joints).index(number)])]
    if len(leader) != 1 or leader[0].kind not in ("revolute", "continuous", "prismatic"):
        raise joint_error(
            model, number, f"mimics '{leader[0].name}', which has several freedoms; mimic a single one"
        )
    name = str(model.names[number])
    return Coupling(name, ((name, 1.0), (leader[0].name, -float(mimic.scaling))), float(mimic.offset))


def _pieces(model: pin.Model, number: int, joint: pin.JointModel) -> list[Piece]:
    word = joint.shortname()
    eye = np.eye(4)
    for start, reason in REFUSED.items():
        if word.startswith(start):
            raise joint_error(
                model, number, f"{word} {reason}, which hybridyn does not have; build it from revolute and "
                "prismatic joints",
            )  # fmt: skip
    if word in WHOLE:
        return [Piece(WHOLE[word], "", eye, np.array([0.0, 0.0, 1.0]))]
    if word in CHAINS:
        kind, axes = CHAINS[word]
        return [Piece(kind, ending, eye, np.array(axis, dtype=float)) for ending, axis in axes]
    if word == "JointModelUniversal":
        universal = joint.extract()
        axes_ = (np.array(universal.axis1), np.array(universal.axis2))
        return [Piece("revolute", str(i), eye, axis) for i, axis in enumerate(axes_, 1)]
    if word == "JointModelComposite":
        return _composite(model, number, joint)
    if word.startswith("JointModelMimic"):
        return [_mimicking(model, number, joint)]
    for start, kind in KINDS.items():
        if word.startswith(start):
            return [Piece(kind, "", eye, _axis(joint, kind))]
    raise joint_error(model, number, f"{word} is a kind of joint that hybridyn does not have")


def _composite(model: pin.Model, number: int, joint: pin.JointModel) -> list[Piece]:
    """Return the joints of a composite one behind the other."""
    composite = joint.extract()
    out: list[Piece] = []
    parts = zip(composite.joints, composite.jointPlacements, strict=True)
    for place, (part, placement) in enumerate(parts, 1):
        at = np.asarray(placement.homogeneous)
        for piece in _pieces(model, number, part):
            ending = f"{place}{piece.ending and '_' + piece.ending}"
            out.append(replace(piece, ending=ending, placement=at @ piece.placement))
            at = np.eye(4)
    if len(out) == 1:
        return [replace(out[0], ending="")]
    if any(piece.kind in WHOLE.values() for piece in out) and np.any(
        np.asarray(model.damping)[int(model.idx_vs[number]) :][: int(model.nvs[number])]
    ):
        raise joint_error(
            model, number, "damping of a composite with a ball in it is not read; set model.damping to 0"
        )
    return out


def _mimicking(model: pin.Model, number: int, joint: pin.JointModel) -> Piece:
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
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    S = np.asarray(data.joints[number].S).reshape(6) / float(mimic.scaling)
    return Piece(kind, "", np.eye(4), _unit(S[:3] if kind == "prismatic" else S[3:]))


def _axis(joint: pin.JointModel, kind: JointKind) -> Array:
    """Return the axis of a joint with one freedom, shape (3,), by its motion subspace."""
    letter = joint.shortname()[-1]
    if letter in "XYZ":
        aligned: Array = np.eye(3)["XYZ".index(letter)]
        return aligned
    inner = joint.extract()
    if hasattr(inner, "axis"):
        return np.array(inner.axis, dtype=float).reshape(3)
    alone = pin.Model()
    alone.addJoint(0, joint, pin.SE3.Identity(), "alone")
    data = alone.createData()
    pin.forwardKinematics(alone, data, pin.neutral(alone))
    S = np.asarray(data.joints[1].S).reshape(6)
    return _unit(S[:3] if kind == "prismatic" else S[3:])


def _unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector)
