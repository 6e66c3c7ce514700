"""`hybridyn map`: the map between motors and output joints, over a grid or along a trajectory."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import click

from .common.files import check_targets, complete_data, existing_file, result_file
from .common.options import RobotCommand, split_names
from .common.text import counted

if TYPE_CHECKING:
    import numpy as np

    from ..structure.robot import HybridRobot
    from ..studies.map_table import MapTable

#: Points of a grid in all.
MOST_POINTS = 1_000_000


def _grid(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> int | tuple[tuple[float, float, int], ...] | None:
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


@click.command(
    "map", cls=RobotCommand, short_help="Map output joints to motors: a parallel ankle's pitch and roll."
)
@click.argument(
    "source", metavar="[TRAJECTORY]", required=False, callback=existing_file, shell_complete=complete_data
)
@click.option(
    "--joints", metavar="A,B,...", required=True, callback=split_names, help="The output joints, by name."
)
@click.option(
    "--grid",
    metavar="GRID",
    callback=_grid,
    help="Instead of a trajectory, a grid of the joints' positions: a number of points for each joint over "
    "its limits, or FROM:TO:COUNT,... in the order of --joints.",
)
@click.option(
    "--efforts",
    is_flag=True,
    help="Along a trajectory, also the efforts of joints and motors that it needs, as in 'hybridyn idm'.",
)
@click.option(
    "-o", "--output", metavar="FILE", callback=result_file, help="The table, .csv or .parquet; '-': CSV here."
)
def command(
    load: Callable[[], HybridRobot],
    source: str | None,
    joints: list[str],
    grid: int | tuple[tuple[float, float, int], ...] | None,
    efforts: bool,
    output: str | None,
) -> None:
    """Compute how the motors of ROBOT move with output joints, along TRAJECTORY or over a grid.

    Output joints are, for example, the pitch and roll of a parallel ankle. A module with output joints must
    have as many of them as degrees of freedom. Each row contains the positions of joints and motors, and
    '<motor>/per/<joint>', the rate of the motor per rate of the joint. The transposed matrix maps efforts of
    the motors to efforts of the joints. If the robot's files state rotors, '<joint>/inertia/<joint>' is
    their inertia at the joints. Along a trajectory (a table as for 'hybridyn idm'), a row also contains rates
    and accelerations of joints and motors.

    Points of a grid that cannot be reached from home, or that are singular, are left out and counted.
    """
    import numpy as np

    from ..assembly.posture import check_joints
    from ..dynamics.quantities.joint_map import motors_beside
    from ..tables.results import open_results

    if (source is None) == (grid is None):
        raise click.UsageError("give a TRAJECTORY, or --grid")
    check_targets([source or "-"], [output])
    if efforts and grid is not None:
        raise click.UsageError("--efforts needs a TRAJECTORY")
    robot = load()
    check_joints(robot, joints)
    if grid is not None:
        table, time, remarks = _over_grid(robot, joints, _values(robot, joints, grid))
    else:
        assert source is not None
        table, time = _along(robot, joints, source, efforts)
        remarks = []
    timed = [] if time is None else ["time"]
    rows = table.rows if time is None else np.column_stack([time, table.rows])
    with open_results(output, [*timed, *table.columns]) as write:
        write(rows)
    motors = motors_beside(robot, joints)
    low, high = table.condition.min(), table.condition.max()
    lines = [
        f"{robot.name}: {', '.join(joints)} of {', '.join(motors)}; {counted(len(rows), 'posture')}, "
        f"condition number of the map {low:.3g} to {high:.3g}",
        *remarks,
    ]
    click.echo("\n".join(lines), err=True)


def _values(
    robot: HybridRobot, joints: list[str], grid: int | tuple[tuple[float, float, int], ...]
) -> dict[str, np.ndarray]:
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


def _over_grid(
    robot: HybridRobot, joints: list[str], values: dict[str, np.ndarray]
) -> tuple[MapTable, None, list[str]]:
    """Compute the map over a grid; also what was left out."""
    import numpy as np

    from ..dynamics.quantities.joint_map import regular_map
    from ..errors import SingularityError
    from ..studies.map_table import map_table, postures_on_grid

    every = [q for _, q in postures_on_grid(robot, values)]
    reached = [q for q in every if q is not None]
    found, kept = regular_map(robot, np.array(reached), joints)
    if found is None:
        raise SingularityError(
            f"all {counted(len(reached), 'posture')} of the grid that are reached are singular"
        )
    out = {"out of reach": len(every) - len(reached), "singular": len(reached) - len(kept)}
    remarks = [f"left out: {counted(count, 'point')} {what}" for what, count in out.items() if count]
    return map_table(found), None, remarks


def _along(
    robot: HybridRobot, joints: list[str], source: str, efforts: bool
) -> tuple[MapTable, np.ndarray | None]:
    """Compute the map along a trajectory, and its times."""
    import numpy as np

    from ..assembly.posture import holding
    from ..dynamics.quantities.joint_map import joint_map, motors_beside
    from ..effects import choose
    from ..streams.postures import all_postures, rows_named
    from ..studies.map_table import MapTable, map_table
    from .idm import efforts as as_idm

    layout, blocks = all_postures(holding(robot, joints), source, (joints, motors_beside(robot, joints)))
    on = choose(robot, None) if efforts else None
    tables = []
    for block in blocks:
        with rows_named(layout, block.motion):
            found = joint_map(robot, block.q, joints)
            tau = as_idm(robot, block, passive="given", effects=on).result if on else None
        tables.append(map_table(found, block.v, block.a, tau))
    table = MapTable(
        tables[0].columns,
        np.concatenate([part.rows for part in tables]),
        np.concatenate([part.condition for part in tables]),
    )
    times = [block.motion.time for block in blocks]
    return table, None if layout.time is None else np.concatenate([t for t in times if t is not None])
