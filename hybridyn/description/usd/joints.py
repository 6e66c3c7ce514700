"""Joints of a USD stage in one form: two bodies, a frame in each, and the axes along which they may move.

Position zero of a joint is where its frames coincide. Axes are those of the first frame for translations;
a position of a revolute joint turns the second frame about an axis in the first.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from ..joint_graph import WORLD, StatedJoint, neighbours, starts
from ..placement import inverse, placement_from
from ..records import Array
from .bodies import Bodies
from .driving import DEGREES, is_heavy, is_limited
from .naming import names_of
from .stage import Prim

#: Axes of a generic joint, in the order in which a chain of joints moves along them.
AXES = ("transX", "transY", "transZ", "rotX", "rotY", "rotZ")

TYPES = (
    "PhysicsRevoluteJoint", "PhysicsPrismaticJoint", "PhysicsSphericalJoint", "PhysicsFixedJoint",
    "PhysicsJoint",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class UsdJoint(StatedJoint):
    """A joint.

    Attributes:
        prim: Its prim.
        bodies: The two bodies that it joins; None is the world.
        frames: Its frame in each of them, shape (4, 4), [m].
        free: The axes along which it moves, a subset of `AXES` in their order.
        limits: Limits by axis [m or rad].
    """

    prim: Prim
    bodies: tuple[Prim | None, Prim | None]
    frames: tuple[Array, Array]
    free: tuple[str, ...]
    limits: dict[str, tuple[float, float]]

    def instance(self, axis: str) -> str:
        """Return the name under which schemas of several axes know an axis ("angular")."""
        if self.prim.kind == "PhysicsRevoluteJoint":
            return "angular"
        return "linear" if self.prim.kind == "PhysicsPrismaticJoint" else axis

    @property
    def heavy(self) -> bool:
        """Whether it has armature or friction."""
        return is_heavy(self.prim, [self.instance(axis) for axis in self.free])

    def chain(self) -> list[str]:
        """Return its axes as joints one after the other; "ball" has three freedoms."""
        if self.free[-3:] == AXES[3:]:
            return [*self.free[:-3], "ball"]
        return list(self.free)


def read_joints(bodies: Bodies, bound: Collection[str], notes: list[str]) -> list[UsdJoint]:
    """Return the joints of a stage in file order, ranked for the tree.

    The tree takes driven and coupled joints first, those that the file excludes from the articulation last;
    then those with armature, friction and limits before others, others before ball joints, and joints near
    the root before those far from it.

    Args:
        bound: Paths of the joints that are driven or coupled.
        notes: Remarks for the user, to which the disabled joints are added.

    Raises:
        ModelError: A joint is of a kind that records do not have, or is wrong.
    """
    prims = []
    for prim in bodies.stage.prims.values():
        if prim.kind == "PhysicsDistanceJoint" and prim.flag("physics:jointEnabled", True):
            raise prim.error(
                "a PhysicsDistanceJoint is not read; write two spherical joints with a rod between them"
            )
        if prim.kind not in (*TYPES, "PhysicsDistanceJoint"):
            continue
        if not prim.flag("physics:jointEnabled", True):
            notes.append(f"<{prim.path}> has physics:jointEnabled = false: it is not read")
            continue
        prims.append(prim)
    names = names_of(prims, set())
    joints = [_joint(bodies, prim, names[prim.path]) for prim in prims]
    for joint in joints:
        if len(joint.free) == len(AXES):
            notes.append(f"<{joint.prim.path}> locks no axis: it is not read")
    joints = [joint for joint in joints if len(joint.free) < len(AXES)]
    depths = _depths([WORLD, *roots_of(bodies, joints)], joints)
    return [
        replace(joint, needed=joint.prim.path in bound or joint.heavy, rank=(
            joint.prim.path not in bound, joint.closes, not (joint.heavy or is_limited(joint.prim)),
            joint.free == AXES[3:], sum(depths[end] for end in joint.ends),
        ))
        for joint in joints
    ]  # fmt: skip


def roots_of(bodies: Bodies, joints: list[UsdJoint]) -> list[str]:
    """Return the bodies in the order in which groups without the world start at them."""
    named = [path for path, body in bodies.moving.items() if body.has("PhysicsArticulationRootAPI")]
    return starts(bodies.moving, joints, named)


def _depths(roots: list[str], joints: list[UsdJoint]) -> dict[str, int]:
    """Return how many joints lie between each body and its root."""
    near = neighbours(joints)
    out: dict[str, int] = {}
    for root in roots:
        waiting = [] if root in out else [root]
        out.setdefault(root, 0)
        for body in waiting:
            for _, other in near.get(body, ()):
                if other not in out:
                    out[other] = out[body] + 1
                    waiting.append(other)
    return out


def _joint(bodies: Bodies, prim: Prim, name: str) -> UsdJoint:
    """Return a joint prim in the common form."""
    for limit in ("physics:breakForce", "physics:breakTorque"):
        if np.isfinite(prim.any_number(limit, np.inf)):
            raise prim.error(f"'{limit}' is finite, but joints do not break here; remove it")
    (first, first_frame), (second, second_frame) = (_end(bodies, prim, side) for side in (0, 1))
    if first is second:
        what = f"<{first.path}> to itself" if first else "two parts of the world, or bodies that do not move"
        raise prim.error(f"joins {what}; correct physics:body0 and physics:body1, or remove it")
    ends = (WORLD if first is None else first.path, WORLD if second is None else second.path)
    free, limits = _freedoms(prim)
    joint = UsdJoint(
        name, ends, (), None, prim.flag("physics:excludeFromArticulation", False), False, prim,
        (first, second), (first_frame, second_frame), free, limits,
    )  # fmt: skip
    _check_instances(joint)
    return joint


def _check_instances(joint: UsdJoint) -> None:
    """Refuse drives and limits of axes that the joint does not have under this name."""
    prim = joint.prim
    if prim.kind != "PhysicsJoint" and prim.instances("PhysicsLimitAPI"):
        raise prim.error(
            "PhysicsLimitAPI is of PhysicsJoint alone; state physics:lowerLimit and physics:upperLimit"
        )
    free = [joint.instance(axis) for axis in joint.free]
    wrong = [name for name in prim.instances("PhysicsDriveAPI") if name not in free]
    if wrong and joint.free != AXES[3:]:
        advice = f"its free axes are {', '.join(free)}" if free else "it has no free axis; remove the drive"
        raise prim.error(f"PhysicsDriveAPI:{wrong[0]} drives no axis of this joint: {advice}")


def _end(bodies: Bodies, prim: Prim, side: int) -> tuple[Prim | None, Array]:
    """Return the body at an end of a joint, and the joint's frame in it, shape (4, 4), [m]."""
    targets = prim.targets.get(f"physics:body{side}", [])
    turn, place = prim.rotation(f"physics:localRot{side}"), prim.vector(f"physics:localPos{side}", (0.0,) * 3)
    if not targets:
        return None, placement_from(turn, place * bodies.stage.meters)
    if len(targets) > 1:
        raise prim.error(f"physics:body{side} names {len(targets)} prims; name one")
    target = bodies.stage.prims.get(targets[0])
    if target is None:
        raise prim.error(f"physics:body{side} names <{targets[0]}>, which the stage does not have")
    frame = placement_from(turn, bodies.pose(target).point(place, bodies.stage.meters))
    body = bodies.body_of(target)
    return body, frame if body is target else bodies.in_body(target) @ frame


def _freedoms(prim: Prim) -> tuple[tuple[str, ...], dict[str, tuple[float, float]]]:
    """Return the free axes of a joint and their limits."""
    if prim.kind == "PhysicsFixedJoint":
        return (), {}
    if prim.kind == "PhysicsSphericalJoint":
        return AXES[3:], {}
    if prim.kind == "PhysicsJoint":
        return _generic_freedoms(prim)
    axis = prim.word("physics:axis", "X")
    if axis not in ("X", "Y", "Z"):
        raise prim.error(f"physics:axis '{axis}' is none of X, Y, Z")
    name = ("rot" if prim.kind == "PhysicsRevoluteJoint" else "trans") + axis
    unit = unit_of(prim, name)
    lower = prim.any_number("physics:lowerLimit", -np.inf) * unit
    upper = prim.any_number("physics:upperLimit", np.inf) * unit
    if lower > upper:
        raise prim.error("physics:lowerLimit is above physics:upperLimit; exchange them")
    return (name,), {name: (lower, upper)}


def _generic_freedoms(prim: Prim) -> tuple[tuple[str, ...], dict[str, tuple[float, float]]]:
    """Return the free axes of a generic joint: an axis is locked where low is above high."""
    limits = {}
    stated = prim.instances("PhysicsLimitAPI")
    for name in stated:
        if name not in AXES:
            raise prim.error(f"a limit of '{name}' is not read; hybridyn has limits of {', '.join(AXES)}")
    for axis in AXES:
        low, high = -np.inf, np.inf
        if axis in stated:
            low = prim.any_number(f"limit:{axis}:physics:low", -np.inf)
            high = prim.any_number(f"limit:{axis}:physics:high", np.inf)
        if low > high or (low == 0 and high == 0):
            continue
        if low == high:
            raise prim.error(
                f"axis {axis} is locked at {low:g}; lock it at 0 (low above high), and put the offset into "
                "localPos0 and localRot0"
            )
        limits[axis] = (low * unit_of(prim, axis), high * unit_of(prim, axis))
    if sum(axis.startswith("rot") for axis in limits) == 2:
        raise prim.error(
            "one rotation is locked and two are free, which is no universal joint in USD (the twist is "
            "locked) and no joint here; write two revolute joints with a small body between them"
        )
    return tuple(limits), limits


def unit_of(prim: Prim, axis: str) -> float:
    """Return the unit of positions along an axis [m or rad]."""
    return DEGREES if axis.startswith("rot") else prim.stage.meters


def direction(axis: str) -> Array:
    """Return the unit vector of an axis, shape (3,)."""
    out: Array = np.eye(3)["XYZ".index(axis[-1])]
    return out


def relative(bodies: Bodies, joint: UsdJoint) -> Array:
    """Return the second frame of a joint in the first, where the bodies stand in the file, shape (4, 4)."""
    first, second = (
        (np.eye(4) if body is None else bodies.pose(body).frame) @ frame
        for body, frame in zip(joint.bodies, joint.frames, strict=True)
    )
    return inverse(first) @ second
