"""Write a comparison as a table of text."""

from __future__ import annotations

import numpy as np

from ...description.names import counted, listed
from .compare import Comparison
from .judging import Verdict

HEADS = (
    "engine", "how the robot came in", "freedoms", "closures", "accelerations", "efforts", "time per call",
)  # fmt: skip
NONE = "-"


def rows_of(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the cells of the table, one row for each engine and way."""
    return [_row(comparison, verdict) for verdict in comparison.verdicts]


def _row(comparison: Comparison, verdict: Verdict) -> tuple[str, ...]:
    engine = f"{verdict.engine} {verdict.version}".strip()
    if verdict.refusal:
        return (engine, verdict.way, NONE, "not compared", NONE, NONE, NONE)
    freedoms = NONE if verdict.freedoms is None else str(verdict.freedoms)
    return (
        engine,
        verdict.way,
        freedoms + (" (!)" if verdict.freedoms not in (None, comparison.freedoms) else ""),
        _closures(verdict),
        _number(verdict.acceleration),
        _number(verdict.effort),
        _time(verdict.seconds),
    )


def _closures(verdict: Verdict) -> str:
    parts = []
    for fate in ("held", "softened", "ignored"):
        if names := verdict.named(fate):
            parts.append(f"{len(names)} {fate}")
    return ", ".join(parts) or "none"


def _number(value: float | None) -> str:
    if value is None:
        return NONE
    return "failed" if not np.isfinite(value) else f"{value:.1e}"


def _time(seconds: float | None) -> str:
    if seconds is None:
        return NONE
    return f"{seconds * 1e6:.0f} us" if seconds < 1e-3 else f"{seconds * 1e3:.1f} ms"


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
    rows = [HEADS, *rows_of(comparison)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADS))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    return "\n".join([head(comparison), *(line.rstrip() for line in lines), *remarks(comparison)])
