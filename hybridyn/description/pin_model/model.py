"""Read a Pinocchio model: links for its bodies and frames, joints, closures, home posture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from ...errors import ModelError
from ..joint_graph import add_chain
from ..names import counted, listed, unique
from ..placement import angle_of
from ..records import ZERO, Array, Joint, Link, RobotFile, massless
from .checking import check_model, is_finite
from .constraints import closures_of, plain_constraints
from .joints import coupling_of, joints_of

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
        if coupling := coupling_of(model, number, chains):
            robot.couplings.append(coupling)
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
        for joint in chain if model.nqs[number] else ():
            count = len(ZERO[joint.kind])
            robot.home[joint.name] = tuple(float(x) for x in q[at : at + count])
            at += count
    for coupling in robot.couplings:
        (follower, _), (leader, weight) = coupling.terms
        robot.home[follower] = (coupling.offset - weight * angle_of(robot.home[leader]),)
