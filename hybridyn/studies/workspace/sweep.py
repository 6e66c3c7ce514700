"""Coordinates of a workspace: independent coordinates of a link in another, and those that are swept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...description.names import did_you_mean
from ...errors import TrajectoryError
from ...linkage.targets import COORDINATES, CoordinateTarget
from ...spatial import Array, quaternion_from_rotation, rotation_from_axis_angle
from ...structure.robot import HybridRobot
from .between import Between, moving

#: A coordinate is independent of the chosen ones if at least this part of its motion remains when they are
#: fixed. A 3-RPS, for example, moves a little in x when it rolls, but x is no independent coordinate.
INDEPENDENT_SHARE = 0.1


@dataclass(frozen=True, eq=False)
class Sweep:
    """The coordinates of a link relative to another.

    Attributes:
        modules: Numbers of the modules that move it there, those nearer to the root first.
        link: The link.
        base: The other link.
        names: Coordinates that together determine the link's motion, in the order of `COORDINATES`.
        axes: Those that are swept.
        home: Values of `names` at the home posture, shape (names,), [m, rad].
    """

    modules: tuple[int, ...]
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
            raise TrajectoryError(f"choose a module: {', '.join(known)}; or a link that several move")
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
    """Choose links and coordinates.

    Args:
        robot: The robot.
        module: As for `find_module`; if only a link is named, all modules that move it.
        link: "link" or "link@other", see `workspace`.
        axes: Coordinates to sweep. By default all independent ones if there are at most three, else the
            translations.
        q: Posture at which the coordinates must be independent, shape (nq,).

    Raises:
        TrajectoryError: A name is unknown, or the coordinates are not independent.
    """
    modules, link, base = _ends(robot, module, link)
    J, values = _at_home(Between.of_coordinates(robot, modules, link, base), q)
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
    return Sweep(modules, link, base, names, swept, home)


def _ends(robot: HybridRobot, module: int | str | None, key: str | None) -> tuple[tuple[int, ...], str, str]:
    """Return the modules that move a link, the link, and the link in which it is measured."""
    link, _, other = (key or "").partition("@")
    for name in (link, other):
        if name and name not in robot.bodies.place:
            raise TrajectoryError(f"there is no link '{name}'{did_you_mean(name, robot.bodies.place)}")
    if other and module is not None:
        raise TrajectoryError(f"all modules between '{link}' and '{other}' move; name no module")
    if module is None and link:
        base = other or robot.description.root
        between = moving(robot, link, base)
        if not between:
            raise TrajectoryError(f"no module moves link '{link}' relative to '{base}'")
        if len(between) == 1 and not other:
            base = robot.modules[between[0]].base
        return between, link, base
    number = find_module(robot, module)
    chosen = robot.modules[number]
    link = link or _platform(robot, number)
    if robot.body_owner[robot.bodies.place[link][0]][0] != number:
        raise TrajectoryError(
            f"link '{link}' does not belong to module '{chosen.name}'; name no module if several move it"
        )
    return (number,), link, chosen.base


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


def _at_home(between: Between, q: Array) -> tuple[Array, Array]:
    """Compute the scaled Jacobian of a link's coordinates, shape (6, N), and their values, shape (6,)."""
    motion, first = between.motion(q[None]), np.zeros(1, dtype=int)
    relative, target = between.seen(motion), between.relative.target
    assert isinstance(target, CoordinateTarget)
    J = between.maps(motion)[0][0]
    return J, target.headed(relative, first).coordinates(relative, first)[0]


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
