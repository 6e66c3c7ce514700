"""The report of `hybridyn idm --by-effect`: what each effect adds to the efforts."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING, Any

import click

from .engine import WORTH_OF_EFFECTS, choose_engine
from .figures import save_chart
from .report import write_report
from .summary import by_rows, effects_line
from .text import aligned_rows, counted

if TYPE_CHECKING:
    from .options import RobotChoice
    from .tables import Tables


def tell_effects(load: RobotChoice, tables: Tables, effects: tuple[str, ...], engine: str | None) -> None:
    """Evaluate the inverse model under sets of effects, and print what each effect adds.

    Args:
        effects: The effects that the user names.
        engine: The engine that the user names, or None.

    Raises:
        HybridynError: The table is wrong, or a row cannot be assembled.
    """
    from ...effects import choose
    from ...streams.one_pass import read_postures
    from ...streams.postures import rows_named
    from ...studies.effect_worth import EffectSets, contributions

    robot = load()
    on = choose(robot, effects)
    layout, (motion, q, v, a) = read_postures(robot, tables.source)
    obstacles = {"wrenches in the table": bool(motion.wrenches)}
    chosen = choose_engine(engine, robot, on, len(q), obstacles, WORTH_OF_EFFECTS)
    sets = None if chosen.model is None else EffectSets(chosen.model)
    with rows_named(layout, motion):
        found = contributions(robot, q, v, a, on, wrenches=motion.wrenches, time=motion.time, sets=sets)
    told: list[dict[str, Any]] = [
        {"effect": one.name, "motor": motor, "unit": robot.effort_units[i]}
        | {
            name: float(values[i]) if math.isfinite(values[i]) else None
            for name, values in (("peak", one.peak), ("rms", one.rms), ("share", one.share))
        }
        for one in found
        for i, motor in enumerate(robot.motors)
    ]
    if tables.output:
        write_report(tables.output, told)
    click.echo("\n".join(_table(told)))
    if tables.plot:
        from ...figures.reports import chart_of_report

        title = f"{robot.name}, {os.path.basename(tables.source)}: what each effect adds"
        save_chart(chart_of_report(told, title=title), tables.plot)
    if tables.quiet:
        return
    lines = [*effects_line(on), *by_rows(layout)]
    if sets is not None:
        chosen.add(sum(model.recomputed for model in sets.models.values()))
        lines.append(f"{counted(len(sets.models), 'set')} of effects compiled")
        for names, reason in [*sets.refused.items()][:1]:
            left = f"{counted(len(sets.refused), 'set')} of effects left to the general path"
            lines.append(f"{left}; {', '.join(names)}: {reason}")
    click.echo("\n".join([*lines, str(chosen)]), err=True)


def _table(told: list[dict[str, Any]]) -> list[str]:
    """Return the table of each effect's addition to each motor's effort.

    Without an effect, a passive motion may need an effort that no motor has.
    """
    rows = [["effect", "motor", "peak", "RMS", "unit", "share"]]
    for one in told:
        cells = ["needed", "", "", ""]
        if one["peak"] is not None:
            cells = [f"{one['peak']:.4g}", f"{one['rms']:.4g}", one["unit"], f"{one['share']:.2%}"]
        rows.append([one["effect"], one["motor"], *cells])
    return aligned_rows(rows, right=(2, 3, 5))
