"""Read a USD stage: its layers, which may be in the robot's folders only; its prims become records.

What hybridyn does not have is an error that names the prim. What does not change the motion is left out, with
a remark where other engines might use it. What USD would compute from the shapes of colliders is refused.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Sdf, Tf, Usd

from ...errors import ModelError
from ...joints.kinds import JointKind
from ..closure_forms import ROWS, closure_of, form_of_rows
from ..joint_chains import step
from ..joint_graph import Chain, GraphTree, JointGraph, span
from ..joint_words import UNIVERSAL
from ..motors import MEND
from ..names import noted
from ..placement import rotation_to_axis
from ..records import Array, Closure, Link, MotorStatement, RobotFile
from ..urdf.robot_folders import RobotFolders
from .joints import (
    HINTS,
    UsdJoint,
    add_home,
    coupled,
    couplings,
    direction,
    instance,
    names_of,
    numbers_of,
    read_joints,
    roots_of,
    unread_numbers,
)
from .schema import AXES, BODY
from .screening import screen
from .stage import Prim, UsdStage

MASS, CENTRE = "physics:mass", "physics:centerOfMass"
INERTIA, PRINCIPAL, PER_VOLUME = "physics:diagonalInertia", "physics:principalAxes", "physics:density"

#: Schemas by which a body, a collider or a material states masses; without one USD leaves them out.
MASS_SCHEMAS = ("PhysicsMassAPI", "NewtonMassAPI", "PhysicsMaterialAPI")

#: Gravity where a file does not state it [m/s^2].
EARTH = 9.81


def links_of(stage: UsdStage, names: Mapping[str, str]) -> list[Link]:
    """Return the moving bodies as links.

    Args:
        stage: The stage.
        names: Names of the links by path.

    Raises:
        ModelError: A mass is negative, or would follow from shapes.
    """
    colliders: dict[Prim, Prim] = {}
    for prim in stage.prims.values():
        if prim.has("PhysicsCollisionAPI") and prim.body is not None:
            colliders.setdefault(prim.body, prim)
        elif prim.has("PhysicsMassAPI") and prim.body not in (None, prim):
            raise prim.error(
                "states a mass but is neither a body nor a collider; apply PhysicsRigidBodyAPI to it, or "
                "state the mass on its body"
            )
    return [_link(prim, colliders.get(prim), names[path]) for path, prim in stage.moving.items()]


def _link(body: Prim, collider: Prim | None, name: str) -> Link:
    states = body.has(*MASS_SCHEMAS)
    mass, density = (body.number(word, 0.0) if states else 0.0 for word in (MASS, PER_VOLUME))
    if mass < 0:
        raise body.error(f"'{MASS}' is negative")
    com, inertia = (_centre(body), _inertia(body)) if states else (None, None)
    stated = {MASS: mass or None, CENTRE: com, INERTIA: inertia}
    missing = " and ".join(word for word, value in stated.items() if value is None)
    if collider is not None and missing:
        raise body.error(
            f"{missing} would follow from its colliders (<{collider.path}>, a {collider.kind or 'prim'}), "
            f"which is not computed; author {MASS}, {CENTRE} and {INERTIA}"
        )
    if mass and inertia is None:
        raise body.error(f"states a mass but no inertia, and has no collider; author {INERTIA}")
    if density and not mass:
        raise body.error(f"states a density but has no collider; author {MASS} and {INERTIA}")
    com = np.zeros(3) if com is None else com
    return Link(name, mass * body.stage.kilograms, com, np.zeros((3, 3)) if inertia is None else inertia)


def _compensated(stage: UsdStage, names: Mapping[str, str], unread: list[str]) -> dict[str, float]:
    """Return the part of its weight that each body is relieved of, by its name.

    Args:
        names: Names of the links by path.
        unread: Receives MuJoCo's number where PhysX states another one.
    """
    out: dict[str, float] = {}
    for path, body in stage.moving.items():
        stated = body.number("mjc:gravcomp", 0.0)
        fraction = 1.0 if body.flag("physxRigidBody:disableGravity", False) else stated
        if stated not in (0.0, fraction):
            unread.append(f"mjc:gravcomp of {path}")
        out |= {names[path]: fraction} if fraction else {}
    return out


def _centre(body: Prim) -> Array | None:
    """Return the stated centre of mass, shape (3,), [m], or None; USD's "none" is -inf."""
    value = body.vector(CENTRE, [-np.inf] * 3, finite=False)
    if np.isneginf(value).any():
        return None
    if not np.isfinite(value).all():
        raise body.error(f"'{CENTRE}' is not finite")
    return body.point(value)


def _inertia(body: Prim) -> Array | None:
    """Return the stated inertia, shape (3, 3), [kg m^2], or None; USD's "none" is zero."""
    moments = body.vector(INERTIA, (0.0, 0.0, 0.0)) * body.stage.kilograms * body.stage.meters**2
    if not moments.any():
        return None
    axes = body.rotation(PRINCIPAL) if body.vector(PRINCIPAL, (0.0,) * 4).any() else np.eye(3)
    inertia: Array = axes @ np.diag(moments) @ axes.T
    return (inertia + inertia.T) / 2


def gravity_of(stage: UsdStage) -> tuple[float, float, float] | None:
    """Return the acceleration of gravity in the world [m/s^2], or None if the file states nothing about it.

    It is that of the scene, else the earth's against the up axis.

    Raises:
        ModelError: Several scenes state different gravity.
    """
    scenes = [prim for prim in stage.prims.values() if prim.kind == "PhysicsScene"]
    if not scenes and stage.down[2]:
        return None
    found = [_of_scene(scene) for scene in scenes] or [stage.down * EARTH]
    for scene, other in zip(scenes, found, strict=False):
        if not np.array_equal(found[0], other):
            raise scene.error(f"states another gravity than <{scenes[0].path}>; keep one scene")
    x, y, z = (float(part) + 0.0 for part in found[0])
    return x, y, z


def _of_scene(scene: Prim) -> Array:
    if not scene.flag("newton:gravityEnabled", True) or not scene.flag("mjc:flag:gravity", True):
        return np.zeros(3)
    direction = scene.vector("physics:gravityDirection", (0.0, 0.0, 0.0))
    length = float(np.linalg.norm(direction))
    down = direction / length if length else scene.stage.down
    magnitude = scene.number("physics:gravityMagnitude", -np.inf)
    return down * (EARTH if magnitude == -np.inf else magnitude * scene.stage.meters)


_PLACE = re.compile(r"'?([^':\n]+):(\d+):\d+: ([^\n]*)")
_GRAMMAR = re.compile(r"parse error matching .*?(?= at '|$)")
_QUOTED = re.compile(r": '(.*?)'?\s*$", re.DOTALL)


def read_stage(file: str, package_dirs: list[str]) -> RobotFile:
    """Read a USD file in this process.

    Args:
        file: Path of the file.
        package_dirs: Folders, beside the robot's own, in which layers may be.

    Raises:
        ModelError: OpenUSD refuses the file, or it states something that hybridyn does not have.
    """
    try:
        folders = RobotFolders(os.path.abspath(file), package_dirs, [])
        return _read(UsdStage(open_stage(file, folders), file))
    except Tf.ErrorException as error:
        raise _refusal(error, file) from None


def open_stage(file: str, folders: RobotFolders) -> Any:
    """Open a file with the layers that it names.

    Args:
        file: Path of the file.
        folders: The folders in which layers may be.

    Raises:
        ModelError: A layer cannot be read, or may not be.
        Tf.ErrorException: OpenUSD refuses a layer, see `_refusal`.
    """
    root = _opened(os.path.abspath(file), "it", file)
    _check_layers(root, folders, file)
    stage = Usd.Stage.Open(root)
    for problem in stage.GetCompositionErrors():
        raise ModelError(f"OpenUSD: {' '.join(str(problem).split())}", file=file)
    return stage


def _check_layers(root: Any, folders: RobotFolders, file: str) -> None:
    """Check the layers that a layer names, those that they name, and so on."""
    waiting, seen = [root], {root.identifier}
    while waiting:
        layer = waiting.pop()
        for asset in layer.GetCompositionAssetDependencies():
            path = layer.ComputeAbsolutePath(asset) if asset else ""  # one prim may name another
            if not path or path in seen:
                continue
            seen.add(path)
            if "`" in asset:
                raise ModelError(
                    f"layer '{asset}': expressions in paths are not read; write the path", file=file
                )
            try:
                folders.read(Ar.SplitPackageRelativePathOuter(path)[0] or path)
            except (ModelError, OSError, ValueError) as error:
                reason = f"cannot be read: {error.strerror}" if isinstance(error, OSError) else error
                raise ModelError(f"layer '{asset}': {reason}", file=file) from None
            waiting.append(_opened(path, f"layer '{asset}'", file))


def _opened(path: str, name: str, file: str) -> Any:
    layer = Sdf.Layer.FindOrOpen(path)
    if layer is None:
        raise ModelError(f"OpenUSD cannot read {name}", file=file)
    return layer


def _refusal(error: Exception, file: str) -> ModelError:
    """Return the refusal of a file with OpenUSD's reason, and its file and line where it names them."""
    text = str(error)
    if place := _PLACE.search(text):
        reason = _GRAMMAR.sub("it is not well formed", place[3].strip())
        other = os.path.exists(place[1]) and not os.path.samefile(place[1], file)
        where = os.path.relpath(place[1]) if other else file
        return ModelError(f"OpenUSD: {reason}", file=where, line=int(place[2]))
    first = next((line for line in text.splitlines() if line.strip()), type(error).__name__)
    quoted = _QUOTED.search(first)
    return ModelError(f"OpenUSD: {' '.join((quoted[1] if quoted else first).split())}", file=file)


def _read(stage: UsdStage) -> RobotFile:
    default = stage.usd.GetDefaultPrim()
    name = default.GetName() if default else Path(stage.file).name.partition(".")[0] or "robot"
    robot = RobotFile(str(name), stage.file, format="USD")
    robot.notes += noted(screen(stage))
    if not stage.moving:
        raise ModelError(f"no prim has {BODY}; a robot has at least one body", file=stage.file)
    _UsdBuilder(robot, stage).build()
    robot.gravity = gravity_of(stage)
    _add_notes(robot, stage)
    return robot


class _UsdBuilder:
    """Makes the record of a robot of its bodies and joints.

    Attributes:
        actuated: Paths of the joints on which actuators of MuJoCo act.
        made: The joints that have a position, each with whether its second body is the child.
        motors: Names of the driven joints.
    """

    def __init__(self, robot: RobotFile, stage: UsdStage) -> None:
        self.robot, self.stage = robot, stage
        prims = stage.prims.values()
        actuators = (prim.targets("mjc:target") for prim in prims if prim.kind == "MjcActuator")
        self.actuated = {path for targets in actuators for path in targets}
        bound = self.actuated | {prim.path for prim in prims if _drives(prim)} | coupled(stage)
        self.joints = read_joints(stage, bound, robot.notes)
        links = names_of(stage.moving.values())
        self.graph = JointGraph(robot, links, {joint.name for joint in self.joints}, "{joint}_fixed")
        self.made: list[tuple[UsdJoint, bool]] = []
        self.motors: list[str] = []

    def build(self) -> None:
        """Add links, joints, closures, couplings, motors and home to the robot."""
        robot, stage = self.robot, self.stage
        tree = span(roots_of(stage, self.joints), self.joints)
        self._note(tree)
        unread = [
            f"{name} of {joint.prim.path}"
            for joint in self.joints
            for axis in joint.chain
            for name in unread_numbers(joint.prim, axis)
        ]
        poses = {path: prim.pose for path, prim in stage.moving.items()}
        welds = [
            joint for joint in self.joints
            if not joint.limits and all(np.array_equal(frame, np.eye(4)) for frame in joint.frames)
        ]  # fmt: skip
        robot.links += links_of(stage, self.graph.links)
        self.graph.fill(tree, poses, welds, self._chain, _closing)
        robot.couplings += couplings(stage, {joint.prim.path: joint for joint in self.joints}, unread)
        if light := _compensated(stage, self.graph.links, unread):
            robot.effects += (("gravity_compensation", {"fraction": light}),)
        robot.notes += noted({"numbers are not read where another engine states other ones: {}": unread})
        if self.motors or robot.left_out:
            names, where = tuple(self.motors), "USD PhysicsDriveAPI"
            robot.motors.append(MotorStatement("actuator", where, names, robot.file))
        add_home(robot, stage, self.made)

    def _chain(self, joint: UsdJoint, forward: bool) -> Chain:
        """Return a joint as a chain from its parent to its child; add its motors."""
        steps = []
        for axis in joint.chain:
            single = len(joint.chain) == 1
            name = joint.name if single else self.graph.joint_name(f"{joint.name}_{axis}")
            joint.names[axis] = name
            numbers = numbers_of(joint.prim, axis)
            if axis == "ball":
                steps.append(step(name, JointKind.SPHERICAL, **numbers))
            else:
                lower, upper = joint.limits[axis]
                kind: JointKind = JointKind.REVOLUTE if axis.startswith("rot") else JointKind.PRISMATIC
                steps.append(step(name, kind, direction(axis), lower=lower, upper=upper, **numbers))
            self._add_motor(joint.prim, axis, name, single)
        self.made.append((joint, forward))
        return (steps, joint.frames) if forward else (steps[::-1], joint.frames[::-1])

    def _add_motor(self, prim: Prim, axis: str, name: str, single: bool) -> None:
        """Add an axis of a joint, which may be its single one, to the motors if it is driven."""
        drives, acted = _drives(prim), prim.path in self.actuated
        if axis == "ball" and (acted or drives):
            self.robot.left_out += (prim.path,)
            self.robot.notes.append(
                f"<{prim.path}> is driven, but has several freedoms: its drive is no motor here. {MEND}"
            )
        elif (acted and single) or instance(prim, axis) in drives:
            self.motors.append(name)

    def _note(self, tree: GraphTree[UsdJoint]) -> None:
        """Add remarks where the cuts are not those of the file."""
        own = [joint.prim.path for joint in tree.cut if not joint.closes]
        kept = [joint.prim.path for joint, _ in tree.branches if joint.closes]
        limited = [joint.prim.path for joint in tree.cut if joint.limited and not joint.needed]
        fast = [joint.prim.path for joint in tree.cut if joint.has_speed and not joint.needed]
        still = [joint for joint in tree.cut if not joint.needed]
        still += [joint for joint, _ in tree.branches if "ball" in joint.chain]
        placed = [joint.prim.path for joint in still if joint.is_placed]
        self.robot.notes += noted({
            "joints {} close loops and are cut there; to cut other joints, set "
            "physics:excludeFromArticulation = true on those": own,
            "joints {} are excluded from the articulation, but are driven or coupled, or are the only joint "
            "of a body: they are joints of the tree": kept,
            "limits of joints that close loops are not read: {}": limited,
            "limits of speed of joints that close loops are not read: {}": fast,
            "positions at the start of balls and of joints that close loops are not read (those of bodies "
            "count): {}": placed,
        })  # fmt: skip


def _drives(prim: Prim) -> list[str]:
    """Return the axes of a joint on which drives act with a force ("angular")."""
    return [
        name for name in prim.instances("PhysicsDriveAPI")
        if prim.number(f"drive:{name}:physics:maxForce", np.inf, finite=False)
    ]  # fmt: skip


def _closing(joint: UsdJoint, links: tuple[str, str]) -> Closure:
    """Return a joint as a closure between two links."""
    if tuple(joint.limits) == HINTS[UNIVERSAL]:
        axes = [rotation_to_axis(direction(axis)) for axis in joint.limits]
        return closure_of(joint.name, UNIVERSAL, zip(links, joint.frames, strict=True), axes, line=joint.line)
    form = form_of_rows(
        " ".join(row for row, axis in zip(ROWS, AXES, strict=True) if axis not in joint.limits)
    )
    kind = joint.prim.kind.removeprefix("Physics").removesuffix("Joint").lower() or "rows"
    sides, turns = zip(links, joint.frames, strict=True), (form.rotation_of_frames,) * 2
    return closure_of(joint.name, kind, sides, turns, form, joint.line)


def _add_notes(robot: RobotFile, stage: UsdStage) -> None:
    """Add remarks on what is taken by default or left out."""
    prims = stage.prims.values()
    light = [link for link in robot.links if not link.mass and not link.between_joints]
    robot.notes += noted({
        "the file states no metersPerUnit: lengths are in centimetres, the default of USD":
            [] if stage.usd.HasAuthoredMetadata("metersPerUnit") else [stage.file],
        "bodies {} are kinematic or disabled: they are read as parts of the world":
            [prim.path for prim in prims if prim.has(BODY) and prim.body is None],
        "bodies {} state no mass and have none here (PhysX would take 1 kg)":
            [link.name for link in light if link.name != "world"],
        "contacts between colliders are not read: the robot touches nothing (the effect ground_contact has "
        "points on compliant ground)":
            [prim.path for prim in prims if prim.has("PhysicsCollisionAPI")][1:],
    })  # fmt: skip
