"""`hybridyn workspace`: find the poses that a module reaches, and the efforts that hold them."""

from __future__ import annotations

import contextlib
import os
import time
from typing import TYPE_CHECKING

import click

from ..streams.workers import Workers, keep_freed_memory
from .common.figures import plot_option, save
from .common.files import result_file
from .common.maps import Grid, parse_grid, tell_map
from .common.options import RobotChoice, RobotCommand, numbers_by_name, split_names
from .common.progress import Progress
from .common.tables import jobs_option
from .common.text import aligned_rows, counted

if TYPE_CHECKING:
    from ..studies.workspace.workspace import Workspace

#: Maximum number of joints that are named as bounds.
BLOCKS = 6


@click.command(
    "workspace",
    cls=RobotCommand,
    params=[plot_option("maps of conditioning and efforts"), jobs_option("1")],
    short_help="Find the poses that a module reaches, and their efforts.",
)
@click.option(
    "-m",
    "--module",
    metavar="NUMBER|NAME",
    help="Number (from 1) or name of the module.  [default: the only one with loops]",
)
@click.option("--link", metavar="LINK", help="The link of the module that is moved.  [default: its platform]")
@click.option(
    "--sweep",
    metavar="X,Y,...",
    callback=split_names,
    help="Coordinates of the lattice.  [default: up to three independent ones, else x, y, z]",
)
@click.option(
    "--at",
    metavar="YAW=0.2,...",
    multiple=True,
    callback=numbers_by_name,
    help="Values of the other coordinates, or the lattice's origin [m, rad].  [default: home]",
)
@click.option(
    "--step",
    "steps",
    metavar="X=0.01,...",
    multiple=True,
    callback=numbers_by_name,
    help="Steps of the lattice [m, rad].  [default: parts of the module's size]",
)
@click.option("--no-limits", is_flag=True, help="Ignore the joints' position limits.")
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    callback=result_file,
    help="All poses, .csv or .parquet.  [default: stdout]",
)
@click.option(
    "--map",
    "outputs",
    metavar="A,B,...",
    callback=split_names,
    help="Instead of poses: output joints, and the map to their motors.",
)
@click.option(
    "--grid",
    metavar="GRID",
    callback=parse_grid,
    help="With --map: points of each joint over its limits, or FROM:TO:COUNT,...",
)
def command(
    load: RobotChoice,
    module: str | None,
    link: str | None,
    sweep: list[str] | None,
    at: dict[str, float],
    steps: dict[str, float],
    no_limits: bool,
    output: str | None,
    plot: str | None,
    jobs: int | None,
    outputs: list[str] | None,
    grid: Grid | None,
) -> None:
    """Find the poses that a module of ROBOT reaches from home on its assembly branch, within joint limits.

    The poses form a lattice, which is searched from the home pose to neighbours that can be reached. The
    table has a row per reached pose: '<link>@<base>/pose/...', '<motor>/position' of the module's motors,
    'conditioning' (0 singular, 1 isotropic), 'effort_per_force' and 'effort_per_torque' (the largest effort
    of any motor against 1 N or 1 N m in the worst direction), '<motor>/effort' (against gravity, with the
    other modules at home). Efforts of singular postures are inf.

    With --map, a row has positions of output joints and motors, and '<motor>/per/<joint>', the motor's rate
    per rate of the joint (docs/joint-map.md). Points out of reach or singular are left out and counted.
    """
    if (outputs is None) != (grid is None):
        raise click.UsageError("--map and --grid belong together; along a trajectory: 'hybridyn idm --map'")
    if outputs is not None and grid is not None:
        if any((module, link, sweep, at, steps, no_limits, plot, jobs)):
            raise click.UsageError("with --map, only --grid and -o apply")
        tell_map(load(), outputs, grid, output)
        return
    from ..studies.workspace.workspace import workspace

    keep_freed_memory()
    started = time.perf_counter()
    robot = load()
    with contextlib.ExitStack() as opened, Progress("poses") as bar:
        workers = opened.enter_context(Workers(0 if jobs in (None, 1) else jobs))
        found = workspace(
            robot,
            module,
            link=link,
            axes=sweep,
            at=at,
            steps=steps,
            limits=not no_limits,
            spread=workers.over,
            progress=lambda poses: bar.show(poses, None),
        )
    _write(found, load, output)
    if plot:
        from ..figures.workspace import figure_of_workspace

        units = dict.fromkeys(robot.effort_units[i] for i in robot.modules[found.sweep.module].motor_index)
        title = f"{robot.name}: {found.sweep.link}"
        swept = [*found.sweep.axes, *(name for name in found.sweep.names if name not in found.sweep.axes)]
        poses = {name: found.coordinates[:, found.sweep.names.index(name)] for name in swept}
        save(figure_of_workspace(poses, found.measures, title=title, unit=" or ".join(units)), plot)
    for line in _summary(found, time.perf_counter() - started):
        click.echo(line, err=True)


def _write(found: Workspace, load: RobotChoice, output: str | None) -> None:
    import numpy as np

    from ..tables.results import open_results

    columns = {
        f"{found.sweep.key}/pose/{n}": found.coordinates[:, i] for i, n in enumerate(found.sweep.names)
    }
    columns |= {f"{name}/position": values for name, values in found.motors.items()}
    columns |= found.measures
    file = os.path.basename(load.robot)
    remark = f"hybridyn workspace of {file}: lattice steps " + ", ".join(
        f"{axis} {step:g}" for axis, step in zip(found.sweep.axes, found.steps, strict=True)
    )
    with open_results(output, list(columns), [remark]) as write:
        write(np.column_stack(list(columns.values())))


def _summary(found: Workspace, seconds: float) -> list[str]:
    import numpy as np

    sweep = found.sweep
    lines = [
        f"module {sweep.module + 1}: {counted(len(found.index), 'pose')} of '{sweep.link}' in '{sweep.base}'"
    ]
    rows = [["coordinate", "from", "to", "step", "unit"]]
    for i, name in enumerate(sweep.names):
        values, linear = np.round(found.coordinates[:, i], 12) + 0.0, name in "xyz"  # no -0, no 6e-17
        step = f"{found.steps[sweep.axes.index(name)]:.4g}" if name in sweep.axes else "held"
        rows.append([name, f"{values.min():.4g}", f"{values.max():.4g}", step, "m" if linear else "rad"])
    lines += [f"  {line}" for line in aligned_rows(rows, right=(1, 2, 3))]
    for name, values in found.measures.items():
        finite = values[np.isfinite(values)]
        if "/" not in name and len(finite):
            lost = len(values) - len(finite)
            note = f", {counted(lost, 'singular pose')}" if lost else ""
            lines.append(f"{name}: {finite.min():.4g} to {finite.max():.4g}{note}")
    held = {name: values for name, values in found.measures.items() if name.endswith("/effort")}
    if held:
        worst = {
            name: float(np.max(np.abs(v), initial=0.0, where=np.isfinite(v))) for name, v in held.items()
        }
        name = max(worst, key=lambda motor: worst[motor])
        lines.append(f"largest effort against gravity: {worst[name]:.4g} by {name.removesuffix('/effort')}")
    stops = sorted(found.blocked.items(), key=lambda item: (-item[1], item[0]))
    named = [
        f"{'reach of the loops' if name == 'reach' else name} ({count:,})" for name, count in stops[:BLOCKS]
    ]
    more = f" and {len(stops) - BLOCKS} more joints" if len(stops) > BLOCKS else ""
    lines.append(f"steps stopped by: {', '.join(named) or 'nothing'}{more}")
    lines.append(f"wall time {seconds:.2f} s")
    return lines
