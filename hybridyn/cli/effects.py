"""`hybridyn effects`: compute what each effect contributes to a motion's efforts, and what it costs."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import click

from .common.engine import WORTH_OF_EFFECTS, Engine, choose_engine, takes_engine
from .common.figures import save_chart, takes_plot
from .common.options import RobotCommand, takes_effects
from .common.report import report_file, write_report
from .common.summary import by_rows, effects_line
from .common.tables import takes_source
from .common.text import aligned_rows, counted

if TYPE_CHECKING:
    from ..effects import Effects
    from ..structure.robot import HybridRobot
    from ..studies.effect_worth import Contribution, EffectSets, Selection, Worth


def _part(ctx: click.Context, param: click.Parameter, value: str | None) -> float | None:
    """Parse "1%" or "0.01"."""
    if value is None:
        return None
    try:
        number = float(value[:-1]) / 100 if value.endswith("%") else float(value)
    except ValueError:
        number = -1.0
    if not 0 <= number < float("inf"):
        raise click.BadParameter(
            f"'{value}' is neither a percentage like '1%' nor a number like '0.01'", ctx, param
        )
    return number


@click.command(
    "effects", cls=RobotCommand, short_help="Compute what each physical effect adds to the efforts."
)
@takes_source("TRAJECTORY", own=True)
@click.option("-o", "--output", metavar="FILE", callback=report_file, help="All numbers, .csv or .json")
@takes_effects("model")
@takes_engine("rows", WORTH_OF_EFFECTS)
@takes_plot("what each effect adds to each motor's effort", page=True)
@click.option(
    "--within",
    metavar="PART",
    callback=_part,
    help="Also find a smaller set of effects whose efforts differ by at most this part, such as '1%', of "
    "each motor's peak effort: effects are left out one after the other, the smallest first.",
)
def command(
    load: Callable[[], HybridRobot],
    source: str,
    output: str | None,
    effects: tuple[str, ...],
    engine: str | None,
    plot: str | None,
    within: float | None,
) -> None:
    """Compute what each effect adds to the efforts of ROBOT along TRAJECTORY, and its cost in time.

    The table has the columns of 'hybridyn idm'. The addition of an effect is the difference between the
    efforts with all effects and those without this effect. Without inertia, the effects that need it
    (velocity, rotor_inertia) are left out as well. The results for each effect and motor are the largest
    addition, its RMS, and its share (RMS over the RMS of the motor's whole effort; shares need not sum to
    100 %). Times are those of the general path, measured on this machine. 'hybridyn cost' measures compiled
    models.

    Effects: gravity, inertia, leg_inertia (the legs' mass), velocity (centrifugal and gyroscopic forces),
    rotor_inertia, viscous_friction, coulomb_friction, stribeck_friction, spring, damper, stop,
    ground_contact, limits; numbers come from the robot's files.
    """
    from ..effects import choose

    robot = load()
    chosen = choose(robot, effects)
    worth, tell = weigh(robot, source, chosen, engine)
    added, seconds = worth.contributions()
    if output:
        write_report(output, contribution_facts(robot, added))
    for line in (*contribution_lines(robot, added), *cost_lines(added, seconds)):
        click.echo(line)
    if within is not None:
        click.echo()
        click.echo(selection_line(robot, worth.sufficient(within), within))
    if plot:
        from ..figures.effects import chart_of_effects

        title = f"{robot.name}, {os.path.basename(source)}: what each effect adds"
        save_chart(chart_of_effects(robot, added, title=title), plot)
    for line in (*effects_line(chosen), *tell()):
        click.echo(line, err=True)


def weigh(
    robot: HybridRobot, trajectory: str, effects: Effects, engine: str | None
) -> tuple[Worth, Callable[[], list[str]]]:
    """Read a motion and evaluate the inverse model on it.

    Args:
        trajectory: The table's file.
        engine: The engine that the user names, or None.

    Returns:
        The contributions of the effects, and a function that returns lines about the engine afterwards.

    Raises:
        HybridynError: The table is wrong, or a row cannot be assembled.
    """
    from ..streams.postures import Postures, all_postures, rows_named
    from ..studies.effect_worth import EffectSets, Worth

    layout, blocks = all_postures(robot, trajectory)
    motion, q, v, a = Postures.joined(blocks)
    obstacles = {"wrenches in the table": bool(motion.wrenches)}
    chosen = choose_engine(engine, robot, effects, len(q), obstacles, WORTH_OF_EFFECTS)
    sets = None if chosen.model is None else EffectSets(chosen.model)
    with rows_named(layout, motion):
        worth = Worth(robot, q, v, a, effects, wrenches=motion.wrenches, time=motion.time, compiled=sets)
    return worth, lambda: [*by_rows(layout), *engine_lines(chosen, sets)]


def engine_lines(engine: Engine, sets: EffectSets | None) -> list[str]:
    """Return the lines that name the engine, and how many sets of effects it computed."""
    if sets is None:
        return [str(engine)]
    recomputed = sum(model.recomputed for model in sets.models.values())
    engine.add(recomputed)
    each = ", each of which counts its samples" if recomputed else ""
    lines = [str(engine), f"{counted(len(sets.models), 'set')} of effects compiled{each}"]
    if sets.refused:
        names, reason = next(iter(sets.refused.items()))
        left = f"{counted(len(sets.refused), 'set')} of effects left to the general path"
        lines.append(f"{left}; {', '.join(names)}: {reason}")
    return lines


def contribution_lines(robot: HybridRobot, contributions: Sequence[Contribution]) -> list[str]:
    """Return the table of each effect's addition to each motor's effort."""
    rows = [["effect", "motor", "peak", "RMS", "unit", "share"]]
    for effect in contributions:
        for i, (motor, unit) in enumerate(zip(robot.motors, robot.effort_units, strict=True)):
            peak, rms, share = effect.peak[i], effect.rms[i], effect.share[i]
            if peak != peak:  # NaN: without the effect, a passive motion needs an effort that no motor has
                rows.append([effect.name, motor, "needed", "", "", ""])
            else:
                rows.append([effect.name, motor, f"{peak:.4g}", f"{rms:.4g}", unit, f"{share:.2%}"])
    return aligned_rows(rows, right=(2, 3, 5))


def contribution_facts(robot: HybridRobot, contributions: Sequence[Contribution]) -> list[dict[str, Any]]:
    """Return each effect's addition to each motor's effort by name; None where the effect is needed."""
    return [
        {
            "effect": effect.name,
            "motor": motor,
            "unit": robot.effort_units[i],
            "seconds_per_sample": effect.seconds,
        }
        | {
            name: float(values[i]) if math.isfinite(values[i]) else None
            for name, values in (("peak", effect.peak), ("rms", effect.rms), ("share", effect.share))
        }
        for effect in contributions
        for i, motor in enumerate(robot.motors)
    ]


def cost_lines(contributions: Sequence[Contribution], seconds: float) -> list[str]:
    """Return the table of each effect's cost in time."""
    rows = [["effect", "time per sample", "of the whole"]]
    for effect in contributions:
        share = f"{effect.seconds / seconds:.1%}" if seconds > 0 else ""  # a coarse clock stands still
        rows.append([effect.name, f"{effect.seconds * 1e6:.1f} us", share])
    rows.append(["all together", f"{seconds * 1e6:.1f} us", ""])
    return ["", *aligned_rows(rows, right=(1, 2))]


def selection_line(robot: HybridRobot, chosen: Selection, within: float) -> str:
    """Return the line that names the sufficient effects."""
    where = f" (motor {robot.motors[chosen.motor]})" if robot.motors else ""
    return (
        f"sufficient within {within:.3g} of the peak efforts: --effects {','.join(chosen.names) or 'none'}; "
        f"largest departure {chosen.deviation:.2g}{where}; {chosen.seconds * 1e6:.1f} us per sample "
        f"instead of {chosen.full_seconds * 1e6:.1f} us"
    )
