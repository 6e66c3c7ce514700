"""`hybridyn size`: compute what a motion requires of each motor, for choosing motors."""

from __future__ import annotations

import dataclasses
import functools
import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from .common.batch import takes_many
from .common.engine import choose_engine, takes_engine, worth_of
from .common.figures import save_sizing, takes_plot
from .common.options import RobotCommand, takes_effects
from .common.report import report_file, write_report
from .common.summary import by_rows, effects_line, fitted_rates
from .common.tables import Plan, Tables, run, takes_jobs, takes_source
from .common.text import aligned_rows, counted
from .idm import check_has_mass, efforts, takes_passive

if TYPE_CHECKING:
    from ..compiled.model import CompiledRobot
    from ..effects import Effects
    from ..streams.blocks import Done, Rows
    from ..streams.postures import Postures
    from ..structure.robot import HybridRobot
    from ..studies.sizing import MotorLoad
    from ..tables.columns import Layout
    from .common.engine import Engine

#: Exit status.
EXCEEDED = 1


@click.command("size", cls=RobotCommand, short_help="Compute what a motion requires of each motor.")
@takes_source("TRAJECTORY", own=True, many=True)
@click.option(
    "-o", "--output", metavar="FILE", help="All numbers, .csv or .json; of several tables, a folder"
)
@takes_plot("effort over speed for every motor, with its limits", page=True)
@takes_effects("model")
@takes_passive
@click.option(
    "--fail-on",
    type=click.Choice(["limit", "never"]),
    default="limit",
    show_default=True,
    help="Exit with status 1 where a motor exceeds a limit of effort or speed, or a joint leaves its range.",
)
@takes_engine("rows")
@takes_jobs
@takes_many(".csv", report_file)
def command(
    load: Callable[[], HybridRobot],
    source: str,
    output: str | None,
    plot: str | None,
    effects: tuple[str, ...],
    passive: str,
    fail_on: str,
    engine: str | None,
    jobs: int | None,
) -> int:
    """Compute the load of each motor of ROBOT along TRAJECTORY, to choose motors.

    The table has the columns of 'hybridyn idm'; long tables are read in blocks. The results for each motor
    are peak and RMS effort, peak speed, peak power delivered and absorbed (braking), mean power, energies,
    travel, and the times of the peaks. With a gear ratio, they include torque and speed of the rotor.
    Efforts, speeds and positions that exceed a limit of the robot's file are listed, also for joints without
    a motor. Unlike 'idm', 'size' computes all effects that the robot's files state, because rotors and
    friction are part of a motor's load.

    Exit status: 0 no limit is exceeded, or --fail-on never; 1 a limit is exceeded (the results are complete),
    or a file is wrong; 2 wrong usage.
    """
    reports: list[_Report] = []

    def plan(robot: HybridRobot, layout: Layout, rows: int | None) -> Plan:
        """Build the plan for a robot and a table."""
        from ..effects import choose

        chosen = choose(robot, effects)
        chosen = chosen.only([name for name in chosen.names if name != "limits"])  # they are reported here
        check_has_mass(robot, chosen, layout)
        obstacles = {"--passive solved": passive != "given", "wrenches in the table": bool(layout.wrenches)}
        chosen_engine = choose_engine(engine, robot, chosen, rows, obstacles, worth_of(layout, robot))
        compiled = chosen_engine.model
        model = functools.partial(motor_states, passive=passive, effects=chosen, compiled=compiled)
        reports.append(_Report(robot, source, output, plot, chosen, chosen_engine))
        assemble = chosen_engine.assemble
        return Plan(model, [], reports[0], written=False, assemble=assemble)

    run(Tables(source, None, None, jobs, quiet=False), load, plan)
    return EXCEEDED if reports[0].violations and fail_on == "limit" else 0


def motor_states(
    robot: HybridRobot,
    block: Postures,
    *,
    passive: str,
    effects: Effects,
    compiled: CompiledRobot | None = None,
) -> Rows:
    """Compute rates, efforts and positions of the motors, shape (T, 3 motors).

    The positions of continuous joints are 0.

    Args:
        passive: As in `hybridyn.idm`.
        effects: The effects that are computed.
        compiled: The robot's compiled models, or None for the general path.
    """
    import numpy as np

    from ..studies.sizing import motor_rows

    made = efforts(robot, block, passive=passive, effects=effects, compiled=compiled)
    position, speed = motor_rows(robot, block.q, block.v)
    rows = np.concatenate([speed, made.result, np.nan_to_num(position)], axis=1)
    return made._replace(result=rows)


class _Report:
    """The loads of the motors, collected block by block, and their report."""

    def __init__(
        self,
        robot: HybridRobot,
        source: str,
        output: str | None,
        plot: str | None,
        effects: Effects,
        engine: Engine,
    ) -> None:
        from ..streams.departures import Departures
        from ..studies.sizing import Sizing

        self.left = Departures()
        self.robot, self.source, self.output, self.plot = robot, source, output, plot
        self.effects, self.engine = effects, engine
        self.sizing = Sizing(robot)
        self.samples = 0
        self.violations: list[str] = []

    def add(self, done: Done) -> None:
        """Add a block."""
        import numpy as np

        self.samples += len(done.rows)
        self.engine.add(done.handed_over)
        self.left.add(done.left, done.first_row, done.time)
        speed, effort, position = np.split(done.rows, 3, axis=1)
        turning = [joint.kind == "continuous" for joint in self.sizing.joints]
        position[:, turning] = np.nan
        self.sizing.add(done.time, done.first_row, position, speed, effort)

    def show(self, layout: Layout, seconds: float, wall: float, jobs: int) -> None:
        """Print the table, write the files, and name what exceeds its limit."""
        from ..studies.sizing import violations

        loads = self.sizing.loads()
        timed = layout.time is not None
        name = self.robot.name
        if self.output:
            write_report(self.output, [facts(load, timed) for load in loads])
        if self.plot:
            save_sizing(self.sizing, f"{name}, {os.path.basename(self.source)}", self.plot)
        over = f" over {self.sizing.duration:.6g} s" if timed else ""
        click.echo(f"{name}: {counted(len(loads), 'motor')}, {counted(self.samples, 'sample')}{over}")
        click.echo("\n".join(_table(loads, timed)))
        self.violations = [*violations(loads), *self._left()]
        for line in self.violations or ["no effort, speed or position is over a limit of the robot's file"]:
            click.echo(line)
        for line in (
            *by_rows(layout), *fitted_rates(layout), *effects_line(self.effects), str(self.engine),
        ):  # fmt: skip
            click.echo(line, err=True)

    def _left(self) -> list[str]:
        """Return lines that name joints outside their ranges, and passive joints that are too fast."""
        motors = set(self.robot.motors)
        found = (one for one in self.left if one.quantity == "position" or one.joint not in motors)
        return [self.left.line(one) for one in found]


def _table(loads: Sequence[MotorLoad], timed: bool) -> list[str]:
    """Return the printed table: one line per motor."""
    at = "at [s]" if timed else "row"
    rows = [["motor", "peak effort", at, "RMS", "peak speed", at, "peak power", at, "braking"]]
    rows[0] += ["mean power", "positive work", "negative work"] if timed else []
    for load in loads:
        force, speed = ("N", "m/s") if load.linear else ("N m", "rad/s")
        cells = [
            load.motor,
            f"{load.effort.value:.5g} {force}",
            f"{load.effort.at:.5g}",
            f"{load.rms_effort:.5g}",
            f"{load.speed.value:.4g} {speed}",
            f"{load.speed.at:.5g}",
            f"{load.power.value:.4g} W",
            f"{load.power.at:.5g}",
            f"{load.braking_power.value:.4g} W",
        ]
        if timed:
            cells += [f"{load.mean_power:.4g} W", f"{load.energy_given:.4g} J", f"{load.energy_taken:.4g} J"]
        rows.append(cells)
    return [f"  {line}" for line in aligned_rows(rows, right=range(1, len(rows[0])))]


def facts(load: MotorLoad, timed: bool) -> dict[str, Any]:
    """Return the load of a motor as flat names and values, None for unknown ones.

    Args:
        timed: Whether the table has time; if not, peaks are at rows.
    """
    out: dict[str, Any] = {}
    for field in dataclasses.fields(load):
        value = getattr(load, field.name)
        if field.name in ("effort", "speed", "power", "braking_power"):
            out |= {
                f"peak_{field.name}": value.value,
                f"peak_{field.name}_{'at' if timed else 'row'}": value.at,
            }
        elif field.name == "travel":
            lower, upper = value or (None, None)
            out |= {"position_lower": lower, "position_upper": upper}
        elif isinstance(value, float) and math.isinf(value):
            out[field.name] = None
        elif field.name == "linear":
            out |= {"effort_unit": "N" if value else "N m", "speed_unit": "m/s" if value else "rad/s"}
        else:
            out[field.name] = value
    if load.gear_ratio != 1.0:
        out |= {
            "rotor_peak_torque": load.rotor_torque,
            "rotor_rms_torque": load.rotor_rms_torque,
            "rotor_peak_speed": load.rotor_speed,
        }
    return out
