"""`hybridyn identify`: identify dynamic parameters from measured motions, or compute a motion to measure."""

from collections.abc import Sequence
from typing import Any

import click

from ..conversion.convert import convert
from ..description.writing import write_text
from ..effects.choice import choose
from ..figures.identification import chart_of_identification
from ..identification.excitation import excitation
from ..identification.identify import identify
from ..identification.result import summary, unknown
from ..tables.opening import open_table
from .common.engine_choice import WORTH, choose_engine
from .common.figures import save
from .common.options import RobotChoice, refuse


def run(
    load: RobotChoice, log: str | None, excite: str | None, evaluations: int, effects: Sequence[str],
    symmetric: bool, period: float | None, output: str | None, report: str | None, plot: str | None,
    engine: str | None, known: Sequence[str] | None, only: Sequence[str] | None, **words: Any,
) -> None:  # fmt: skip
    """Identify the parameters of a robot, or compute a motion to measure."""
    refuse(
        (
            (log is None) == (excite is None),
            "give a log, or --excite and the file of the motion to be computed",
        )
    )
    robot = load()
    samples = None
    if log is not None:
        with open_table(log, choose=lambda _: ()) as table:
            samples = table.rows
    on = choose(robot, [name for name in effects if name != "offsets"])
    chosen = choose_engine(engine, robot, on, samples, WORTH, {})
    shared: dict[str, Any] = {"effects": effects, "symmetric": symmetric, "compiled": chosen.model}
    if excite is not None:
        motion = excitation(robot, period=period or 10.0, evaluations=evaluations, **shared)
        motion.write(excite)
        click.echo(f"a period of {motion.period:g} s, condition {motion.condition:.3g}: {excite}", err=True)
        return
    found = identify(robot, log, period=period, known=known or (), only=only or ("*",), **shared, **words)
    for line in [*summary(found), *unknown(found)]:
        click.echo(line.replace("`", "'"))
    if report:
        write_text(report, found.report())
    if plot:
        save(chart_of_identification(found, title=f"{found.robot.name}: measured and predicted"), plot)
    if output:
        for file in convert(found.identified, output).files:
            click.echo(f"written: {file}", err=True)
