"""The report of `hybridyn idm --by-effect`: what each effect adds to the efforts, and what it costs."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from .engine import WORTH_OF_EFFECTS, Engine, choose_engine
from .figures import save_chart
from .report import write_report
from .summary import by_rows, effects_line
from .text import aligned_rows, counted

if TYPE_CHECKING:
    from ...structure.robot import HybridRobot
    from ...studies.effect_worth import Contribution, EffectSets, Selection
    from .options import RobotChoice
    from .tables import Tables


def tell_effects(
    load: RobotChoice, tables: Tables, effects: tuple[str, ...], engine: str | None, within: float | None
) -> None:
    """Evaluate the inverse model under sets of effects, and print what each effect adds.

    Args:
        effects: The effects that the user names.
        engine: The engine that the user names, or None.
        within: Part of each motor's peak effort within which a smaller set is wanted, or None.

    Raises:
        HybridynError: The table is wrong, or a row cannot be assembled.
    """
    from ...effects import choose
    from ...streams.one_pass import read_postures
    from ...streams.postures import rows_named
    from ...studies.effect_worth import EffectSets, Worth

    robot = load()
    on = choose(robot, effects)
    layout, (motion, q, v, a) = read_postures(robot, tables.source)
    obstacles = {"wrenches in the table": bool(motion.wrenches)}
    chosen = choose_engine(engine, robot, on, len(q), obstacles, WORTH_OF_EFFECTS)
    sets = None if chosen.model is None else EffectSets(chosen.model)
    with rows_named(layout, motion):
        worth = Worth(robot, q, v, a, on, wrenches=motion.wrenches, time=motion.time, compiled=sets)
    added, seconds = worth.contributions()
    told = contribution_facts(robot, added)
    if tables.output:
        write_report(tables.output, told)
    lines = [*contribution_lines(robot, added), *cost_lines(added, seconds)]
    if within is not None:
        lines += ["", selection_line(robot, worth.sufficient(within), within)]
    click.echo("\n".join(lines))
    if tables.plot:
        from ...figures.reports import chart_of_report

        title = f"{robot.name}, {os.path.basename(tables.source)}: what each effect adds"
        save_chart(chart_of_report(told, title=title), tables.plot)
    if not tables.quiet:
        click.echo("\n".join([*effects_line(on), *by_rows(layout), *engine_lines(chosen, sets)]), err=True)


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
