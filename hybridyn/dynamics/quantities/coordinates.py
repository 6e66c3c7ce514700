"""The independent coordinates u of a robot: its motors, or joints that the caller chooses.

A floating base adds its twist, the first six of v, in front. The base of a "moving" robot is prescribed and
not among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...description.names import counted, did_you_mean
from ...errors import SingularityError, TrajectoryError
from ...linkage.joints import NV, ROOT_JOINT
from ...spatial import Index
from ...structure.module import Module
from ...structure.robot import HybridRobot


@dataclass(frozen=True, eq=False)
class Coordinates:
    """Independent coordinates of a robot.

    Attributes:
        joints: The joints, in the order of u; a floating base's root joint is the first.
        columns: Entries of v that u consists of, shape (N,).
        own: For each module its entries of u, shape (m,).
        freedoms: For each module the freedoms of its spanning tree that they are, shape (m,).
        chosen: Whether the caller chose the joints; else they are the motors.
        mend: What messages advise where the joints do not fit.
    """

    joints: tuple[str, ...]
    columns: Index
    own: tuple[Index, ...]
    freedoms: tuple[Index, ...]
    chosen: bool
    mend: str = "Name the independent joints with joints=[...]"

    @property
    def size(self) -> int:
        """Number of independent coordinates."""
        return len(self.columns)

    @property
    def words(self) -> str:
        """What messages call the joints."""
        return "chosen joints" if self.chosen else "motors"


def independent_coordinates(robot: HybridRobot, joints: Sequence[str] | None) -> Coordinates:
    """Return the independent coordinates of a robot.

    Args:
        joints: Names of joints with one freedom each, as many in each module as it has freedoms; the motors
            where left out.

    Raises:
        TrajectoryError: A joint is unknown, named twice, or has several freedoms.
        SingularityError: A module has more of these joints than freedoms.
    """
    names = tuple(robot.motors if joints is None else joints)
    names = tuple(name for name in names if name != ROOT_JOINT or robot.base != "floating")
    check_joints(robot, names)
    if robot.base == "floating":
        names = (ROOT_JOINT, *names)
    out = located(robot, names, chosen=joints is not None)
    for module, entries in zip(robot.modules, out.own, strict=True):
        check_count(module, len(entries), out)
    return out


def located(robot: HybridRobot, names: tuple[str, ...], *, chosen: bool) -> Coordinates:
    """Return where joints lie in v and in the modules.

    Args:
        names: Known joints.
        chosen: Whether the caller chose them.
    """
    slices = [robot.v_slices[robot.joint_index[name]] for name in names]
    columns = np.array([c for at in slices for c in range(at.start, at.stop)], dtype=int)
    entry = {int(column): i for i, column in enumerate(columns)}
    own, freedoms = [], []
    for module in robot.modules:
        held = sorted((entry[int(c)], i) for i, c in enumerate(module.v_index) if int(c) in entry)
        own.append(np.array([i for i, _ in held], dtype=int))
        freedoms.append(np.array([i for _, i in held], dtype=int))
    return Coordinates(names, columns, tuple(own), tuple(freedoms), chosen)


def check_joints(robot: HybridRobot, names: Sequence[str]) -> None:
    """Refuse joints that cannot be coordinates.

    Raises:
        TrajectoryError: One is unknown, named twice, or has several freedoms.
    """
    for name in names:
        _check_joint(robot, name, names)


def _check_joint(robot: HybridRobot, name: str, names: Sequence[str]) -> None:
    """Refuse a joint that cannot be one coordinate."""
    if name not in robot.joint_index:
        raise TrajectoryError(f"joints: unknown joint '{name}'{did_you_mean(name, robot.joint_index)}")
    if list(names).count(name) > 1:
        raise TrajectoryError(f"joints: '{name}' is named twice")
    kind = robot.kinds[robot.joint_index[name]]
    if NV[kind] > 1:
        raise TrajectoryError(
            f"joints: '{name}' is {kind} and has {NV[kind]} freedoms; independent coordinates are joints "
            "with one freedom each"
        )


def check_count(module: Module, count: int, u: Coordinates) -> None:
    """Refuse more coordinates than freedoms.

    Raises:
        SingularityError: Naming the module.
    """
    if count <= module.mobility:
        return
    raise SingularityError(
        f"module '{module.name}': {count} {u.words} for {counted(module.mobility, 'freedom')} cannot be "
        f"independent. "
        f"{u.mend}, {module.mobility} in this module",
        module=module.name,
        what="independent coordinates",
        condition=np.inf,
    )
