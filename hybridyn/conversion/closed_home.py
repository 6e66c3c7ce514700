"""A robot whose loops are open at home, closed with its motors where they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..assembly.assemble import assemble_home
from ..description.placement import poses_at
from ..description.records import Description
from ..errors import HybridynError, ModelError
from ..linkage.closure_rows import residual_of
from ..structure.building import build_robot
from ..structure.robot import HybridRobot, positions
from .request import home_of

#: Opening at home that is rounding in the file [rad, or of the robot's size], as in `load`.
ROUNDING = 1e-4


def closed_at_home(d: Description, robot: HybridRobot | None) -> tuple[Description, tuple[str, ...]]:
    """Return a robot whose loops are closed at home, with its motors where they were, and notes.

    Args:
        robot: The robot that the description belongs to; None to build it where that is needed.

    Raises:
        ModelError: The loops are open at home, and no posture near it closes them.
    """
    open_by, name = max(_openings(d), default=(0.0, ""))
    if open_by <= ROUNDING:
        return d, ()
    opening = f"'{name}' is open at home by {open_by:.2g} (radians, or of the robot's size)"
    try:
        robot = robot or build_robot(d)
        q = assemble_home(robot)
    except HybridynError as error:
        raise ModelError(
            f"{opening}, and no posture near home closes it with the motors where they are ({error}); "
            "state a closed home posture: [home] in model.toml, which 'hybridyn home --at JOINT=NUMBER "
            "--write' finds",
            file=d.source,
            element=name,
        ) from error
    return replace(d, home=positions(robot, q)), (
        f"{opening}; written closed, with the motors where they are",
    )


def _openings(d: Description) -> Iterator[tuple[float, str]]:
    """Yield by how much each closure and coupling is open at home [rad, or of the robot's size]."""
    poses = poses_at(d, d.home)
    size = float(np.ptp([pose[:3, 3] for pose in poses.values()], axis=0).max()) or 1.0
    for closure in d.closures:
        ends = poses[closure.link_a] @ closure.frame_a, poses[closure.link_b] @ closure.frame_b
        a, b = ((M[None, :3, :3], M[None, :3, 3]) for M in ends)
        off = np.abs(residual_of(closure.translations, closure.rotation, a, b)[0])
        off[: len(closure.translations)] /= size
        yield float(off.max(initial=0.0)), closure.name
    at = {joint.name: home_of(d, joint)[0] for joint in d.joints if joint.kind != "fixed"}
    for coupling in d.couplings:
        factors = [factor for _, factor in coupling.terms if factor] or coupling.rates(at).values()
        yield abs(coupling.open_by(at)) / (max(map(abs, factors)) or 1.0), coupling.name
