"""Read a Pinocchio model: joints as chains, links for its bodies and frames, closures, home posture.

A joint that the description has not becomes a chain with massless links between its joints: composite and
translation joints, universal ones, three angles. Coordinates stay those of Pinocchio.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import ModelError
from ..joint_graph import add_chain, step
from ..names import counted, listed, unique
from ..records import FREEDOMS, ZERO, Array, Joint, JointKind, Link, RobotFile, massless
from .constraints import check_model, closures_of, is_finite, joint_error, plain_constraints

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
    "JointModelMimic": "mimics another (build the model without mimic=True, or load the URDF itself)",
}


def joints_of(model: pin.Model, number: int) -> list[Joint]:
    """Return the chain of joints that stands for a joint, with its numbers, but without links.

    Raises:
        ModelError: The description has no such joint, or not its numbers.
    """
    chain = _pieces(model, number, model.joints[number], str(model.names[number]))
    placement = np.asarray(model.jointPlacements[number].homogeneous)
    chain[0] = replace(chain[0], placement=placement @ chain[0].placement)
    firsts = accumulate((FREEDOMS[joint.kind] for joint in chain), initial=0)
    pieces = zip(chain, firsts, strict=False)
    return [replace(joint, **_numbers_of(model, number, joint, at)) for joint, at in pieces]


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


#: Frames that become links; frames of joints and of welds are not links.
LINKS = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR)

#: Difference from 1 of the norm of a quaternion, or of a cosine with its sine, that is rounding.
CONFIGURATION_SLACK = 1e-4


def read_model(
    model: pin.Model,
    constraint_models: Any = (),
    *,
    kinds: Mapping[str | int, str] | None = None,
    home: str | Sequence[float] | Array | None = None,
) -> RobotFile:
    """Read a Pinocchio model and its constraints.

    Args:
        kinds: Kinds of closure by constraint, as in `constraints.closures_of`.
        home: The home posture: a configuration of the model, shape (nq,), or the name of one of its reference
            configurations; None takes "home", else the first one, else the neutral one.

    Raises:
        ModelError: The model or a constraint has something that hybridyn does not have.
    """
    if not isinstance(model, pin.Model):
        raise ModelError(f"the model is a {type(model).__name__}, not a pinocchio.Model")
    check_model(model)
    robot = RobotFile(str(model.name) or "robot", f"Pinocchio model '{model.name}'", format="Pinocchio")
    constraints = plain_constraints(constraint_models)
    tied = {
        int(joint)
        for c in constraints
        for joint in (getattr(c, "joint1_id", -1), getattr(c, "joint2_id", -1))
    }
    first = 1 if _floats(model, tied) else 0
    robot.base = "floating" if first else "fixed"
    names = _link_names(model)
    taken = {*names, *(str(frame.name) for frame in model.frames if frame.type in LINKS)}
    robot.links.append(_link(names[first], model.inertias[first]))
    chains: dict[int, list[Joint]] = {}
    for number in range(first + 1, model.njoints):
        chains[number] = _chain(robot, model, number, names, taken)
    _add_frames(robot, model, names, first)
    robot.closures = closures_of(model, constraints, names, kinds or {})
    x, y, z = (float(g) for g in model.gravity.linear)
    robot.gravity = (x, y, z)
    _add_home(robot, model, chains, _posture(model, home, robot.notes), first)
    if not model.check(model.createData()):
        robot.notes.append(
            "the joints of the Pinocchio model are not numbered depth-first (Model.check is False): "
            "pinocchio.crba and constraintDynamics are wrong for it; q and v here are ordered depth-first"
        )
    return robot


def _floats(model: pin.Model, tied: set[int]) -> bool:
    """Check whether the model is a robot on a free base that no constraint ties to the world."""
    if model.njoints < 2 or model.joints[1].shortname() != "JointModelFreeFlyer" or 0 in tied:
        return False
    on_world = [number for number in range(1, model.njoints) if model.parents[number] == 0]
    numbers = (model.armature, model.damping, model.friction, model.rotorInertia)
    return (
        on_world == [1]
        and model.jointPlacements[1].isIdentity(0.0)
        and not any(np.any(values[:6]) for values in numbers)
    )


def _link_names(model: pin.Model) -> list[str]:
    """Return the name of the link of each joint: that of the body frame at its origin, else the joint's."""
    bodies = {
        frame.parentJoint: str(frame.name)
        for frame in reversed([*model.frames])
        if frame.type == pin.FrameType.BODY and frame.name and frame.placement.isIdentity(0.0)
    }
    taken = {str(frame.name) for frame in model.frames if frame.type in LINKS} | {*bodies.values()}
    return [bodies.get(number) or unique(str(name), taken) for number, name in enumerate(model.names)]


def _link(name: str, inertia: pin.Inertia) -> Link:
    return Link(name, float(inertia.mass), np.array(inertia.lever), np.array(inertia.inertia))


def _chain(
    robot: RobotFile, model: pin.Model, number: int, names: Sequence[str], taken: set[str]
) -> list[Joint]:
    """Add the joints and links from a joint's parent to its body, and return the joints."""
    chain = joints_of(model, number)
    between = [unique(f"{names[number]}_{place}", taken) for place in range(1, len(chain))]
    add_chain(robot, chain, [names[model.parents[number]], *between, names[number]])
    robot.links.append(_link(names[number], model.inertias[number]))
    return chain


def _add_frames(robot: RobotFile, model: pin.Model, names: Sequence[str], first: int) -> None:
    """Add a massless link for every other body, operational and sensor frame."""
    links = {link.name for link in robot.links}
    joints = {joint.name for joint in robot.joints}
    frames = [f for f in model.frames if f.type in LINKS and str(f.name) != names[f.parentJoint]]
    for frame in frames:
        if frame.parentJoint >= first:
            name = unique(str(frame.name), links)
            robot.links.append(massless(name))
            robot.joints.append(Joint(
                unique(f"{name}_frame", joints), "fixed", names[frame.parentJoint], name,
                np.array(frame.placement.homogeneous), np.array([1.0, 0, 0]),
            ))  # fmt: skip
    left_out = [str(frame.name) for frame in frames if frame.parentJoint < first]
    if left_out:
        robot.notes.append(f"frames {listed(left_out)} stand in the world and are left out: the base floats")


def _posture(model: pin.Model, home: Any, notes: list[str]) -> Array:
    """Return the configuration of the home posture, shape (nq,)."""
    stated = {str(item.key()): np.array(item.data()) for item in model.referenceConfigurations}
    if home is None and stated:
        home = "home" if "home" in stated else next(iter(stated))
        notes.append(f"home is the reference configuration '{home}' of the Pinocchio model")
    if isinstance(home, str):
        if home not in stated:
            raise ModelError(
                f"home: the model has no reference configuration {home!r}; it has {listed(stated) or 'none'}"
            )
        home = stated[home]
    q = np.array(pin.neutral(model) if home is None else home, dtype=float)
    if q.shape != (model.nq,) or not is_finite(q):
        raise ModelError(
            f"home must have {counted(model.nq, 'finite coordinate')} of the model, not {q.shape}"
        )
    if not pin.isNormalized(model, q, CONFIGURATION_SLACK):
        raise ModelError("home: a quaternion, or a cosine with its sine, is no unit vector")
    return q


def _add_home(
    robot: RobotFile, model: pin.Model, chains: Mapping[int, list[Joint]], q: Array, first: int
) -> None:
    """Set the home posture from a configuration of the model."""
    if first:
        robot.base_home = tuple(float(x) for x in q[:7])
    for number, chain in chains.items():
        at = int(model.idx_qs[number])
        for joint in chain:
            count = len(ZERO[joint.kind])
            robot.home[joint.name] = tuple(float(x) for x in q[at : at + count])
            at += count
