"""Write a comparison as a table of text."""

from __future__ import annotations

from typing import get_args

from ...description.names import counted, listed
from .compare import Comparison
from .judging import Fate, Verdict

HEADS = (
    "engine", "how the robot came in", "freedoms", "closures", "accelerations", "efforts",
)  # fmt: skip


def _row(comparison: Comparison, verdict: Verdict) -> list[str]:
    """Return the cells of an engine and way."""
    who = [f"{verdict.engine} {verdict.version}", verdict.way]
    if verdict.refusal:
        return [*who, "-", "not compared", "-", "-"]
    fates = {fate: len(verdict.named(fate)) for fate in get_args(Fate)}
    differs = " (!)" * (verdict.freedoms != comparison.freedoms)
    return [
        *who, f"{verdict.freedoms}{differs}",
        ", ".join(f"{count} {fate}" for fate, count in fates.items() if count) or "none",
        f"{verdict.acceleration:.1e}", f"{verdict.effort:.1e}",
    ]  # fmt: skip


def remarks(comparison: Comparison) -> list[str]:
    """Return what the table does not say: names of closures, refusals, engines that are skipped."""
    out = []
    for verdict in comparison.verdicts:
        who = f"{verdict.engine}, {verdict.way}"
        if verdict.refusal:
            out.append(f"{who}: {verdict.refusal}")
        if names := verdict.named("ignored"):
            out.append(f"{who}: ignores {listed(names)}")
        soft = [closure for closure in verdict.closures if closure.fate == "softened"]
        if soft:
            worst = max(closure.left for closure in soft)
            out.append(
                f"{who}: softens {listed(closure.name for closure in soft)}; up to {worst:.2g} of the free "
                "opening is left"
            )
        out += [f"{who}: {note}" for note in verdict.notes]
    out += [f"{name}: {reason}" for name, reason in comparison.skipped]
    return out


def head(comparison: Comparison) -> str:
    """Return the line above the table."""
    return (
        f"{comparison.robot}: {counted(comparison.freedoms, 'freedom')}, "
        f"{counted(len(comparison.closures), 'closure')}; {counted(comparison.samples, 'closed state')}, "
        f"differences relative to hybridyn's"
    )


def as_text(comparison: Comparison) -> str:
    """Write the comparison as lines of text with aligned columns."""
    rows = [HEADS, *(_row(comparison, verdict) for verdict in comparison.verdicts)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([head(comparison), *(line.rstrip() for line in lines), *remarks(comparison)])
