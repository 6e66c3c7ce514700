"""`load`: build a `HybridRobot` from a robot's files."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from os import PathLike

from .structure.building import build_robot
from .structure.robot import Base, HybridRobot

_log = logging.getLogger("hybridyn")


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
) -> HybridRobot:
    """Load a robot from URDF, xacro or MJCF, with its loop closures in any of the supported forms.

    Args:
        path: The robot's file, which may have a side-car (`robot.yaml`, `model.toml`) beside it; or the name
            of a shipped robot, "lx4". An existing path takes precedence.
        base: "fixed", "moving" (prescribed motion) or "floating" (free): the last two put a free-flyer first
            in q, v, a, with Pinocchio's local velocities. None takes what the file says: "floating"
            for an MJCF robot on a free joint, else "fixed".
        motors: Names of the driven joints, instead of those in the files.
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2]; None takes what the file says
            (MJCF), else (0, 0, -9.81).
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `$(find package)` and `package://` look, and from which MJCF may
            include files.
        rank_tolerance: Relative singular value below which closure rows count as dependent; where left out,
            it is determined at generic postures.
        closure_tolerance: Largest closure residual that is accepted as rounding in the file, relative to the
            module's length.
        held: Passive joints that are never removed with a wrist, so that effects can act on them.

    Warnings in the log "hybridyn" name signs of loops that the files do not state, moving links without mass,
    and modules whose motors lose a direction in every posture.

    Raises:
        ModelError: The files are wrong or not supported, or do not determine the rank of a module.
        AssemblyError: No posture closes a module's loops.
    """
    from .description import read
    from .description.shipped import find_robot

    description = read(find_robot(path), motors=motors, xacro_args=xacro_args, package_dirs=package_dirs)
    robot = build_robot(
        description,
        base=base,
        gravity=gravity,
        rank_tolerance=rank_tolerance,
        closure_tolerance=closure_tolerance,
        held=held,
    )
    _warn(robot)
    return robot


def _warn(robot: HybridRobot) -> None:
    """Log signs of lost loops and masses, and modules singular in every posture (equal ones once)."""
    from .assembly.findings import architecturally_singular, of_files

    for lost in of_files(robot.description):
        _log.warning("robot '%s': %s", robot.name, lost)

    for module in {id(module.mechanism): module for module in reversed(robot.modules)}.values():
        if decided := module.mechanism.rank_decision:
            _log.warning("module '%s': %s", module.name, decided)
        if singular := architecturally_singular(module):
            _log.warning("module '%s' is %s", module.name, singular)
