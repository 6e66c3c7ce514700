"""Read a Pinocchio model: joints as chains, links for its bodies and frames, closures, home posture.

A joint that the description has not becomes a chain with massless links between its joints: composite and
translation joints, universal ones, three angles. Coordinates stay those of Pinocchio, but for joints that
follow others: a joint that mimics another, and the slide of a screw, have a coordinate of their own and a
coupling. The fields of a
`pinocchio.Model` can be set to anything; Pinocchio itself may then crash, so they are checked first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Any

import numpy as np
import pinocchio as pin

from ..errors import ModelError
from ..joints.kinds import JointKind
from .joint_chains import add_chain, step
from .joint_words import PINOCCHIO_CHAINS, WORDS
from .names import counted, listed, noted, unique
from .pin_constraints import closures_of, is_finite, is_placement, notes_on, plain_constraints
from .placement import angle_of
from .records import Array, Coupling, Joint, Link, RobotFile, massless

#: Limits of this size or more are those of a joint without limit: Pinocchio fills in the largest float.
UNLIMITED = 1e300
#: How Pinocchio calls joints that mimic others.
MIMIC = "JointModelMimic"
#: Joints that the description does not have, with the reason.
REFUSED = {
    "JointModelEllipsoid": "moves on an ellipsoid",
    "JointModelSpline": "follows a spline",
}

#: Fields with a number for each freedom or coordinate: which of both, and whether it may be infinite.
NUMBERS = {
    "armature": ("nv", False), "damping": ("nv", False), "friction": ("nv", False),
    "rotorInertia": ("nv", False), "rotorGearRatio": ("nv", False), "effortLimit": ("nv", True),
    "velocityLimit": ("nv", True), "lowerPositionLimit": ("nq", True), "upperPositionLimit": ("nq", True),
}  # fmt: skip


#: Rates below which joints that follow others turn or slide, relative to the other.
MIMIC_STILL = 1e-9


#: Couplings by the joint that follows another.
Followers = dict[str, Coupling]


def joints_of(model: pin.Model, number: int, followers: Followers) -> list[Joint]:
    """Return the chain of joints that stands for a joint, with its numbers, but without links.

    Args:
        followers: Joints of the chain that follow others are added.

    Raises:
        ModelError: The description has no such joint, or not its numbers.
    """
    chain = _pieces(model, number, model.joints[number], str(model.names[number]), followers)
    placement = np.asarray(model.jointPlacements[number].homogeneous)
    chain[0] = replace(chain[0], placement=placement @ chain[0].placement)
    counts = (0 if joint.name in followers else joint.kind.nv for joint in chain)
    pieces = zip(chain, accumulate(counts, initial=0), strict=False)
    return [
        joint if joint.name in followers else replace(joint, **_numbers_of(model, number, joint, at))
        for joint, at in pieces
    ]


def _pieces(
    model: pin.Model, number: int, joint: pin.JointModel, name: str, followers: Followers
) -> list[Joint]:
    """Return the joints that stand for a joint or for a part of it, each placed behind the one before."""
    word = joint.shortname()
    for start, reason in REFUSED.items():
        if word.startswith(start):
            raise joint_error(
                model, number, f"{word} {reason}, which hybridyn does not have; build it from revolute and "
                "prismatic joints",
            )  # fmt: skip
    if word == MIMIC:
        return _mimic(model, number, name, followers)
    if word in PINOCCHIO_CHAINS:
        kind, letters = PINOCCHIO_CHAINS[word]
        return [step(f"{name}_{letter}", kind, np.eye(3)["xyz".index(letter)]) for letter in letters]
    if word == "JointModelUniversal":
        universal = joint.extract()
        axes = (np.array(universal.axis1), np.array(universal.axis2))
        return [step(f"{name}_{i}", JointKind.REVOLUTE, axis) for i, axis in enumerate(axes, 1)]
    if word == "JointModelComposite":
        return _composite(model, number, joint, name, followers)
    if (known := _kind_of(word.removeprefix("JointModel"))) is None:
        raise joint_error(model, number, f"{word} is a kind of joint that hybridyn does not have")
    if not known.single:
        return [step(name, known, np.array([0.0, 0.0, 1.0]))]
    axis = _axis(_alone(joint), 1, known)
    if known is JointKind.SCREW:
        return [_screw(axis, float(joint.extract().pitch), name)]
    return [step(name, known, axis)]


def _kind_of(word: str) -> JointKind | None:
    """Return the kind of a joint by Pinocchio's name: of those with an axis by its longest beginning."""
    starts = {start: kind for kind, words in WORDS.items() for start in words.pinocchio}
    fitting = [
        start for start, kind in starts.items() if word == start or (kind.single and word.startswith(start))
    ]
    return starts[max(fitting, key=len)] if fitting else None


def _alone(joint: pin.JointModel) -> pin.Model:
    """Return a model of one joint."""
    alone = pin.Model()
    alone.addJoint(0, joint, pin.SE3.Identity(), "alone")
    return alone


def _screw(axis: Array, pitch: float, name: str) -> Joint:
    """Return a screw; one of no pitch is a hinge."""
    return step(name, JointKind.SCREW if pitch else JointKind.REVOLUTE, axis, pitch=pitch)


def _mimic(model: pin.Model, number: int, name: str, followers: Followers) -> list[Joint]:
    """Return a joint that mimics another, from the motion that the other one causes.

    Raises:
        ModelError: The other joint does not move it.
    """
    leader = int(model.mimicked_joints[[*model.mimicking_joints].index(number)])
    mimic = model.joints[number].extract()
    scaling, offset = float(mimic.scaling), float(mimic.offset)
    data, places, step_of = model.createData(), [], np.zeros(model.nv)
    if scaling:
        step_of[model.idx_vs[leader]] = 0.5 / scaling
    for q in (pin.neutral(model), pin.integrate(model, pin.neutral(model), step_of)):
        pin.forwardKinematics(model, data, q)
        places.append(model.jointPlacements[number].actInv(data.liMi[number]))
    twist = 2.0 * pin.log6(places[0].actInv(places[1])).vector
    size = np.linalg.norm(twist[3:])
    if np.linalg.norm(twist) < MIMIC_STILL:
        message = f"mimics '{model.names[leader]}' with a factor of 0; replace it by a fixed frame"
        raise joint_error(model, number, message)
    if size < MIMIC_STILL:
        chain = [step(name, JointKind.PRISMATIC, twist[:3])]
    else:
        axis = twist[3:] / size
        pitch = float(axis @ twist[:3])
        chain = [_screw(axis, pitch if abs(pitch) > MIMIC_STILL else 0.0, name)]
    followers[name] = Coupling(name, ((name, 1.0), (str(model.names[leader]), -scaling)), offset)
    return chain


def _composite(
    model: pin.Model, number: int, joint: pin.JointModel, name: str, followers: Followers
) -> list[Joint]:
    """Return the joints of a composite one behind the other."""
    composite = joint.extract()
    out: list[Joint] = []
    for place, (part, at) in enumerate(zip(composite.joints, composite.jointPlacements, strict=True), 1):
        first, *others = _pieces(model, number, part, f"{name}_{place}", followers)
        out += [replace(first, placement=np.asarray(at.homogeneous) @ first.placement), *others]
    return out if len(out) > 1 else [replace(out[0], name=name)]


def _axis(model: pin.Model, number: int, kind: JointKind) -> Array:
    """Return the axis of a joint with one freedom: its motion subspace when neutral, shape (3,)."""
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    S = np.array(data.joints[number].S, dtype=float).reshape(6)
    return S[:3] if kind.slides else S[3:]


def _numbers_of(model: pin.Model, joint: int, piece: Joint, freedom: int) -> dict[str, Any]:
    """Return limits, friction and rotor of a joint or of a part of it, as arguments of `records.Joint`.

    Armature is what Pinocchio's algorithms add to the mass matrix. It becomes the rotor's inertia, unless
    rotor inertia and gear ratio of the model state the same armature. A joint with several freedoms has
    damping, and if it is a ball armature and friction about each axis.

    Args:
        freedom: Number of freedoms before this part.

    Raises:
        ModelError: A number is negative, or what a joint with several freedoms cannot have here.
    """
    count, at = piece.kind.nv, int(model.idx_vs[joint]) + freedom
    words = ("damping", "armature", "friction", "rotorInertia", "rotorGearRatio")
    numbers = {word: np.asarray(getattr(model, word))[at : at + count] for word in words}
    own = words[: 3 if piece.kind is JointKind.SPHERICAL else 1] if count > 1 else words
    for word in words[:4]:
        if problem := _problem(word, numbers[word], word in own):
            raise joint_error(model, joint, problem)
    damping, armature, friction, inertia, ratio = (float(values[0]) for values in numbers.values())
    if count > 1:
        return {"damping": damping, "rotor_inertia": armature, "friction": friction}
    if armature != inertia * ratio**2 and (armature or not (inertia and ratio)):
        inertia, ratio = armature, 1.0
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


def _problem(word: str, values: Array, is_read: bool) -> str:
    """Return what is wrong with the numbers of one joint's freedoms, "" if nothing is."""
    if values.any() and not is_read:
        return f"{word} of a joint with several freedoms is not read; set model.{word} to 0"
    if np.ptp(values):
        return f"the freedoms of one joint have different {word}; set model.{word} to one value"
    return f"negative {word} {values[0]:g}; set it to 0 or more" if values[0] < 0 else ""


def _bound(value: float) -> float:
    """Return a limit, infinite where the model states none."""
    return np.inf if value >= UNLIMITED else float(value)


#: Frames that become links; frames of joints and of welds are not links.
LINKS = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR)

#: Difference from 1 of the norm of a quaternion, or of a cosine with its sine, that is rounding.
CONFIGURATION_SLACK = 1e-4


def read_model(
    model: pin.Model, constraint_models: Any = (), *, kinds: Mapping[str | int, str] | None = None,
    home: str | Sequence[float] | Array | None = None,
) -> RobotFile:  # fmt: skip
    """Read a Pinocchio model and its constraints.

    Args:
        kinds: Kinds of closure by constraint, as in `constraints.closures_of`.
        home: The home posture: a configuration of the model, shape (nq,), or the name of one of its reference
            configurations; None takes "home", else the first one, else the neutral one.

    Raises:
        ModelError: The model or a constraint has something that hybridyn does not have.
    """
    check_model(model)
    robot = RobotFile(str(model.name) or "robot", f"Pinocchio model '{model.name}'", format="Pinocchio")
    constraints = plain_constraints(constraint_models)
    first = 1 if _floats(model, constraints) else 0
    robot.base = "floating" if first else "fixed"
    names = _link_names(model)
    robot.links.append(_link(names[first], model.inertias[first]))
    chains, followers = _add_chains(robot, model, names, first)
    _add_frames(robot, model, names, first)
    robot.closures = closures_of(model, constraints, names, kinds or {})
    robot.notes += noted(notes_on(constraints) | {
        "joints {} follow others: q and v have a coordinate of their own for each, which the model has not":
            [*followers]
    })  # fmt: skip
    x, y, z = (float(g) for g in model.gravity.linear)
    robot.gravity = (x, y, z)
    _add_home(robot, model, chains, _posture(model, home, robot.notes), first, followers)
    if not model.check(model.createData()):
        robot.notes.append(
            "the joints of the Pinocchio model are not numbered depth-first (Model.check is False): "
            "pinocchio.crba and constraintDynamics are wrong for it; q and v here are ordered depth-first"
        )
    return robot


def _floats(model: pin.Model, constraints: Sequence[Any]) -> bool:
    """Check whether the model is a robot on a free base that no constraint ties to the world."""
    tied = {int(getattr(c, end, -1)) for c in constraints for end in ("joint1_id", "joint2_id")}
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


def _add_chains(
    robot: RobotFile, model: pin.Model, names: Sequence[str], first: int
) -> tuple[dict[int, list[Joint]], Followers]:
    """Add the joints behind joint `first` with their links and couplings.

    Returns:
        The joints that stand for each joint of the model, by its number; and those that follow others.
    """
    taken = {*names, *(str(frame.name) for frame in model.frames if frame.type in LINKS)}
    chains: dict[int, list[Joint]] = {}
    followers: Followers = {}
    for number in range(first + 1, model.njoints):
        chains[number] = chain = joints_of(model, number, followers)
        between = [unique(f"{names[number]}_{place}", taken) for place in range(1, len(chain))]
        add_chain(robot, chain, [names[model.parents[number]], *between, names[number]])
        robot.links.append(_link(names[number], model.inertias[number]))
    robot.couplings += followers.values()
    return chains, followers


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
                unique(f"{name}_frame", joints), JointKind.FIXED, names[frame.parentJoint], name,
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
    robot: RobotFile, model: pin.Model, chains: Mapping[int, list[Joint]], q: Array, first: int,
    followers: Followers,
) -> None:  # fmt: skip
    """Set the home posture from a configuration of the model."""
    if first:
        robot.base_home = tuple(float(x) for x in q[:7])
    for number, chain in chains.items():
        at = int(model.idx_qs[number])
        for joint in (joint for joint in chain if joint.name not in followers):
            count = len(joint.kind.zero)
            robot.home[joint.name] = tuple(float(x) for x in q[at : at + count])
            at += count

    def position(name: str) -> float:
        """Return where a joint with one freedom is."""
        if name not in followers:
            return angle_of(robot.home[name])
        (_, (leader, factor)), offset = followers[name].terms, followers[name].offset
        return offset - factor * position(leader)

    robot.home |= {name: (position(name),) for name in followers}


def joint_error(model: pin.Model, joint: int, message: str) -> ModelError:
    """Return the error about a joint of a model."""
    name = str(model.names[joint])
    return ModelError(f"Pinocchio model '{model.name}': joint '{name}': {message}", element=name)


def check_model(model: pin.Model) -> None:
    """Check the tree, placements, inertias and numbers of a model.

    Raises:
        ModelError: It is none, a joint hangs on one that follows it, or a number is not finite, or out of its
            range.
    """
    if not isinstance(model, pin.Model):
        raise ModelError(f"the model is a {type(model).__name__}, not a pinocchio.Model")
    name = f"Pinocchio model '{model.name}'"
    for joint in range(1, model.njoints):
        inertia = model.inertias[joint]
        if not 0 <= int(model.parents[joint]) < joint:
            message = f"hangs on joint {model.parents[joint]}, which does not come before it"
            raise joint_error(model, joint, message)
        if not is_placement(model.jointPlacements[joint]):
            raise joint_error(model, joint, "its placement is not a finite rigid motion")
        if not is_finite([inertia.mass, *inertia.lever, *np.ravel(inertia.inertia)]) or inertia.mass < 0:
            message = "mass, lever and inertia must be finite, and the mass not negative"
            raise joint_error(model, joint, message)
    for frame in model.frames:
        if not is_placement(frame.placement) or not 0 <= int(frame.parentJoint) < model.njoints:
            raise ModelError(
                f"{name}: frame '{frame.name}': its placement is not a finite rigid motion on a joint"
            )
    for word, (count, endless) in NUMBERS.items():
        numbers = np.asarray(getattr(model, word), dtype=float)
        wrong = np.isnan(numbers).any() if endless else not is_finite(numbers)
        if numbers.shape != (getattr(model, count),) or wrong:
            raise ModelError(f"{name}: model.{word} must have {getattr(model, count)} finite numbers")
    if not is_finite(model.gravity.linear):
        raise ModelError(f"{name}: its gravity is not finite")
