"""`load` and `from_pinocchio`: build a `HybridRobot` from a robot's files, or from a Pinocchio model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextvars import ContextVar
from os import PathLike
from typing import TYPE_CHECKING, Any

from .logs import warn
from .spatial import Array
from .structure.building import build_robot
from .structure.robot import Base, HybridRobot

if TYPE_CHECKING:
    import pinocchio as pin

    from .description.records import Description

#: Whether it is logged what was decided about ranks; commands but `info` do not repeat it.
ranks_are_said = ContextVar("ranks_are_said", default=True)


def load(
    path: str | PathLike[str],
    *,
    base: Base | None = None,
    motors: Sequence[str] | None = None,
    gravity: tuple[float, float, float] | None = None,
    xacro_args: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    held: Sequence[str] = (),
    strict: bool = False,
) -> HybridRobot:
    """Load a robot from URDF, xacro, MJCF, SDF or USD, with its loop closures in any of the supported forms.

    Args:
        path: The robot's file, which may have a side-car (`robot.yaml`, `model.toml`) beside it; or the name
            of a shipped robot, "lx4". An existing path takes precedence. "world.sdf#arm" is the model "arm"
            of an SDF file.
        base: "fixed", "moving" (prescribed motion) or "floating" (free): the last two put a free-flyer first
            in q, v, a, with Pinocchio's local velocities. None uses the base that the file states: "floating"
            for an MJCF robot on a free joint and for an SDF or USD robot that no joint connects to the world,
            else "fixed".
        motors: Names of the driven joints, instead of those in the files.
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2]; None uses that of the file (MJCF,
            SDF, USD), else (0, 0, -9.81).
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `$(find package)` and `package://` search, and from which MJCF, SDF
            and USD files may include files.
        rank_tolerance: Relative singular value below which closure rows count as dependent. By default it is
            determined at generic postures.
        closure_tolerance: Largest closure residual that is accepted as rounding in the file, relative to the
            module's length.
        held: Passive joints that are never removed with a wrist, so that effects can act on them.
        strict: Whether notes are errors: what the reader read past (`robot.notes`), and signs of loops that
            the files do not state.

    Warnings in the log "hybridyn" name physics of the files that is dropped (notes with "drops"), signs of
    loops that the files do not state, moving links without mass, modules whose motors lose a direction in
    every posture, and loops that are open at home.

    Raises:
        ModelError: The files are wrong or not supported, or do not determine the rank of a module; or there
            are notes, and this is `strict`.
        AssemblyError: No posture closes a module's loops.

    Example:
        >>> robot = hybridyn.load("five_bar", gravity=[0.0, 0.0, -3.71])
        >>> robot.motors, robot.mobility, robot.nq
        (('m1_left_drive', 'm1_right_drive'), 2, 4)
    """
    from .description import read
    from .description.shipped import find_robot

    description = read(
        find_robot(path), motors=motors, xacro_args=xacro_args, package_dirs=package_dirs, strict=strict
    )
    return _built(
        description,
        base=base,
        gravity=gravity,
        rank_tolerance=rank_tolerance,
        closure_tolerance=closure_tolerance,
        held=held,
    )


def from_pinocchio(
    model: pin.Model,
    constraint_models: object = (),
    *,
    kinds: Mapping[str | int, str] | None = None,
    home: str | Sequence[float] | Array | None = None,
    base: Base | None = None,
    motors: Sequence[str] | None = None,
    gravity: tuple[float, float, float] | None = None,
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    held: Sequence[str] = (),
) -> HybridRobot:
    """Build a robot from a Pinocchio model and the constraint models that close its loops.

    The robot's q and v have the order and the coordinates of the model, with one exception: a mimicking joint
    has no coordinate in Pinocchio, but has one here, and a coupling relates it to the joint that it mimics.
    A composite joint becomes a chain of joints ("name_1", "name_2", ...). Body and operational frames become
    links.

    Args:
        model: The model.
        constraint_models: Rigid constraint models (CONTACT_3D, CONTACT_6D) or Pinocchio 4's point and frame
            anchors, in a list of any kind.
        kinds: Kinds of closure that replace those of the constraints, by constraint name or number:
            "revolute", "prismatic", "cylindrical", "planar", "spherical" or "fixed". The axis is the third
            axis of the constraint's frames.
        home: The home posture: a configuration of the model, shape (nq,), or the name of one of its reference
            configurations. None uses "home", else the first of them, else `pin.neutral`.
        base: As in `load`. None means "floating" for a model on a free-flyer that no constraint ties to the
            world, else "fixed".
        motors: Names of the driven joints. None means every joint of a tree; in a robot with loops, it means
            the joints with an effort limit, if not all have one.
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2]; None uses that of the model.
        rank_tolerance: As in `load`.
        closure_tolerance: As in `load`.
        held: As in `load`.

    Raises:
        ModelError: hybridyn does not support a part of the model or of a constraint; the message names it.
        AssemblyError: No posture closes a module's loops.

    Example:
        >>> import pinocchio as pin
        >>> model = pin.buildSampleModelManipulator()
        >>> robot = hybridyn.from_pinocchio(model)
        >>> robot.mobility, robot.nv == model.nv
        (6, True)
    """
    from .description.pin_model import read_model
    from .description.reading import complete
    from .description.validate import validate

    read = read_model(model, constraint_models, kinds=kinds, home=home)
    validate(read)
    return _built(
        complete(read, motors=motors),
        base=base,
        gravity=gravity,
        rank_tolerance=rank_tolerance,
        closure_tolerance=closure_tolerance,
        held=held,
    )


def _built(description: Description, **options: Any) -> HybridRobot:
    """Build a robot, and log what looks wrong in it; the options are those of `build_robot`."""
    robot = build_robot(description, **options)
    _warn(robot)
    return robot


def _warn(robot: HybridRobot) -> None:
    """Log dropped physics, lost loops and masses, open loops, and modules that are singular everywhere."""
    from .assembly.motor_share import architecturally_singular
    from .description.names import drops

    for lost in (*drops(robot.notes), *of_files(robot.description)):
        warn("robot '%s': %s", robot.name, lost)

    for module in {id(module.mechanism): module for module in reversed(robot.modules)}.values():
        if (decided := module.mechanism.rank_decision) and ranks_are_said.get():
            warn("module '%s': %s", module.name, decided, log="hybridyn.rank")
        if singular := architecturally_singular(module):
            warn("module '%s' is %s", module.name, singular)

    if opened := _open_at_home(robot):
        warn("robot '%s': %s", robot.name, opened)


def _open_at_home(robot: HybridRobot) -> str:
    """Say by how much loops are open at the home posture, "" if they are closed."""
    from .assembly.task import residuals

    open_by = [(float(abs(x).max()), module) for module, x in residuals(robot, robot.home[None])]
    opened = [(size, module) for size, module in open_by if size > robot.closure_tolerance]
    if not opened:
        return ""
    size, module = max(opened, key=lambda one: one[0])
    others = f" and those of {len(opened) - 1} others" if len(opened) > 1 else ""
    return (
        f"the loops of module '{module.name}'{others} are open at home, by up to {size:.2g} of its size "
        f"({module.mechanism.length:.4g} m), limit {robot.closure_tolerance:g}: what starts at home "
        "assembles first, perhaps on another branch; 'hybridyn home --write' finds a closed posture"
    )


def of_files(description: Description) -> list[str]:
    """Return what the files seem to lack: loops, and the mass of moving bodies, one sentence per finding."""
    from .description.loop_signs import has_mass, lost_loops, weightless
    from .description.names import listed

    out = [f"{sign.message}; {sign.mend}" for sign in lost_loops(description)]
    light = [joint.child for joint in weightless(description)]
    if any(joint.kind != "fixed" for joint in description.joints) and not has_mass(description):
        out.append("no link has mass (<inertial>), so efforts of gravity and inertia are zero")
    elif light:
        one = len(light) == 1
        out.append(
            f"{'link' if one else 'links'} {listed(light)} {'moves and has' if one else 'move and have'} no "
            "mass: efforts leave out this weight; add <inertial>, or a fixed joint to a link that has one"
        )
    return out
