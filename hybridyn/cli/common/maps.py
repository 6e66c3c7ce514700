"""The map between motors and output joints, along a table or over a grid."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from .text import counted

if TYPE_CHECKING:
    from ...description.records import Array
    from ...streams.one_pass import Rows
    from ...streams.postures import Postures
    from ...structure.robot import HybridRobot
    from ...tables.columns import Layout

#: A number of points for each joint, or first and last position and number of points of each.
Grid = int | tuple[tuple[float, float, int], ...]
#: Points of a grid in all.
MOST_POINTS = 1_000_000


def parse_grid(ctx: click.Context, param: click.Parameter, value: str | None) -> Grid | None:
    """Parse a number of points, or FROM:TO:COUNT for each joint."""
    if value is None:
        return None
    try:
        if ":" not in value:
            ranges: tuple[tuple[float, float, int], ...] = ()
            counts = [int(value)]
        else:
            words = [part.split(":") for part in value.split(",")]
            ranges = tuple((float(a), float(b), int(n)) for a, b, n in words)
            counts = [n for _, _, n in ranges]
    except ValueError:
        raise click.BadParameter(
            f"'{value}' is neither a number of points nor FROM:TO:COUNT,... for each joint", ctx, param
        ) from None
    ordered = all(math.isfinite(b - a) and (a < b or n == 1) for a, b, n in ranges)
    if min(counts) < 1 or not ordered:
        raise click.BadParameter(f"'{value}': a range has FROM < TO and at least one point", ctx, param)
    return ranges or counts[0]


def map_rows(
    robot: HybridRobot,
    block: Postures,
    *,
    joints: Sequence[str],
    efforts: Callable[[HybridRobot, Postures], Rows] | None,
) -> Rows:
    """Compute the map at the postures of a block, with rates, accelerations and efforts.

    Args:
        joints: The output joints.
        efforts: Computes the efforts of a block, or None where they are not wanted.
    """
    from ...dynamics.quantities.joint_map import joint_map
    from ...streams.one_pass import Rows
    from ...studies import map_table

    found = joint_map(robot, block.q, joints)
    made = None if efforts is None else efforts(robot, block)
    rows = map_table.map_rows(found, block.v, block.a, None if made is None else made.rows)
    return Rows(rows) if made is None else made._replace(rows=rows)


class MapSummary:
    """The condition number of a map, over all postures."""

    exceeded = ()

    def __init__(self, robot: HybridRobot, joints: Sequence[str]) -> None:
        self.robot, self.joints = robot, joints
        self.postures, self.low, self.high = 0, float("inf"), 0.0

    def add(self, done: Rows) -> None:
        """Add a block."""
        self.add_rows(done.rows)

    def add_rows(self, rows: Array) -> None:
        """Add rows of the map."""
        from ...studies.map_table import conditions

        found = conditions(self.robot, self.joints, rows)
        self.postures += len(rows)
        self.low, self.high = min(self.low, found.min()), max(self.high, found.max())

    def show(self, layout: Layout | None, quiet: bool) -> None:
        """Print the line on standard error, if this is not `quiet`."""
        from ...description.names import listed
        from ...dynamics.quantities.joint_map import motors_beside

        if not quiet:
            motors = motors_beside(self.robot, self.joints)
            others = [name for name in self.robot.motors if name not in motors]
            if others:
                click.echo(f"not in the map, other motors: {listed(others)}", err=True)
            click.echo(
                f"{self.robot.name}: {', '.join(self.joints)} of {', '.join(motors)}; "
                f"{counted(self.postures, 'posture')}, condition number of the map {self.low:.3g} to "
                f"{self.high:.3g}",
                err=True,
            )


def tell_map(robot: HybridRobot, joints: list[str], grid: Grid, output: str | None) -> None:
    """Write the map over a grid of the joints' positions, and say what was left out.

    Raises:
        HybridynError: The joints do not fit the modules, or no point is reached.
    """
    import numpy as np

    from ...assembly.posture import check_joints
    from ...dynamics.quantities.joint_map import regular_map
    from ...errors import SingularityError
    from ...studies.map_table import map_columns, map_rows, postures_on_grid
    from ...tables.results import open_results

    check_joints(robot, joints)
    every = [q for _, q in postures_on_grid(robot, _values(robot, joints, grid))]
    reached = [q for q in every if q is not None]
    found, kept = regular_map(robot, np.array(reached), joints)
    if found is None:
        raise SingularityError(
            f"all {counted(len(reached), 'posture')} of the grid that are reached are singular"
        )
    rows, summary = map_rows(found), MapSummary(robot, joints)
    with open_results(output, map_columns(robot, joints)) as write:
        write(rows)
    summary.add_rows(rows)
    summary.show(None, quiet=False)
    out = {"out of reach": len(every) - len(reached), "singular": len(reached) - len(kept)}
    for what, count in out.items():
        if count:
            click.echo(f"left out: {counted(count, 'point')} {what}", err=True)


def _values(robot: HybridRobot, joints: list[str], grid: Grid) -> dict[str, Array]:
    """Return the positions of each joint on the grid."""
    import numpy as np

    if isinstance(grid, int):
        limits = {name: (robot.records[name].lower, robot.records[name].upper) for name in joints}
        for name in joints:
            if not all(map(math.isfinite, limits[name])):
                raise click.UsageError(
                    f"joint '{name}' has no limits in the robot's file: give --grid FROM:TO:COUNT,..."
                )
        grid = tuple((*limits[name], grid) for name in joints)
    if len(grid) != len(joints):
        raise click.UsageError(
            f"--grid has {counted(len(grid), 'range')} for {counted(len(joints), 'joint')}"
        )
    if math.prod(count for _, _, count in grid) > MOST_POINTS:
        raise click.UsageError(f"--grid has more than {MOST_POINTS:,} points")
    return {name: np.linspace(*given) for name, given in zip(joints, grid, strict=True)}
