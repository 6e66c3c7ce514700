"""Write a comparison as a table of text, a Markdown page or an HTML page."""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ...description.names import counted, listed
from ...description.writing import write_text
from ...errors import ModelError
from .compare import Comparison
from .judging import Verdict

HEADS = (
    "engine", "how the robot came in", "freedoms", "closures", "accelerations", "efforts", "drift in 1 s",
    "time per call",
)  # fmt: skip
NONE = "-"


def rows_of(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return the cells of the table, one row for each engine and way."""
    return [_row(comparison, verdict) for verdict in comparison.verdicts]


def _row(comparison: Comparison, verdict: Verdict) -> tuple[str, ...]:
    engine = f"{verdict.engine} {verdict.version}".strip()
    if verdict.refusal:
        return (engine, verdict.way, NONE, "not compared", NONE, NONE, NONE, NONE)
    freedoms = NONE if verdict.freedoms is None else str(verdict.freedoms)
    return (
        engine,
        verdict.way,
        freedoms + (" (!)" if verdict.freedoms not in (None, comparison.freedoms) else ""),
        _closures(verdict),
        _number(verdict.acceleration),
        _number(verdict.effort),
        _number(verdict.drift),
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


def as_markdown(comparison: Comparison) -> str:
    """Write the comparison as a Markdown page."""

    def line(cells: Sequence[str]) -> str:
        """Write a row of the table."""
        return "| " + " | ".join(cell.replace("|", r"\|") for cell in cells) + " |"

    table = [line(HEADS), line(["---"] * len(HEADS)), *(line(row) for row in rows_of(comparison))]
    notes = [f"- {note}" for note in remarks(comparison)]
    parts = [f"# {comparison.robot} in other engines", f"{head(comparison)}.", "\n".join(table), *EXPLAINED]
    return "\n\n".join([*parts, "\n".join(notes)] if notes else parts) + "\n"


#: What the columns mean, for the pages.
EXPLAINED = (
    "A closure is *held* if the engine's accelerations keep it closed, *softened* if they open it more "
    "slowly than the robot without closures, and *ignored* if they open it as that robot does. Efforts are "
    "the inverse dynamics on the freedoms that the closures leave. The drift is the largest closure residual "
    "while the robot falls from rest for a second, over the length of its module. Friction, springs, rotors, "
    "limits and contacts are switched off.",
)


def as_html(comparison: Comparison) -> str:
    """Write the comparison as a page of HTML that needs no other file."""

    def line(cells: Sequence[str], tag: str) -> str:
        """Write a row of the table."""
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    title = html.escape(f"{comparison.robot} in other engines")
    table = "\n".join([line(HEADS, "th"), *(line(row, "td") for row in rows_of(comparison))])
    notes = "\n".join(f"<li>{html.escape(note)}</li>" for note in remarks(comparison))
    text = "\n".join(f"<p>{html.escape(part.replace('*', ''))}</p>" for part in EXPLAINED)
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>\n'
        "<style>body{font-family:sans-serif;max-width:70em;margin:2em auto}table{border-collapse:collapse}"
        "td,th{border:1px solid #bbb;padding:.3em .6em;text-align:left}</style></head>\n"
        f"<body><h1>{title}</h1>\n<p>{html.escape(head(comparison))}.</p>\n<table>\n{table}\n</table>\n"
        f"{text}\n<ul>\n{notes}\n</ul></body></html>\n"
    )


#: Writers of pages by their endings.
WRITERS: dict[str, Callable[[Comparison], str]] = {".md": as_markdown, ".html": as_html}


def check_page(path: str) -> None:
    """Check that a page can be written, before any work is done.

    Raises:
        ModelError: Its ending is neither `.md` nor `.html`, or its folder does not exist.
    """
    file = Path(path)
    if file.suffix.lower() not in WRITERS:
        known = " or ".join(WRITERS)
        raise ModelError(f"the page ends in '{file.suffix}'; it is written as {known}", file=path)
    if not file.parent.is_dir():
        raise ModelError("its folder does not exist", file=path)


def write_page(comparison: Comparison, path: str) -> None:
    """Write the comparison as a page, in the format of the file's ending.

    Raises:
        ModelError: As in `check_page`.
        OSError: The file cannot be written.
    """
    check_page(path)
    write_text(path, WRITERS[Path(path).suffix.lower()](comparison))
