"""Joints of a USD stage: two bodies, a frame in each, axes along which they may move, couplings, and home.

Position zero of a joint is where its frames coincide. Axes are those of the first frame for translations;
a position of a revolute joint turns the second frame about an axis in the first. Couplings are PhysX's and
Newton's mimic joints, and MuJoCo's equalities of joints. Home is that of joint states, else the positions
that the bodies' transforms give.
"""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...spatial import quaternion_from_rotation
from ..joint_graph import WORLD, StatedJoint, outwards, starts
from ..joint_words import CYLINDRICAL, UNIVERSAL
from ..names import unique
from ..placement import inverse, placement_from
from ..records import Array, Coupling, Curve, RobotFile
from ..rows import every_in, names_in
from .schema import AXES, DEGREES, GENERIC, JOINTS, KINDS, NUMBERS, ONE_AXIS, SINGLE_PRECISION, free_axes
from .stage import Prim, UsdStage

#: Free axes of a PhysicsJoint by the word `dofs` of its customData, which Newton's Kamino reads: the first is
#: fixed in the first body, the last in the second one.
HINTS = {
    UNIVERSAL: ("rotX", "rotY"), CYLINDRICAL: ("transX", "rotX"), "cartesian": AXES[:3],
}  # fmt: skip
#: Numbers by which a joint needs its position.
WEIGHTS = ("rotor_inertia", "friction", "damping")


@dataclass(frozen=True, eq=False)
class UsdJoint(StatedJoint):
    """A joint.

    Attributes:
        prim: Its prim.
        frames: Its frame in each of its bodies, shape (4, 4), [m].
        limits: Limits of the axes along which it moves [m or rad], in the order of `AXES`.
        names: Names of the records of its axes, once it is a joint of the tree; "ball" has three freedoms.
    """

    prim: Prim
    frames: tuple[Array, Array]
    limits: dict[str, tuple[float, float]]
    names: dict[str, str] = field(default_factory=dict)

    @property
    def chain(self) -> list[str]:
        """Its axes as joints one after the other; "ball" has three freedoms."""
        free = [*self.limits]
        return [*free[:-3], "ball"] if free[-3:] == [*AXES[3:]] else free

    @property
    def limited(self) -> bool:
        """Whether it has limits of its position."""
        return bool(np.isfinite([*self.limits.values()]).any())

    @property
    def has_speed(self) -> bool:
        """Whether it has a limit of its speed."""
        return any(np.isfinite(numbers_of(self.prim, axis).get("velocity", np.inf)) for axis in self.chain)

    @property
    def is_placed(self) -> bool:
        """Whether it states a position at the start."""
        return any(self.prim.number(state_of(self.prim, axis), 0.0) for axis in self.limits)

    @functools.cached_property
    def heavy(self) -> bool:
        """Whether it has armature or friction."""
        numbers = [numbers_of(self.prim, axis) for axis in self.chain]
        return any(of.get(word) for of in numbers for word in WEIGHTS)


def read_joints(stage: UsdStage, bound: Collection[str], notes: list[str]) -> list[UsdJoint]:
    """Return the joints of a stage in file order, ranked for the tree.

    The tree takes driven and coupled joints first, those that the file excludes from the articulation last;
    then those with armature, friction and limits before others, others before ball joints, and joints near
    the root before those far from it.

    Args:
        stage: The stage.
        bound: Paths of the joints that are driven or coupled.
        notes: Remarks for the user, to which the disabled joints are added.

    Raises:
        ModelError: A joint is of a kind that records do not have, or is wrong.
    """
    prims = []
    for prim in stage.prims.values():
        if not prim.flag("physics:jointEnabled", True):
            notes.append(f"<{prim.path}> has physics:jointEnabled = false: it is not read")
        elif prim.kind in JOINTS:
            prims.append(prim)
    names = names_of(prims)
    joints = [_joint(prim, names[prim.path]) for prim in prims]
    for joint in joints:
        if len(joint.limits) == len(AXES):
            notes.append(f"<{joint.prim.path}> locks no axis: it is not read")
    joints = [joint for joint in joints if len(joint.limits) < len(AXES)]
    if any(prim.flag("newton:jointsAddMobility", False) for prim in stage.prims.values()):
        _refuse_several_between(joints)
    depths: dict[str, int] = {}
    for body, joint_to, before in outwards([WORLD, *roots_of(stage, joints)], joints):
        depths[body] = 0 if joint_to is None else depths[before] + 1
    return [
        replace(joint, needed=joint.prim.path in bound or joint.heavy, rank=(
            joint.prim.path not in bound, joint.closes, not (joint.heavy or joint.limited),
            [*joint.limits] == [*AXES[3:]], sum(depths[end] for end in joint.ends),
        ))
        for joint in joints
    ]  # fmt: skip


def _refuse_several_between(joints: list[UsdJoint]) -> None:
    """Refuse several joints of the tree between two bodies, whose freedoms Newton would add."""
    pairs = Counter(frozenset(joint.ends) for joint in joints if not joint.closes)
    for joint in joints:
        if pairs[frozenset(joint.ends)] > 1 and not joint.closes:
            raise joint.prim.error(
                "'newton:jointsAddMobility' = True is not read where several joints join two bodies: "
                "write bodies between them"
            )


def roots_of(stage: UsdStage, joints: list[UsdJoint]) -> list[str]:
    """Return the bodies in the order in which groups without the world start at them."""
    named = [path for path, body in stage.moving.items() if body.has("PhysicsArticulationRootAPI")]
    return starts(stage.moving, joints, named)


def names_of(prims: Iterable[Prim]) -> dict[str, str]:
    """Return a name for each prim by its path: the last part of it, or as much as makes the name unique."""
    parts = {prim.path: prim.path.strip("/").split("/") for prim in prims}
    ends = {path: ["_".join(own[-n:]) for n in range(1, len(own) + 1)] for path, own in parts.items()}
    counts, taken = Counter(end for own in ends.values() for end in own), set[str]()
    shortest = {path: next((end for end in own if counts[end] == 1), own[-1]) for path, own in ends.items()}
    return {path: unique(name, taken) for path, name in shortest.items()}


def _joint(prim: Prim, name: str) -> UsdJoint:
    """Return a joint prim in the common form."""
    (first, first_frame), (second, second_frame) = (_end(prim, side) for side in (0, 1))
    if first == second:
        what = f"<{first}> to itself" if first else "two parts of the world, or bodies that do not move"
        raise prim.error(f"joins {what}; correct physics:body0 and physics:body1, or remove it")
    closes = prim.flag("physics:excludeFromArticulation", False)
    frames, limits = (first_frame, second_frame), _limits(prim)
    free = [instance(prim, axis) for axis in limits]
    wrong = [name for name in prim.instances("PhysicsDriveAPI") if name not in free]
    if wrong and [*limits] != [*AXES[3:]]:
        advice = f"its free axes are {', '.join(free)}" if free else "it has no free axis; remove the drive"
        raise prim.error(f"PhysicsDriveAPI:{wrong[0]} drives no axis of this joint: {advice}")
    return UsdJoint(name, (first, second), (), None, closes, False, prim, frames, limits)


def _end(prim: Prim, side: int) -> tuple[str, Array]:
    """Return the path of the body at an end of a joint, and the joint's frame in it, shape (4, 4), [m]."""
    targets = prim.targets(f"physics:body{side}")
    turn, place = prim.rotation(f"physics:localRot{side}"), prim.vector(f"physics:localPos{side}", (0.0,) * 3)
    if not targets:
        return WORLD, placement_from(turn, place * prim.stage.meters)
    if len(targets) > 1:
        raise prim.error(f"physics:body{side} names {len(targets)} prims; name one")
    target = prim.stage.prims.get(targets[0])
    if target is None:
        raise prim.error(f"physics:body{side} names <{targets[0]}>, which the stage does not have")
    frame, body = placement_from(turn, target.point(place)), target.body
    if body is None:
        return WORLD, target.pose @ frame
    return body.path, frame if body is target else inverse(body.pose) @ target.pose @ frame


def _limits(prim: Prim) -> dict[str, tuple[float, float]]:
    """Return the limits of the free axes of a joint [m or rad].

    An axis of a generic joint is locked where its lower limit is above the upper one.
    """
    stated = prim.instances("PhysicsLimitAPI")
    if prim.kind != GENERIC and stated:
        raise prim.error(
            "PhysicsLimitAPI is of PhysicsJoint alone; state physics:lowerLimit and physics:upperLimit"
        )
    if prim.kind in ONE_AXIS:
        return _limits_of_one(prim)
    if prim.kind in KINDS:
        return dict.fromkeys(free_axes(KINDS[prim.kind]), (-np.inf, np.inf))
    for name in stated:
        if name not in AXES:
            raise prim.error(f"a limit of '{name}' is not read; hybridyn has limits of {', '.join(AXES)}")
    limits = {}
    for name in AXES:
        space = f"limit:{name}:physics" if name in stated else ""
        lower, upper = _interval(prim, f"{space}:low", f"{space}:high")
        if lower < upper:
            limits[name] = lower * unit_of(prim, name), upper * unit_of(prim, name)
        elif lower == upper != 0:
            raise prim.error(
                f"axis {name} is locked at {lower:g}; lock it at 0 (low above high), and put the offset into "
                "localPos0 and localRot0"
            )
    hint = str(prim.usd.GetCustomData().get("dofs", ""))
    if hint in HINTS:
        if locked := [axis for axis in HINTS[hint] if axis in stated and axis not in limits]:
            raise prim.error(f"customData says that it is {hint}, but its axis {locked[0]} is locked")
        return {axis: limits.get(axis, (-np.inf, np.inf)) for axis in HINTS[hint]}
    if sum(axis.startswith("rot") for axis in limits) == 2:
        raise prim.error(
            "one rotation is locked and two are free, which is no universal joint in USD (the twist is "
            "locked) and no joint here; write two revolute joints with a small body between them, or "
            'customData = { string dofs = "universal" } (Newton)'
        )
    return limits


def _limits_of_one(prim: Prim) -> dict[str, tuple[float, float]]:
    """Return the limits of a joint with one axis [m or rad]."""
    axis = prim.word("physics:axis", "X")
    if axis not in ("X", "Y", "Z"):
        raise prim.error(f"physics:axis '{axis}' is none of X, Y, Z")
    lower, upper = _interval(prim, "physics:lowerLimit", "physics:upperLimit")
    if lower > upper:
        raise prim.error("physics:lowerLimit is above physics:upperLimit; exchange them")
    name = ONE_AXIS[prim.kind][0] + axis
    return {name: (lower * unit_of(prim, name), upper * unit_of(prim, name))}


def _interval(prim: Prim, *names: str) -> list[float]:
    """Return a lower and an upper limit, infinite where none is stated."""
    return [
        prim.number(name, none, finite=False) for name, none in zip(names, (-np.inf, np.inf), strict=True)
    ]


def instance(prim: Prim, axis: str) -> str:
    """Return the name under which schemas of several axes know an axis of a joint ("angular")."""
    return ONE_AXIS[prim.kind][1] if prim.kind in ONE_AXIS else axis


def state_of(prim: Prim, axis: str) -> str:
    """Return the name of the attribute that is the position of an axis at the start."""
    return f"state:{instance(prim, axis)}:physics:position"


def numbers_of(prim: Prim, axis: str) -> dict[str, float]:
    """Return limits of speed and effort, armature and friction of an axis, as in `records.Joint`.

    Those of a ball joint are armature and friction, the same about each axis.

    Raises:
        ModelError: A number is negative, or about one axis of a ball joint.
    """
    ball = axis == "ball"
    of_one = [
        name for word in WEIGHTS if ball for one in names_in({word: NUMBERS[word]}) if "{}" in one
        for name in map(one.format, AXES[3:]) if prim.number(name, 0.0)
    ]  # fmt: skip
    if of_one:
        raise prim.error(f"'{of_one[0]}' is about one axis of a ball joint, which is not read; set it to 0")
    out: dict[str, float] = {}
    for word, _, value in _stated_of(prim, axis):
        out.setdefault(word, value)
    return {word: out[word] for word in WEIGHTS if word in out} if ball else out


def unread_numbers(prim: Prim, axis: str) -> list[str]:
    """Return the attributes of an axis that do not count, since that of another engine is another number."""
    counts, stated = numbers_of(prim, axis), _stated_of(prim, axis)
    return [
        name for word, name, value in stated
        if word in counts and not np.isclose(value, counts[word], rtol=SINGLE_PRECISION, atol=0.0)
    ]  # fmt: skip


def _stated_of(prim: Prim, axis: str) -> list[tuple[str, str, float]]:
    """Return all numbers of an axis that are stated, in the order in which they count: word, attribute, SI.

    Raises:
        ModelError: A number is negative.
    """
    stage = prim.stage
    turns = axis == "ball" or axis.startswith("rot")
    unit = unit_of(prim, axis)
    effort = stage.kilograms * (stage.meters**2 if turns else stage.meters)
    units = {
        "speed": unit, "effort": effort, "inertia": stage.kilograms * (stage.meters**2 if turns else 1.0),
        "effort at speed": effort / unit,
        "effort at one radian or metre a second": effort / (1.0 if turns else stage.meters),
    }  # fmt: skip
    named = "" if axis == "ball" else instance(prim, axis)
    driven = named in prim.instances("PhysicsDriveAPI")
    rows = {word: row.about(named) for word, row in NUMBERS.items() if word != "effort" or driven}
    return [*every_in(rows, prim, units)]


def unit_of(prim: Prim, axis: str) -> float:
    """Return the unit of positions along an axis [m or rad]."""
    return prim.stage.meters if axis.startswith("trans") else DEGREES


def direction(axis: str) -> Array:
    """Return the unit vector of an axis, shape (3,)."""
    out: Array = np.eye(3)["XYZ".index(axis[-1])]
    return out


#: Positions below this [rad, or of the robot's size] are single-precision rounding of transforms.
TRANSFORM_ROUNDING = 1e-6

PHYSX, NEWTON, MUJOCO = "PhysxMimicJointAPI", "NewtonMimicAPI", "MjcEqualityJointAPI"


def coupled(stage: UsdStage) -> set[str]:
    """Return the paths of all joints that are coupled."""
    out: set[str] = set()
    for prim in stage.prims.values():
        leaders = [f"physxMimicJoint:{axis}:referenceJoint" for axis in prim.instances(PHYSX)]
        leaders += ["newton:mimicJoint", "mjc:target"] if prim.has(NEWTON, MUJOCO) else []
        if leaders:
            out |= {prim.path, *(path for name in leaders for path in prim.targets(name))}
    return out


def couplings(stage: UsdStage, joints: Mapping[str, UsdJoint], unread: list[str]) -> list[Coupling]:
    """Return the couplings of a stage; where two engines state the same one, it is one.

    Args:
        stage: The stage.
        joints: The joints of the robot by path.
        unread: Receives numbers of Newton where MuJoCo's are other ones.

    Raises:
        ModelError: A coupled joint is unknown or has several freedoms, or PhysX states another coupling than
            Newton and MuJoCo.
    """
    out: list[Coupling] = []
    for prim in stage.prims.values():
        out += [_physx(prim, axis, joints) for axis in prim.instances(PHYSX)]
        if prim.has(NEWTON, MUJOCO) and prim.flag("newton:mimicEnabled", True):
            of_newton = _newton(prim, joints, unread)
            known = [one for one in out if one.name == of_newton.name]
            if not all(_same(one, of_newton) for one in known):
                raise prim.error(f"{PHYSX} couples it otherwise than {NEWTON} or {MUJOCO} does; remove one")
            out += [] if known else [of_newton]
    return out


def _same(one: Coupling, other: Coupling) -> bool:
    """Return whether two couplings of a joint are one, to the single precision of files."""
    (ours, a), (theirs, b) = (zip(*of.terms, strict=True) for of in (one, other))
    numbers = [*a, one.offset], [*b, other.offset]
    alike = np.allclose(*numbers, rtol=SINGLE_PRECISION, atol=SINGLE_PRECISION)
    return ours == theirs and alike and not (one.curve or other.curve)


def _physx(prim: Prim, axis: str, joints: Mapping[str, UsdJoint]) -> Coupling:
    """Return position + gearing x position of the other + offset = 0, in the units of the file."""
    space = f"physxMimicJoint:{axis}"
    own, unit, _ = _axis(prim, prim.path, axis, joints)
    reference = prim.word(f"{space}:referenceJointAxis", "")
    other, its_unit, _ = _axis(prim, _leader(prim, f"{space}:referenceJoint"), reference, joints)
    factor = prim.number(f"{space}:gearing", 1.0) * unit / its_unit
    return Coupling(own, ((own, 1.0), (other, factor)), -prim.number(f"{space}:offset", 0.0) * unit)


def _newton(prim: Prim, joints: Mapping[str, UsdJoint], unread: list[str]) -> Coupling:
    """Return position = coefficient 0 + coefficient 1 x position of the other + ..., of order four at most.

    Newton's coefficients are in the units of the file; MuJoCo's, which rank above, know no degrees.

    Args:
        unread: Receives Newton's coefficients where MuJoCo's are other ones.
    """
    mujoco = prim.has(MUJOCO)
    relation = "mjc:target" if mujoco and prim.targets("mjc:target") else "newton:mimicJoint"
    alone = mujoco and not prim.targets(relation)
    own, unit, native = _axis(prim, prim.path, "", joints)
    other, its_unit, its_native = (
        ("", 1.0, 1.0) if alone else _axis(prim, _leader(prim, relation), "", joints)
    )
    factors = []
    for order, usual in enumerate((0.0, 1.0)):
        name, usual_unit = f"newton:mimicCoef{order}", unit / its_unit**order
        factors.append(prim.number(name, usual) * usual_unit)
        if mujoco and prim.value(f"mjc:coef{order}") is not None:
            stated, factors[order] = (
                factors[order],
                prim.number(f"mjc:coef{order}", 0.0) * native / its_native**order,
            )
            if prim.value(name) is not None and not np.isclose(stated, factors[order], rtol=SINGLE_PRECISION):
                unread.append(f"{name} of {prim.path}")
    higher = [prim.number(f"mjc:coef{n}", 0.0) * native / its_native**n if mujoco else 0.0 for n in (2, 3, 4)]
    if alone:
        return Coupling(own, ((own, 1.0),), factors[0])
    least = max((n for n, x in enumerate(higher, 1) if x), default=0)
    curve = Curve(((other, 1.0),), tuple(-x for x in higher[:least])) if least else None
    return Coupling(own, ((own, 1.0), (other, -factors[1])), factors[0], curve=curve)


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


def add_home(robot: RobotFile, stage: UsdStage, joints: list[tuple[UsdJoint, bool]]) -> None:
    """Add the home posture to the robot; positions of zero are left out.

    Args:
        robot: The robot.
        stage: Its stage.
        joints: The joints of the tree, each with whether its second body is the child.
    """
    poses = {path: prim.pose for path, prim in stage.moving.items()}
    placements = [*poses.values(), *(frame for joint, _ in joints for frame in joint.frames)]
    size = max((float(np.abs(place[:3, 3]).max()) for place in placements), default=0.0) or 1.0
    for joint, forward in joints:
        first, second = (
            poses.get(end, np.eye(4)) @ frame for end, frame in zip(joint.ends, joint.frames, strict=True)
        )
        found = inverse(first) @ second
        for axis, name in joint.names.items():
            if axis == "ball":
                value = _ball_coordinates(joint, forward, found)
            else:
                state, unit = state_of(joint.prim, axis), unit_of(joint.prim, axis)
                zero = TRANSFORM_ROUNDING * (1.0 if axis.startswith("rot") else size)
                position = _position(axis, found)
                value = (joint.prim.number(state, 0.0) * unit or (position if abs(position) > zero else 0.0),)
            if any(value):
                robot.home[name] = value


def _position(axis: str, found: Array) -> float:
    """Return the position along an axis [m or rad] nearest to a place of the second frame, shape (4, 4)."""
    i, j, k = (np.arange(3) + AXES.index(axis)) % 3
    if axis.startswith("trans"):
        return float(found[i, 3])
    return float(np.arctan2(found[k, j] - found[j, k], found[j, j] + found[k, k]))


def _ball_coordinates(joint: UsdJoint, forward: bool, found: Array) -> tuple[float, ...]:
    """Return the quaternion x, y, z, w of a ball joint, empty for zero.

    The joint turns about the child's axes where its frame has the child's origin, else about its frame's.
    """
    moved, far = (found, joint.frames[1]) if forward else (inverse(found), joint.frames[0])
    ends_in_child = not far[:3, 3].any() and (forward or len(joint.chain) == 1)
    turn = far[:3, :3] if ends_in_child else np.eye(3)
    seen = turn @ moved[:3, :3] @ turn.T
    if np.abs(seen - np.eye(3)).max() <= TRANSFORM_ROUNDING:
        return ()
    return tuple(float(x) for x in quaternion_from_rotation(seen))
