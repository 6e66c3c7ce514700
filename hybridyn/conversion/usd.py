"""Write USD as text: one Xform with a rigid body for each link, joints, closures, and the scene's gravity.

Lengths are metres, z points up. What USD cannot say goes to the model file beside. Closures are excluded
from the articulation. A universal closure is no joint of USD. A massless body stands for it: it turns on the
first link, and holds the axis of the second one, about which the closing joint turns (see `parts`).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..description.closure_forms import ROWS
from ..description.names import unique
from ..description.placement import angle_of, free_pose, poses_at, rotation_to_axis, turned
from ..description.records import Array, Closure, Coupling, Description, Joint, Link
from ..description.side_cars.model_toml import model_file
from ..description.usd.schema import AXES, DEGREES
from ..joints.kinds import RotationKind
from .parts import POINT_INERTIA, in_parts, sizes_of, without_screws
from .request import (
    FORCES,
    FREED,
    PLAIN,
    USUAL_GRAVITY,
    ConversionRequest,
    Losses,
    Written,
    add_of_several,
    allowed,
    followers_of,
    numeral,
    principal,
    quaternion_of,
    rows_of,
    without_joints,
)


class UsdPrim:
    """A prim.

    Args:
        kind: Its type, "" for none.
        name: Its name, valid as an identifier.
        path: Its path.
    """

    def __init__(self, kind: str, name: str, path: str) -> None:
        self.kind, self.name, self.path = kind, name, path
        self.schemas: dict[str, None] = {}
        self._lines: list[str] = []
        self.children: list[UsdPrim] = []
        self._taken: set[str] = set()

    def child(self, kind: str, name: str) -> UsdPrim:
        """Add a prim below, whose name gets a number where another one has it."""
        name = unique(name, self._taken)
        out = UsdPrim(kind, name, f"{self.path}/{name}")
        self.children.append(out)
        return out

    def apply(self, schema: str) -> None:
        """Apply a schema, once."""
        self.schemas[schema] = None

    def line(self, text: str) -> None:
        """Add an attribute or relationship as text."""
        self._lines.append(text)

    def numbers(self, kind: str, name: str, values: float | Sequence[float] | Array) -> None:
        """Add an attribute of numbers."""
        self.line(f"{kind} {name} = {_tuple(np.ravel(values))}")

    def place(self, placement: Array) -> None:
        """Add the transform of the prim in its parent."""
        if not np.array_equal(placement, np.eye(4)):
            self.line(f"double3 xformOp:translate = {_tuple(placement[:3, 3])}")
            self.line(f"quatd xformOp:orient = {_tuple(quaternion_of(placement[:3, :3]))}")
            self.line('uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]')

    def lines(self, indent: str = "") -> Iterable[str]:
        """Yield the lines of the prim and of those below."""
        kind = f"{self.kind} " if self.kind else ""
        applied = ", ".join(f'"{schema}"' for schema in self.schemas)
        yield f'{indent}def {kind}"{self.name}"' + (
            f" (\n{indent}    prepend apiSchemas = [{applied}]\n{indent})" if applied else ""
        )
        yield indent + "{"
        for line in self._lines:
            yield f"{indent}    {line}"
        for child in self.children:
            yield ""
            yield from child.lines(indent + "    ")
        yield indent + "}"


def _tuple(numbers: Iterable[float]) -> str:
    parts = [numeral(number) for number in numbers]
    return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"


def add_body(parent: UsdPrim, link: Link, placement: Array) -> UsdPrim:
    """Add a rigid body at a placement in the world, shape (4, 4); a mass has an inertia there."""
    body = parent.child("Xform", link.name)
    body.apply("PhysicsRigidBodyAPI")
    body.apply("PhysicsMassAPI")
    body.place(placement)
    if not link.mass and not link.inertia.any():
        return body
    body.numbers("float", "physics:mass", link.mass)
    body.numbers("point3f", "physics:centerOfMass", link.com)
    moments, axes = principal(link.inertia)
    body.numbers("float3", "physics:diagonalInertia", moments)
    if not np.array_equal(axes, np.eye(3)):
        body.numbers("quatf", "physics:principalAxes", quaternion_of(axes))
    return body


#: What becomes of joints that are no type of USD.
REPLACED = {
    "floating": FREED,
    "continuous": "continuous joints, which USD does not have: read back as hinges",
    "planar": "planar joints are two slides and a hinge",
}

#: Free axes of joints without an axis of their own.
FREE: dict[str, tuple[str, ...]] = {
    "fixed": (),
    "spherical": AXES[3:],
    "planar": ("transX", "transY", "rotZ"),
}

#: Types of joints by their free axes; others are generic.
KINDS: dict[tuple[str, ...], str] = {
    (): "Fixed", AXES[3:]: "Spherical",
    **{(axis,): "Revolute" if axis in AXES[3:] else "Prismatic" for axis in AXES},
}  # fmt: skip


class End(NamedTuple):
    """An end of a joint: the body, None for the world, and the joint's frame in it, shape (4, 4)."""

    body: UsdPrim | None
    frame: Array


def start_joint(
    parent: UsdPrim, name: str, free: Collection[str], ends: tuple[End, End], *, closes: bool = False
) -> UsdPrim:
    """Add a joint that moves along some axes, of the type that says so, and return it.

    Args:
        parent: The prim that receives it.
        name: Its name.
        free: The axes, some of `AXES`; a generic joint locks others by a lower limit above the upper one.
        ends: Its ends.
        closes: Whether it closes a loop.
    """
    kind = KINDS.get((*free,), "")
    out = parent.child(f"Physics{kind}Joint", name)
    for side, (body, frame) in enumerate(ends):
        if body is not None:
            out.line(f"rel physics:body{side} = <{body.path}>")
        if frame[:3, 3].any():
            out.numbers("point3f", f"physics:localPos{side}", frame[:3, 3])
        if not np.array_equal(frame[:3, :3], np.eye(3)):
            out.numbers("quatf", f"physics:localRot{side}", quaternion_of(frame[:3, :3]))
    if closes:
        out.line("uniform bool physics:excludeFromArticulation = true")
    if kind in ("Revolute", "Prismatic"):
        out.line(f'uniform token physics:axis = "{next(iter(free))[-1]}"')
    for axis in AXES if not kind else ():
        if axis not in free:
            out.apply(f"PhysicsLimitAPI:{axis}")
            out.line(f"float limit:{axis}:physics:low = 1")
            out.line(f"float limit:{axis}:physics:high = -1")
    return out


def add_joint(
    parent: UsdPrim, joint: Joint, bodies: tuple[UsdPrim, UsdPrim], driven: bool,
    home: tuple[float, ...] | None, losses: Losses,
) -> UsdPrim | None:  # fmt: skip
    """Add a joint of the tree and return it; None for a floating joint, which USD states by having none.

    Args:
        parent: The prim that receives it.
        joint: The joint.
        bodies: The bodies of its links.
        driven: Whether it is a motor.
        home: Its position at home, None for zero.
        losses: Receives what USD cannot say.
    """
    if joint.kind in REPLACED:
        losses.add(REPLACED[joint.kind], joint.name)
    add_of_several(joint, losses, forces=() if joint.kind == "spherical" else FORCES)
    if joint.kind == "floating":
        return None
    free, turn = FREE.get(joint.kind), np.eye(3)
    if free is None:
        free, turn = ("transZ" if joint.kind == "prismatic" else "rotZ",), rotation_to_axis(joint.axis)
    ends = End(bodies[0], turned(joint.placement, turn)), End(bodies[1], turned(np.eye(4), turn))
    out = start_joint(parent, joint.name, free, ends)
    if joint.kind.single:
        _add_numbers(out, joint, driven, home, losses)
    return out


def unit_of(joint: Joint) -> float:
    """Return the unit of positions of a joint in USD [m or rad]."""
    return 1.0 if joint.kind == "prismatic" else DEGREES


def _add_numbers(
    prim: UsdPrim, joint: Joint, driven: bool, home: tuple[float, ...] | None, losses: Losses
) -> None:
    """Add limits, drive, armature, friction and position of a joint with one freedom."""
    name, unit = "linear" if joint.kind == "prismatic" else "angular", unit_of(joint)
    if driven:
        prim.apply(f"PhysicsDriveAPI:{name}")
        prim.line(f'uniform token drive:{name}:physics:type = "force"')
        for word in ("stiffness", "damping"):
            prim.line(f"float drive:{name}:physics:{word} = 0")
    elif np.isfinite(joint.effort_limit):
        losses.add("effort limits of joints without a motor", joint.name)
    drive, engine, axis = f"PhysicsDriveAPI:{name}", "PhysxJointAPI", f"PhysxJointAxisAPI:{name}"
    rows = (
        (joint.lower, "", "physics:lowerLimit", unit),
        (joint.upper, "", "physics:upperLimit", unit),
        (joint.effort if driven else np.inf, drive, f"drive:{name}:physics:maxForce", 1.0),
        (joint.velocity, engine, "physxJoint:maxJointVelocity", unit),
        (joint.armature or np.inf, engine, "physxJoint:armature", 1.0),
        (joint.friction or np.inf, axis, f"physxJointAxis:{name}:staticFrictionEffort", 1.0),
        (joint.friction or np.inf, axis, f"physxJointAxis:{name}:dynamicFrictionEffort", 1.0),
        (joint.damping or np.inf, axis, f"physxJointAxis:{name}:viscousFrictionCoefficient", 1 / unit),
        (
            np.inf if home is None else angle_of(home), f"PhysicsJointStateAPI:{name}",
            f"state:{name}:physics:position", unit,
        ),
    )  # fmt: skip
    for value, schema, attribute, of_file in rows:
        if np.isfinite(value):
            if schema:
                prim.apply(schema)
            prim.numbers("float", attribute, value / of_file)


def behind(closure: Closure) -> RotationKind | None:
    """Return the rotation that a closure locks behind a chain, None for a joint of USD."""
    return "parallel" if closure.rotation == "perpendicular" else None


def add_closure(parent: UsdPrim, closure: Closure, bodies: tuple[UsdPrim, UsdPrim], losses: Losses) -> None:
    """Add a closure, which is a joint of USD.

    Args:
        parent: The prim that receives it.
        closure: The closure.
        bodies: The bodies of its links.
        losses: Receives what USD cannot say.
    """
    words, turn = rows_of(closure, losses)
    free = [axis for row, axis in zip(ROWS, AXES, strict=True) if row not in words.split()]
    ends = End(bodies[0], turned(closure.frame_a, turn.T)), End(bodies[1], turned(closure.frame_b, turn.T))
    start_joint(parent, closure.name, free, ends, closes=True)


def write_usd(request: ConversionRequest, losses: Losses) -> Written:
    """Write a robot as USD."""
    d = without_screws(allowed(request.description, losses, "USD", valid_name), losses)
    d = _with_inertias(d, losses)
    gone = [joint.name for joint in d.joints if joint.kind in ("planar", "floating")]
    d = in_parts(without_joints(d, gone, losses), losses, (), behind)
    top = UsdPrim("", "", "")
    robot = top.child("Xform", valid_name(d.name))
    if robot.name != d.name:
        losses.add("the name of the robot, which USD does not allow", d.name)
    base_home = d.base_home if d.base == "floating" else None
    poses = poses_at(d, d.home, None if base_home is None else free_pose(base_home))
    bodies = {link.name: add_body(robot, link, poses[link.name]) for link in d.links}
    if request.shapes:
        losses.add("visual shapes, which convert does not write to USD")
    if d.base == "floating":
        bodies[d.root].apply("PhysicsArticulationRootAPI")
    else:
        ends = End(None, np.eye(4)), End(bodies[d.root], np.eye(4))
        start_joint(robot, "root_joint", (), ends).apply("PhysicsArticulationRootAPI")
    motors = {*d.motors}
    joints = [
        add_joint(
            robot, joint, (bodies[joint.parent], bodies[joint.child]), joint.name in motors,
            d.home.get(joint.name), losses,
        )
        for joint in d.joints
    ]  # fmt: skip
    for closure in d.closures:
        add_closure(robot, closure, (bodies[closure.link_a], bodies[closure.link_b]), losses)
    by_name = {joint.name: (joint, prim) for joint, prim in zip(d.joints, joints, strict=True) if prim}
    followers, left = followers_of(d.couplings, losses)
    for name, (leader, factor, offset) in followers.items():
        _add_mimic(*by_name[name], *by_name[leader], factor, offset)
    _add_scene(top, d)
    return Written(_text(robot, top), tuple(_notes(d)), {".model.toml": _model_file(d, left)})


def valid_name(name: str) -> str:
    """Return a name as USD has them: letters, digits and underscores, no digit first."""
    valid = re.sub(r"[^A-Za-z0-9_]", "_", name)
    return f"_{valid}" if valid[:1].isdigit() else valid


def _with_inertias(d: Description, losses: Losses) -> Description:
    """Return a robot without point masses: USD takes an inertia of zero for none stated."""
    size = sizes_of(d).size
    links = []
    for link in d.links:
        if link.mass and not link.inertia.any():
            losses.add("links without inertia, which USD cannot say: written with a small one", link.name)
            link = replace(link, inertia=POINT_INERTIA * link.mass * size**2 * np.eye(3))
        links.append(link)
    return replace(d, links=tuple(links))


def _text(robot: UsdPrim, top: UsdPrim) -> str:
    """Return the text of a file, whose default prim is the robot."""
    head = (
        f'#usda 1.0\n(\n    defaultPrim = "{robot.name}"\n    metersPerUnit = 1\n    kilogramsPerUnit = 1\n'
        '    upAxis = "Z"\n)\n'
    )
    return head + "".join("\n" + "\n".join(prim.lines()) + "\n" for prim in top.children)


def _add_mimic(
    own: Joint, prim: UsdPrim, leader: Joint, its_prim: UsdPrim, factor: float, offset: float
) -> None:
    """Add to a joint with one freedom that it follows another one, as a mimic joint of PhysX."""
    prim.apply("PhysxMimicJointAPI:rotZ")
    prim.line(f"rel physxMimicJoint:rotZ:referenceJoint = <{its_prim.path}>")
    prim.line('uniform token physxMimicJoint:rotZ:referenceJointAxis = "rotZ"')
    prim.numbers("float", "physxMimicJoint:rotZ:gearing", -factor * unit_of(leader) / unit_of(own))
    if offset:
        prim.numbers("float", "physxMimicJoint:rotZ:offset", -offset / unit_of(own))


def _add_scene(top: UsdPrim, d: Description) -> None:
    scene = top.child("PhysicsScene", "physics_scene")
    gravity = np.array(d.gravity or USUAL_GRAVITY)
    size = float(np.linalg.norm(gravity))
    scene.numbers("vector3f", "physics:gravityDirection", gravity / size if size else (0.0, 0.0, -1.0))
    scene.numbers("float", "physics:gravityMagnitude", size)


def _model_file(d: Description, couplings: list[Coupling]) -> str:
    """Return the model file: motors, effects, other couplings, and numbers that no prim holds."""
    numbers: dict[str, dict[str, float]] = {}
    for joint in d.joints:
        geared = joint.kind.single and joint.gear_ratio != 1
        words = FORCES if joint.kind == "spherical" else FORCES[2:] if geared else ()
        stated = {word: getattr(joint, word) for word in words}
        numbers[joint.name] = {word: x for word, x in stated.items() if x != getattr(PLAIN, word)}
    joints = {name: table for name, table in numbers.items() if table}
    effects = [name for name, _ in d.effects]
    return model_file(d, motors=True, joints=joints, couplings=couplings, effects=effects)


def _notes(d: Description) -> list[str]:
    out = ["USD states frames, masses and limits in single precision, with 7 digits"]
    if any(not link.mass for link in d.links):
        out.append("links without mass have none in hybridyn; PhysX takes 1 kg for each, Newton refuses some")
    return out
