"""Coordinates of a workspace: independent coordinates of a link in another, and those that are swept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...assembly.chain.between import Between, end_link, moving
from ...assembly.chain.coordinates import coordinates_at, independent_coordinates
from ...description.names import did_you_mean
from ...errors import TrajectoryError
from ...linkage.targets import COORDINATES
from ...spatial import Array, Index, quaternion_from_rotation, rotation_from_axis_angle
from ...structure.robot import HybridRobot
from ...tables.signals import WORLD


@dataclass(frozen=True, eq=False)
class LinkSweep:
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

    def at(self, start: Array, step: Array, index: Array | Index) -> Array:
        """Return the coordinates of points of a lattice.

        Args:
            start: Coordinates of its origin, shape (names,), [m, rad].
            step: Step of each swept coordinate, shape (axes,), [m, rad].
            index: Steps from the origin, shape (n, axes), whole or parts.

        Returns:
            The coordinates, shape (n, names), [m, rad].
        """
        out = np.tile(start, (len(index), 1))
        out[:, [self.names.index(axis) for axis in self.axes]] += index * step
        return out


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
) -> LinkSweep:
    """Choose links and coordinates.

    Args:
        robot: The robot.
        module: As for `find_module`; if only a link is named, all modules that move it.
        link: "link", "link@other" or "link@world", see `workspace`.
        axes: Coordinates to sweep. By default all independent ones if there are at most three, else the
            translations.
        q: Posture at which the coordinates must be independent, shape (nq,).

    Raises:
        TrajectoryError: A name is unknown, or the coordinates are not independent.
    """
    modules, link, base = _ends(robot, module, link)
    J, values = coordinates_at(Between.of_coordinates(robot, modules, link, base), q)
    for name in axes or ():
        if name not in COORDINATES:
            known = f"{did_you_mean(name, COORDINATES)}; known: {', '.join(COORDINATES)}"
            raise TrajectoryError(f"there is no coordinate '{name}'{known}")
    names = independent_coordinates(J, tuple(axes or ()))
    if missing := [name for name in axes or () if name not in names]:
        raise TrajectoryError(
            f"'{missing[0]}' of link '{link}' is not independent; the independent coordinates are "
            f"{', '.join(independent_coordinates(J, ()))}"
        )
    linear = tuple(name for name in names if name in COORDINATES[:3])
    swept = tuple(name for name in names if name in axes) if axes else names if len(names) <= 3 else linear
    if not swept:
        raise TrajectoryError(f"link '{link}' does not move")
    home = values[[COORDINATES.index(name) for name in names]]
    return LinkSweep(modules, link, base, names, swept, home)


def _ends(robot: HybridRobot, module: int | str | None, key: str | None) -> tuple[tuple[int, ...], str, str]:
    """Return the modules that move a link, the link, and the link in which it is measured."""
    link, _, other = (key or "").partition("@")
    if other == WORLD and WORLD not in robot.bodies.place:
        other = robot.description.root  # a base that moves is at home, where its frame is the world's
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
    link = link or end_link(robot, number)
    if robot.body_owner[robot.bodies.place[link][0]][0] != number:
        raise TrajectoryError(
            f"link '{link}' does not belong to module '{chosen.name}'; name no module if several move it"
        )
    return (number,), link, chosen.base


def values_at(sweep: LinkSweep, at: Mapping[str, float]) -> Array:
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


def pose_of(sweep: LinkSweep, values: Array) -> Any:
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
