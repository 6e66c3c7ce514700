"""`hybridyn workspace`: find the poses that a link reaches, and the efforts that hold them."""

import time
from collections.abc import Sequence

import click
import numpy as np

from ..assembly.redundancy import LEAST, RULES
from ..figures.workspace import figure_of_workspace
from ..spatial import Array
from ..streams.workers import Workers, keep_freed_memory
from ..structure.robot import HybridRobot
from ..studies.workspace.workspace import Workspace, workspace
from ..tables.results import open_results
from .common.figures import save
from .common.maps import tell_map
from .common.options import Grid, RobotChoice, refuse
from .common.progress import progress
from .common.text import aligned_rows, counted

#: Maximum number of joints that are named as bounds.
BLOCKS = 6


def run(
    load: RobotChoice, module: str | None, link: str | None, sweep: Sequence[str] | None,
    at: dict[str, float], steps: dict[str, float], no_limits: bool, output: str | None, plot: str | None,
    jobs: int | None, redundancy: str, outputs: Sequence[str] | None, grid: Grid | None,
) -> None:  # fmt: skip
    """Find the poses that a link reaches, or the map over a grid."""
    others = any((module, link, sweep, at, steps, no_limits, plot, jobs, redundancy != LEAST))
    refuse(
        (
            (outputs is None) != (grid is None),
            "--map and --grid belong together; along a trajectory: 'hybridyn idm --map'",
        ),
        (outputs and others, "with --map, only --grid and -o apply"),
    )
    if outputs is not None and grid is not None:
        tell_map(load(), outputs, grid, output)
        return
    keep_freed_memory()
    started = time.perf_counter()
    robot = load()
    with Workers(0 if jobs in (None, 1) else jobs) as workers, progress("poses") as show:
        found = workspace(
            robot, module, link=link, axes=sweep, at=at, steps=steps, limits=not no_limits,
            redundancy=redundancy, spread=workers.over, progress=lambda poses: show(poses, None),
        )  # fmt: skip
    _write(found, output)
    if plot:
        _draw(robot, found, plot)
    for line in _summary(robot, found, time.perf_counter() - started):
        click.echo(line, err=True)


def _write(found: Workspace, output: str | None) -> None:
    columns = {
        f"{found.sweep.key}/pose/{n}": found.coordinates[:, i] for i, n in enumerate(found.sweep.names)
    }
    columns |= {f"{name}/position": values for name, values in found.motors.items()}
    columns |= found.measures
    with open_results(output, list(columns)) as write:
        write(np.column_stack(list(columns.values())))


def _draw(robot: HybridRobot, found: Workspace, plot: str) -> None:
    sweep = found.sweep
    units = dict.fromkeys(robot.effort_units[i] for k in sweep.modules for i in robot.modules[k].motor_index)
    swept = [*sweep.axes, *(name for name in sweep.names if name not in sweep.axes)]

    def named(coordinates: Array) -> dict[str, Array]:
        return {name: coordinates[:, sweep.names.index(name)] for name in swept}

    title, unit = f"{robot.name}: {sweep.link}", " or ".join(units)
    ends = {reason: named(places) for reason, places in sorted(found.edges.items())[:BLOCKS]}
    poses = named(found.coordinates)
    save(figure_of_workspace(poses, found.measures, title=title, unit=unit, ends=ends), plot)


def _summary(robot: HybridRobot, found: Workspace, seconds: float) -> list[str]:
    sweep, several = found.sweep, len(found.sweep.modules) > 1
    numbers = ", ".join(str(k + 1) for k in sweep.modules)
    poses = f"{counted(len(found.index), 'pose')} of '{sweep.link}' in '{sweep.base}'"
    lines = [f"module{'s' * several} {numbers}: {poses}"]
    rows = [["coordinate", "from", "ended by", "to", "ended by", "step", "unit"]]
    for i, name in enumerate(sweep.names):
        values, linear = np.round(found.coordinates[:, i], 12) + 0.0, name in "xyz"  # no -0, no 6e-17
        step, ends = "held", ["", ""]
        if name in sweep.axes:
            step = f"{found.steps[sweep.axes.index(name)]:.4g}"
            ends = [", ".join(found.ended(name, side)) for side in (-1, 1)]
        low, high = f"{values.min():.4g}", f"{values.max():.4g}"
        rows.append([name, low, ends[0], high, ends[1], step, "m" if linear else "rad"])
    lines += [f"  {line}" for line in aligned_rows(rows, right=(1, 3, 5))]
    for name, values in found.measures.items():
        finite = values[np.isfinite(values)]
        if "/" not in name and len(finite):
            lost = len(values) - len(finite)
            note = f", {counted(lost, 'singular pose')}" if lost else ""
            lines.append(f"{name}: {finite.min():.4g} to {finite.max():.4g}{note}")
    stops = sorted(found.blocked.items(), key=lambda item: (-item[1], item[0]))
    looped = any(robot.modules[k].closures for k in sweep.modules)
    reach = "reach" if several or not looped else "reach of the loops"
    named = [f"{reach if name == 'reach' else name} ({count:,})" for name, count in stops[:BLOCKS]]
    more = f" and {len(stops) - BLOCKS} more joints" if len(stops) > BLOCKS else ""
    stopped = f"steps stopped by: {', '.join(named) or 'nothing'}{more}"
    if found.spare:
        lines.append(
            f"{counted(found.spare, 'further freedom')} of the motors: {RULES[found.redundancy]}; another "
            "motion may reach more"
        )
    return [*lines, stopped, f"wall time {seconds:.2f} s"]
