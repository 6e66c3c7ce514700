"""Coordinates of a workspace: independent coordinates of a module's platform, and those that are swept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...assembly.module_request import place_in_tree, units_of_pose
from ...description.names import did_you_mean
from ...errors import TrajectoryError
from ...linkage.targets import COORDINATES, CoordinateTarget
from ...spatial import Array, quaternion_from_rotation, rotation_from_axis_angle
from ...structure.module import Module
from ...structure.robot import HybridRobot

#: A coordinate is independent of the chosen ones if at least this part of its motion remains when they are
#: fixed. A 3-RPS, for example, moves a little in x when it rolls, but x is no independent coordinate.
INDEPENDENT_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Sweep:
    """The coordinates of a link relative to its module's base link.

    Attributes:
        module: Number of the module.
        base: The module's base link.
        names: Coordinates that together determine the link's motion, in the order of `COORDINATES`.
        axes: Those that are swept.
        home: Values of `names` at the home posture, shape (names,), [m, rad].
    """

    module: int
    link: str
    base: str
    names: tuple[str, ...]
    axes: tuple[str, ...]
    home: Array

    @property
    def key(self) -> str:
        """The link's key in the platforms of `hybridyn.assemble`."""
        return f"{self.link}@{self.base}"


def find_module(robot: HybridRobot, wanted: int | str | None) -> int:
    """Return the number of a module from its number (from 1), its name or that of one of its outputs.

    Args:
        wanted: Number or name; None selects the only module with closures.

    Raises:
        TrajectoryError: There is no such module, or none at all, or None is ambiguous.
    """
    if not robot.modules:
        raise TrajectoryError(f"no joint of '{robot.name}' moves, so there is no workspace")
    looped = [k for k, module in enumerate(robot.modules) if module.closures]
    if wanted is None:
        if len(looped) != 1:
            known = [f"{k + 1} ({robot.modules[k].name})" for k in looped or range(len(robot.modules))]
            raise TrajectoryError(f"choose a module: {', '.join(known)}")
        return looped[0]
    names = {name: k for k, module in enumerate(robot.modules) for name in (module.name, *module.outputs)}
    names |= {str(k + 1): k for k in range(len(robot.modules))}
    if str(wanted) not in names:
        hint = did_you_mean(str(wanted), names) or f"; there are {len(robot.modules)}, numbered from 1"
        raise TrajectoryError(f"there is no module '{wanted}'{hint}")
    return names[str(wanted)]


def find_sweep(
    robot: HybridRobot, module: int | str | None, link: str | None, axes: Sequence[str] | None, q: Array
) -> Sweep:
    """Choose link and coordinates.

    Args:
        module: As for `find_module`.
        link: A link of the module; by default its platform.
        axes: Coordinates to sweep. By default all independent ones if there are at most three, else the
            translations.
        q: Posture at which the coordinates must be independent, shape (nq,).

    Raises:
        TrajectoryError: A name is unknown, or the coordinates are not independent.
    """
    number = find_module(robot, module)
    chosen = robot.modules[number]
    link = link or _platform(robot, number)
    if link not in robot.bodies.place:
        raise TrajectoryError(f"there is no link '{link}'{did_you_mean(link, robot.bodies.place)}")
    if robot.body_owner[robot.bodies.place[link][0]][0] != number:
        raise TrajectoryError(f"link '{link}' does not belong to module '{chosen.name}'")
    J, values = _at_home(robot, number, link, q)
    for name in axes or ():
        if name not in COORDINATES:
            known = f"{did_you_mean(name, COORDINATES)}; known: {', '.join(COORDINATES)}"
            raise TrajectoryError(f"there is no coordinate '{name}'{known}")
    names = _independent(J, tuple(axes or ()))
    if missing := [name for name in axes or () if name not in names]:
        raise TrajectoryError(
            f"'{missing[0]}' of link '{link}' is not independent; the independent coordinates are "
            f"{', '.join(_independent(J, ()))}"
        )
    linear = tuple(name for name in names if name in COORDINATES[:3])
    swept = tuple(name for name in names if name in axes) if axes else names if len(names) <= 3 else linear
    if not swept:
        raise TrajectoryError(f"link '{link}' does not move")
    home = values[[COORDINATES.index(name) for name in names]]
    return Sweep(number, link, chosen.base, names, swept, home)


def coordinate_target(robot: HybridRobot, link: str, module: Module) -> CoordinateTarget:
    """Return a target of all coordinates of a link in the base link of its module, with zero values."""
    _, R, p = robot.bodies.place[module.base]
    number, *place = place_in_tree(robot, link)
    zero, units = np.zeros((1, 6)), units_of_pose(module.mechanism)
    return CoordinateTarget(
        number, (link, module.base), COORDINATES, R, p, (place[0], place[1]), zero, zero, zero, units
    )


def _platform(robot: HybridRobot, number: int) -> str:
    """Return a module's platform: an output that is a platform or carries a module, else a tool."""
    module = robot.modules[number]
    carries = any(other.parent == number for other in robot.modules)
    if module.outputs and (carries or module.mechanism.spec.platforms):
        return module.outputs[0]
    parents = {joint.parent for joint in robot.description.joints}
    tools = [
        joint.child
        for joint in robot.description.joints
        if joint.kind == "fixed"
        and joint.child not in parents
        and robot.body_owner[robot.bodies.place[joint.child][0]][0] == number
    ]
    return tools[-1] if tools else module.outputs[0] if module.outputs else module.name


def _at_home(robot: HybridRobot, number: int, link: str, q: Array) -> tuple[Array, Array]:
    """Compute the scaled Jacobian of a link's coordinates, shape (6, N), and their values, shape (6,)."""
    module = robot.modules[number]
    m = module.mechanism
    target = coordinate_target(robot, link, module)
    motion = m.cut.motion(m.spanning.sweep(q[None, module.q_index]))
    Psi = m.basis(m.closures.matrix(motion)).Psi[0]
    orthonormal = np.linalg.qr(Psi / m.reduction.col_scale[:, None])[0] * m.reduction.col_scale[:, None]
    J = target.matrix(m.tree, motion)[0] @ orthonormal / target.units[:, None]
    first = np.zeros(1, dtype=int)
    return J, target.headed(motion, first).coordinates(motion, first)[0]


def _independent(J: Array, first: tuple[str, ...]) -> tuple[str, ...]:
    """Choose coordinates, rows of J (6, N), with independent motions; those in `first` have precedence."""
    s = np.linalg.svd(J, compute_uv=False)
    freedoms = int(np.sum(s > INDEPENDENT_SHARE**4 * s[0])) if s.size and s[0] else 0
    order = [*first, *(name for name in _preferred(J) if name not in first)]
    largest = float(np.linalg.norm(J, axis=1).max(initial=0.0))
    chosen: list[str] = []
    basis = np.zeros((0, J.shape[1]))
    for part in (
        INDEPENDENT_SHARE,
        INDEPENDENT_SHARE**2,
        INDEPENDENT_SHARE**4,
    ):  # the last one accepts all that differ by more than rounding
        for name in order:
            row = J[COORDINATES.index(name)]
            own = row - basis.T @ (basis @ row)
            size = float(np.linalg.norm(own))
            if size > part * largest and name not in chosen and len(basis) < freedoms:
                chosen.append(name)
                basis = np.vstack([basis, own / size])
    return tuple(name for name in COORDINATES if name in chosen)


def _preferred(J: Array) -> tuple[str, ...]:
    """Return the coordinates in order of preference: translations first.

    Angles come first for a platform that only turns, such as one on a ball joint, wherever its origin is.
    """
    s = np.linalg.svd(J, compute_uv=False)
    freedoms = int(np.sum(s > INDEPENDENT_SHARE * s[0])) if s.size and s[0] else 0
    turning = np.linalg.svd(J[3:], compute_uv=False)
    moving = np.linalg.svd(J[:3], compute_uv=False)
    only_turns = freedoms <= 3 and turning[freedoms - 1] > INDEPENDENT_SHARE * turning[0]
    only_moves = freedoms <= 3 and moving[freedoms - 1] > INDEPENDENT_SHARE * moving[0]
    if freedoms and only_turns and not only_moves:
        return (*COORDINATES[3:], *COORDINATES[:3])
    return COORDINATES


def values_at(sweep: Sweep, at: Mapping[str, float]) -> Array:
    """Return the home values of a sweep's coordinates with some of them replaced, shape (names,), [m, rad].

    Args:
        at: Values by coordinate [m, rad].

    Raises:
        TrajectoryError: A coordinate is not one of the sweep's.
    """
    for name in at:
        if name not in sweep.names:
            raise TrajectoryError(
                f"'{name}' of link '{sweep.link}' cannot be chosen; its independent coordinates are "
                f"{', '.join(sweep.names)}"
            )
    return np.array([at.get(name, value) for name, value in zip(sweep.names, sweep.home, strict=True)])


def pose_of(sweep: Sweep, values: Array) -> Any:
    """Convert coordinates to a pose for `assemble`.

    Args:
        values: The coordinates, shape (T, names), [m, rad].

    Returns:
        Position and quaternion, shape (T, 7), if there are six coordinates, else each coordinate by name.
    """
    if len(sweep.names) < len(COORDINATES):
        return dict(zip(sweep.names, values.T, strict=True))
    R = np.broadcast_to(np.eye(3), (len(values), 3, 3))
    for angle, axis in zip(values[:, 3:].T, np.eye(3), strict=True):  # R = Rz(yaw) Ry(pitch) Rx(roll)
        R = np.matmul(rotation_from_axis_angle(axis, np.cos(angle), np.sin(angle)), R)
    return np.concatenate([values[:, :3], quaternion_from_rotation(R)], axis=1)
