"""`hybridyn identify`: identify dynamic parameters from measured motions, or compute a motion to measure."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

from .common.engine import choose_engine, takes_engine
from .common.figures import plot_option, save_chart
from .common.files import ends_in, existing_file, result_file
from .common.options import RobotChoice, RobotCommand, split_names

if TYPE_CHECKING:
    from ..identification.result import Identification

METHODS = ("wls", "irls", "iv")


@click.command(
    "identify",
    cls=RobotCommand,
    params=[plot_option("efforts and spectra of the motors that fit worst")],
    short_help="Identify dynamic parameters from measured motions.",
)
@click.argument("log", metavar="[MEASURED]", required=False, callback=existing_file, type=click.Path())
@click.option(
    "--effects", metavar="A,B,...", callback=split_names, default="model", show_default=True,
    help="Effects with numbers to identify (docs/effects.md); 'offsets' adds a constant to each motor.",
)  # fmt: skip
@click.option("--symmetric", is_flag=True, help="Equal legs share their parameters.")
@click.option(
    "--method", type=click.Choice(METHODS), default="wls", show_default=True,
    help="Least squares, each motor weighted by its noise; the same robust to outliers; instruments.",
)  # fmt: skip
@click.option(
    "--reference", metavar="FILE", callback=existing_file, help="The commanded motion, for --method iv."
)
@click.option(
    "--validate", metavar="FILE", callback=existing_file, help="Log of a second motion, to test the result."
)
@click.option("--known", metavar="A,B,...", callback=split_names, help="Parameters known from the file.")
@click.option("--only", metavar="A,B,...", callback=split_names, help="Parameters to identify.  [default: *]")
@click.option("--band", type=click.FloatRange(0, min_open=True), metavar="HZ", help="Band of the positions.")
@click.option("--period", type=click.FloatRange(0, min_open=True), metavar="S", help="Period of the motion.")
@click.option("--every", type=click.IntRange(1), metavar="N", help="Samples that are averaged to one.")
@click.option(
    "-o", "--output", metavar="FILE", callback=ends_in(".urdf", ".xml", ".sdf", ".usda"),
    help="Write the robot with the parameters, as 'hybridyn convert' does.",
)  # fmt: skip
@click.option("--report", metavar="FILE", callback=ends_in(".md"), help="Write a report in Markdown.")
@click.option(
    "--excite", metavar="FILE", callback=result_file,
    help="Instead of all this: compute a motion to measure, and write it.",
)  # fmt: skip
@click.option(
    "--evaluations", type=click.IntRange(1), metavar="N", default=50, show_default=True,
    help="With --excite: candidates that are tried.",
)  # fmt: skip
@takes_engine
def command(
    load: RobotChoice,
    log: str | None,
    excite: str | None,
    evaluations: int,
    effects: list[str],
    symmetric: bool,
    period: float | None,
    output: str | None,
    report: str | None,
    plot: str | None,
    engine: str | None,
    known: list[str] | None,
    only: list[str] | None,
    **words: Any,
) -> None:
    """Identify dynamic parameters of ROBOT (URDF, MJCF, SDF, USD) from the log MEASURED (CSV or Parquet).

    The log has the columns 'time', and '<motor>/position' and '<motor>/effort' (or '<motor>/current') of
    every motor, in SI units, at a constant rate. Passive joints are not measured: the loops are closed.
    """
    if (log is None) == (excite is None):
        raise click.UsageError("give a log, or --excite and the file of the motion to be computed")
    from ..effects.choice import choose
    from ..tables.opening import open_table

    robot = load()
    samples = None
    if log is not None:
        with open_table(log) as table:
            samples = table.rows
    on = choose(robot, [name for name in effects if name != "offsets"])
    chosen = choose_engine(engine, robot, on, samples, {})
    shared: dict[str, Any] = {"effects": effects, "symmetric": symmetric, "compiled": chosen.model}
    if excite is not None:
        from ..identification.excitation import excitation

        motion = excitation(robot, period=period or 10.0, evaluations=evaluations, **shared)
        motion.write(excite)
        click.echo(f"a period of {motion.period:g} s, condition {motion.condition:.3g}: {excite}", err=True)
        return
    from ..identification.identify import identify

    found = identify(robot, log, period=period, known=known or (), only=only or ("*",), **shared, **words)
    _tell(found, output, report, plot)


def _tell(found: Identification, output: str | None, report: str | None, plot: str | None) -> None:
    """Print the result, and write the files that are wanted."""
    from ..description.writing import write_text
    from ..identification.result import summary, unknown

    for line in [*summary(found), *unknown(found)]:
        click.echo(line.replace("`", "'"))
    if report:
        write_text(report, found.report())
    if plot:
        from ..figures.identification import chart_of_identification

        save_chart(chart_of_identification(found, title=f"{found.robot.name}: measured and predicted"), plot)
    if output:
        from ..conversion.convert import convert

        for file in convert(found.identified, output).files:
            click.echo(f"written: {file}", err=True)
