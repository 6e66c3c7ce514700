"""`hybridyn idm`: motor efforts for a motion."""

from __future__ import annotations

import functools
import os
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import click

from hybridyn.cli.postures import postures, rows_named
from hybridyn.cli.progress import Progress
from hybridyn.cli.robot_options import RobotCommand, existing_file, result_file, takes_robot
from hybridyn.cli.summary import EffortSummary

if TYPE_CHECKING:
    from hybridyn.cli.postures import Postures
    from hybridyn.description.columns import Layout
    from hybridyn.description.records import Array
    from hybridyn.robot import HybridRobot


@click.command("idm", cls=RobotCommand, short_help="Motor efforts for a motion (inverse dynamic model).")
@takes_robot
@click.argument("trajectory", callback=existing_file)
@click.option(
    "-o",
    "--output",
    metavar="FILE",
    callback=result_file,
    help="Result file, .csv or .parquet  [default: CSV on standard output]",
)
@click.option(
    "--passive",
    type=click.Choice(["given", "solved"]),
    default="given",
    show_default=True,
    help="Accelerations of joints without a motor: as the table says, or those of zero effort.",
)
@click.option(
    "--on-singular",
    type=click.Choice(["raise", "least-norm"]),
    default="raise",
    show_default=True,
    help="At a singular posture: stop, or take the smallest efforts.",
)
@click.option(
    "--weights",
    multiple=True,
    help="How redundant motors share: motor=value for every motor (commas or repeated), or a CSV file with "
    "the motors' names and one row.",
)
@click.option("-q", "--quiet", is_flag=True, help="No summary.")
def command(
    load: Callable[[], HybridRobot],
    trajectory: str,
    output: str | None,
    passive: str,
    on_singular: str,
    weights: tuple[str, ...],
    quiet: bool,
) -> None:
    """Give the motor efforts that move ROBOT (URDF or xacro) as TRAJECTORY (CSV or Parquet) says.

    The table has named columns, in SI units: 'time', '<joint>/position|velocity|acceleration',
    '<link>/pose/x|y|z|qx|qy|qz|qw' or any of 'x|y|z|roll|pitch|yaw' relative to the root link
    ('<link>@<other>/...': to another link), '<link>/velocity|acceleration/x|y|z|wx|wy|wz',
    '<link>/wrench/fx|fy|fz|mx|my|mz'. It names the motors, the platforms, a mixture, or every joint;
    missing rates are fitted by a spline over time.

    One row per sample comes out, with 'time' and a column '<motor>/effort' per motor.
    """
    import numpy as np

    import hybridyn
    from hybridyn.description.columns import read_layout
    from hybridyn.description.results import open_results
    from hybridyn.description.tables import open_table
    from hybridyn.description.trajectory import read_motions

    started = time.perf_counter()
    if output and os.path.exists(output) and os.path.realpath(output) == os.path.realpath(trajectory):
        raise click.UsageError(f"'{output}' is read, and would be replaced")
    with open_table(trajectory) as table:
        robot = load()
        layout = read_layout(
            table.columns, robot.description, motors=robot.motors, base=robot.base, file=table.file
        )
        model = functools.partial(
            hybridyn.idm,
            passive=passive,
            on_singular=on_singular,
            weights=read_weights(weights, robot.motors),
        )
        summary = EffortSummary(robot)
        time_column = ["time"] if layout.time is not None else []
        columns = [*time_column, *(f"{name}/effort" for name in robot.motors)]
        loaded = time.perf_counter()
        # Numbers too large for the model show in its efforts, which are checked.
        with open_results(output, columns) as write, Progress() as progress, np.errstate(all="ignore"):
            for block in postures(robot, read_motions(table, layout), layout):
                tau = _efforts(model, robot, block, layout)
                residual = hybridyn.closure_residual(robot, block.q)
                summary.add(tau, residual, block.motion.time, block.motion.first_row)
                write(tau if block.motion.time is None else np.column_stack([block.motion.time, tau]))
                progress.show(summary.samples, table.fraction())
    finished = time.perf_counter()
    if not quiet:
        summary.show(layout, finished - loaded, finished - started)


def _efforts(model: Callable[..., Array], robot: HybridRobot, block: Postures, layout: Layout) -> Array:
    """Give the efforts of a block, shape (T, motors); an error names file and row."""
    import numpy as np

    from hybridyn.errors import TrajectoryError

    motion = block.motion
    with rows_named(layout, motion):
        tau = model(robot, block.q, block.v, block.a, wrenches=motion.wrenches or None)
    wrong = np.flatnonzero(~np.isfinite(tau).all(axis=1))
    if len(wrong):
        message = "the efforts are not finite: the numbers of this row are too large"
        raise TrajectoryError(message, file=layout.file, row=motion.first_row + int(wrong[0]))
    return tau


def read_weights(words: tuple[str, ...], motors: Sequence[str]) -> dict[str, float] | None:
    """Read the motors' weights from `motor=value` words or from a table.

    Args:
        words: Values of `--weights`.
        motors: Names of the motors.

    Returns:
        Weights by motor, or None where none are given; `hybridyn.idm` checks that they are complete.

    Raises:
        click.UsageError: A word is neither `motor=value` nor a file, or a motor is unknown.
    """
    from hybridyn.description.names import did_you_mean
    from hybridyn.description.tables import open_table

    weights: dict[str, float] = {}
    for word in words:
        if "=" not in word:
            with open_table(word) as table:
                weights |= dict(zip(table.columns, next(table.blocks).values[0].tolist(), strict=True))
            continue
        for part in word.split(","):
            name, _, number = part.rpartition("=")
            try:
                weights[name.strip()] = float(number)
            except ValueError:
                raise click.UsageError(f"--weights: '{part}' is not of the form motor=value") from None
    for name in weights:
        if name not in motors:
            raise click.UsageError(f"--weights: there is no motor '{name}'{did_you_mean(name, motors)}")
    return weights or None
