"""`load`: from a robot's files to a `HybridRobot`."""

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
    base: Base = "fixed",
    motors: Sequence[str] | None = None,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
    xacro_args: Mapping[str, str] | None = None,
    package_dirs: Sequence[str | PathLike[str]] = (),
    rank_tolerance: float | None = None,
    closure_tolerance: float = 1e-4,
    held: Sequence[str] = (),
) -> HybridRobot:
    """Load a robot from URDF or xacro, with the loop closures its author expressed in any form we read.

    Args:
        path: The robot's file, beside which a side-car (`robot.yaml`, `model.toml`) is found; or the name of
            a shipped robot, "lx4". A path that exists wins.
        base: "fixed", "moving" (prescribed motion) or "floating" (free): the last two put a free-flyer first
            in q, v, a, with Pinocchio's local velocities.
        motors: Names of the driven joints, instead of what the files say.
        gravity: Acceleration of gravity in the world, shape (3,), [m/s^2].
        xacro_args: Arguments of a xacro file by name.
        package_dirs: Folders in which `$(find package)` and `package://` look.
        rank_tolerance: Relative singular value under which closure rows count as dependent; found at generic
            postures where left out.
        closure_tolerance: Largest closure residual that is accepted as rounding in the file, relative to the
            module's length.
        held: Passive joints that are never cut away in a wrist, so that effects can act on them.

    Warnings in the log "hybridyn" tell signs of loops that the files do not state, moving links without mass,
    and modules whose motors lose a direction in every posture.

    Raises:
        ModelError: The files are wrong, say something we refuse, or leave the rank of a module in doubt.
        AssemblyError: A module's loops close nowhere.
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
    """Log what the files seem to have lost, and what no posture can mend, once for equal modules."""
    from .assembly.findings import architecturally_singular, of_files

    for lost in of_files(robot.description):
        _log.warning("robot '%s': %s", robot.name, lost)

    for module in {id(module.mechanism): module for module in reversed(robot.modules)}.values():
        if decided := module.mechanism.rank_decision:
            _log.warning("module '%s': %s", module.name, decided)
        if singular := architecturally_singular(module):
            _log.warning("module '%s' is %s", module.name, singular)
