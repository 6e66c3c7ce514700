"""The reports of `hybridyn idm`: what a motion requires of each motor, and what each effect adds."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import click
import numpy as np

from ...effects import choose
from ...effects.dc_motors import OnDcMotors
from ...figures.reports import chart_of_report, chart_of_sizing
from ...streams.departures import Departures, beyond_supply
from ...streams.one_pass import BlockResults, read_postures
from ...streams.postures import TreeSamples, rows_named
from ...structure.robot import HybridRobot
from ...studies.effect_worth import Contribution, EffectSets, contributions
from ...studies.sizing import MotorLoad, Peak, Sizing, motor_rows
from ...studies.supply import SupplyLoad, SupplyLoads
from ...tables.columns import SUPPLY
from ...tables.layout import Layout
from .engine_choice import WORTH_OF_EFFECTS, choose_engine
from .figures import save, title_of
from .files import write_report
from .one_table import CommandTables
from .options import RobotChoice
from .summary import about
from .text import aligned_rows, counted

#: Part of the numbers that make it up, below which a sum is their rounding.
WORK_ROUNDING = 1e-12
#: Quantities that have limits.
LIMITED = ("position", "speed", "effort")


def motor_states(
    robot: HybridRobot, block: TreeSamples, *, efforts: Callable[[HybridRobot, TreeSamples], BlockResults],
    dc: OnDcMotors | None,
) -> BlockResults:  # fmt: skip
    """Compute rates, efforts and positions of the motors, shape (T, 3 motors).

    The positions of continuous joints are 0.

    Args:
        efforts: Computes the efforts of a block.
        dc: The DC motors, whose needs are compared with their supply; None where there are none.
    """
    made = efforts(robot, block)
    position, speed = motor_rows(robot, block.q, block.v)
    left = made.left if dc is None else (*made.left, *beyond_supply(robot, dc, speed, made.rows))
    return made._replace(rows=np.concatenate([speed, made.rows, np.nan_to_num(position)], axis=1), left=left)


class LoadReport:
    """The loads of the motors, collected block by block, and their report."""

    def __init__(self, robot: HybridRobot, tables: CommandTables, dc: OnDcMotors | None) -> None:
        self.robot, self.tables, self.sizing = robot, tables, Sizing(robot)
        self.dc, self.supply = dc, None if dc is None else SupplyLoads(robot, dc)

    def add(self, done: BlockResults) -> None:
        """Add a block."""
        speed, effort, position = np.split(done.rows, 3, axis=1)
        position[:, [joint.kind.endless for joint in self.sizing.joints]] = np.nan
        self.sizing.add(done.time, done.first_row, position, speed, effort)
        if self.supply is not None:
            self.supply.add(done.time, done.first_row, speed, effort)

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Print the table, write the files, and name what exceeds its limit."""
        loads, name, timed = self.sizing.loads(), self.robot.name, layout.time is not None
        supply = [] if self.supply is None else self.supply.loads()
        if self.tables.output:
            over = Counter({(one.joint, one.quantity): one.count for one in left})
            limited = (*LIMITED, *(SUPPLY if supply else ()))
            counts = [{f"over_{what}": over[load.motor, what] for what in limited} for load in loads]
            rows = [facts(load, timed) | count for load, count in zip(loads, counts, strict=True)]
            if supply:
                own = {one.motor: supply_facts(one, timed) for one in supply}
                none = dict.fromkeys(next(iter(own.values())))
                rows = [row | own.get(str(row["motor"]), none) for row in rows]
            write_report(self.tables.output, rows)
        if self.tables.plot:
            title = title_of(self.robot, self.tables.source)
            save(chart_of_sizing(self.sizing, dc=self.dc, title=title), self.tables.plot)
        during = f" over {self.sizing.duration:.6g} s" if timed else ""
        samples = counted(self.sizing.samples, "sample")
        lines = [f"{name}: {counted(len(loads), 'motor')}, {samples}{during}", *_table(loads, timed)]
        lines += _table_of_supply(supply, timed) if supply else []
        lines += [left.line(one) for one in left]
        if not any(left):
            more = "current, voltage, " if supply else ""
            lines.append(f"no {more}effort, speed or position is over a limit of the robot's file")
        click.echo("\n".join(lines))


def _table(loads: Sequence[MotorLoad], timed: bool) -> list[str]:
    """Return the printed table: one line per motor."""
    at = "at [s]" if timed else "row"
    rows = [["motor", "peak effort", at, "RMS", "peak speed", at, "peak power", at, "braking"]]
    rows[0] += ["mean power", "positive work", "negative work"] if timed else []
    for load in loads:
        cells = [
            load.motor,
            f"{load.effort.value:.5g} {load.unit('effort')}",
            f"{load.effort.at:.5g}",
            f"{load.rms_effort:.5g}",
            f"{load.speed.value:.4g} {load.unit('speed')}",
            f"{load.speed.at:.5g}",
            f"{load.power.value:.4g} W",
            f"{load.power.at:.5g}",
            f"{load.braking_power.value:.4g} W",
        ]
        if timed:
            given, taken = load.energy_given or 0.0, load.energy_taken or 0.0
            both = abs(given) + abs(taken)
            cells.append(f"{unless_rounding(load.mean_power or 0.0, load.power.value):.4g} W")
            cells += [f"{unless_rounding(x, both):.4g} J" for x in (given, taken)]
        rows.append(cells)
    return [f"  {line}" for line in aligned_rows(rows, right=range(1, len(rows[0])))]


def _table_of_supply(loads: Sequence[SupplyLoad], timed: bool) -> list[str]:
    """Return the printed table of currents and voltages: one line per DC motor."""
    at = "at [s]" if timed else "row"
    rows = [["motor", "peak current", at, "RMS", "peak voltage", at, "heat"]]
    for load in loads:
        current, voltage = f"{load.current.value:.4g} A", f"{load.voltage.value:.4g} V"
        cells = [current, f"{load.current.at:.5g}", f"{load.rms_current:.4g}", voltage]
        rows.append([load.motor, *cells, f"{load.voltage.at:.5g}", f"{load.heat:.4g} W"])
    return [f"  {line}" for line in aligned_rows(rows, right=range(1, len(rows[0])))]


def supply_facts(load: SupplyLoad, timed: bool) -> dict[str, Any]:
    """Return what a DC motor takes as flat names and values; `timed` as for `facts`."""
    at = "at" if timed else "row"
    peaks = (("current", load.current), ("voltage", load.voltage))
    out = {f"peak_{name}": peak.value for name, peak in peaks}
    out |= {f"peak_{name}_{at}": peak.at for name, peak in peaks}
    rest = ("rms_current", "heat", "current_limit", "voltage_limit")
    return out | {name: getattr(load, name) for name in rest}


def unless_rounding(x: float, size: float) -> float:
    """Return a number, or zero where it is rounding of numbers of a size."""
    return x + 0.0 if abs(x) > WORK_ROUNDING * abs(size) else 0.0


def facts(load: MotorLoad, timed: bool) -> dict[str, Any]:
    """Return the load of a motor as flat names and values, None for unknown ones.

    Args:
        timed: Whether the table has time; if not, peaks are at rows.
    """
    out: dict[str, Any] = {}
    for name, value in vars(load).items():
        if isinstance(value, Peak):
            out |= {f"peak_{name}": value.value, f"peak_{name}_{'at' if timed else 'row'}": value.at}
        elif name == "travel":
            out |= dict(zip(("position_lower", "position_upper"), value or (None, None), strict=True))
        elif name == "linear":
            out |= {"effort_unit": load.unit("effort"), "speed_unit": load.unit("speed")}
        else:
            out[name] = value
    if load.gear_ratio != 1.0:
        out |= {
            "rotor_peak_torque": load.rotor_torque,
            "rotor_rms_torque": load.rotor_rms_torque,
            "rotor_peak_speed": load.rotor_speed,
        }
    return out


def save_report(rows: list[dict[str, Any]], robot: HybridRobot, tables: CommandTables, what: str) -> None:
    """Write rows and their chart to the files that are named; `what` they tell is the title."""
    if tables.output:
        write_report(tables.output, rows)
    if tables.plot:
        title = f"{title_of(robot, tables.source)}: {what}"
        save(chart_of_report(rows, title=title), tables.plot)


def tell_effects(
    load: RobotChoice, tables: CommandTables, effects: tuple[str, ...], engine: str | None
) -> None:
    """Evaluate the inverse model under sets of effects, and print what each effect adds.

    Args:
        effects: The effects that the user names.
        engine: The engine that the user names, or None.

    Raises:
        HybridynError: The table is wrong, or a row cannot be assembled.
    """
    robot = load()
    asked = choose(robot, effects)
    on = asked.unbounded
    layout, (motion, q, v, a) = read_postures(robot, tables.source, tables.redundancy)
    obstacles = {"wrenches in the table": bool(motion.wrenches)}
    chosen = choose_engine(engine, robot, on, len(q), WORTH_OF_EFFECTS, obstacles)
    sets = None if chosen.model is None else EffectSets(chosen.model)
    with rows_named(layout, motion):
        contributed = contributions(robot, q, v, a, on, wrenches=motion.wrenches, time=motion.time, sets=sets)
    told = [
        _contribution(one, i, motor, robot.effort_units[i])
        for one in contributed
        for i, motor in enumerate(robot.motors)
    ]
    save_report(told, robot, tables, "what each effect adds")
    click.echo("\n".join(_table_of_effects(told)))
    if tables.quiet:
        return
    lines = about(robot, layout, asked)
    if sets is not None:
        chosen.handed_over = sum(model.recomputed for model in sets.models.values())
        made = counted(len(sets.models), "set")
        lines.append(f"{made} of effects compiled, {len(sets.refused)} left to the general path")
    click.echo("\n".join([*lines, str(chosen)]), err=True)


def _contribution(one: Contribution, i: int, motor: str, unit: str) -> dict[str, Any]:
    """Return what an effect adds at the motor of an index, None for what is unknown."""
    values = {"peak": one.peak, "rms": one.rms, "share": one.share}
    known = {name: float(x[i]) if math.isfinite(x[i]) else None for name, x in values.items()}
    return {"effect": one.name, "motor": motor, "unit": unit} | known


def _table_of_effects(told: Sequence[dict[str, Any]]) -> list[str]:
    """Return the printed table: one line per effect and motor."""
    rows = [["effect", "motor", "peak", "RMS", "unit", "share"]]
    for one in told:  # without an effect, a passive motion may need an effort that no motor has
        cells = ["needed", "", "", ""]
        if one["peak"] is not None:
            cells = [f"{one['peak']:.4g}", f"{one['rms']:.4g}", one["unit"], f"{one['share']:.2%}"]
        rows.append([one["effect"], one["motor"], *cells])
    return aligned_rows(rows, right=(2, 3, 5))
