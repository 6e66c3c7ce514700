"""`hybridyn check`: report what looks wrong in a model."""

from __future__ import annotations

import json
import shutil
import textwrap
from collections import Counter
from collections.abc import Iterator
from typing import TYPE_CHECKING

import click

from .common.options import RobotChoice, RobotCommand
from .common.text import counted

if TYPE_CHECKING:
    from ..studies.check.check import Finding

#: Limits of the width of text [characters].
NARROWEST, WIDEST = 40, 110
FOUND, UNREADABLE = 1, 2  # exit status
SEVERITIES = ("error", "warning", "note")
COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}
#: Number of findings of one code that are printed; the rest are counted.
PRINTED = 12


def _codes(ctx: click.Context, param: click.Parameter, value: str | None) -> frozenset[str]:
    """Split codes at commas, and check that they are known."""
    from ..description.names import did_you_mean
    from ..studies.check.check import CODES

    names = [name.strip() for name in (value or "").split(",") if name.strip()]
    for name in names:
        if name not in CODES:
            raise click.BadParameter(f"there is no finding '{name}'{did_you_mean(name, CODES)}", ctx, param)
    return frozenset(names)


@click.command("check", cls=RobotCommand, short_help="Find mistakes in a model, and how to correct them.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON on standard output.")
@click.option(
    "--fail-on",
    type=click.Choice([*SEVERITIES, "never"]),
    default="error",
    show_default=True,
    help="Exit with status 1 if there is a finding of this severity or above.",
)
@click.option("--ignore", metavar="CODE,...", callback=_codes, help="Codes of findings to leave out.")
@click.option("--no-meshes", is_flag=True, help="Do not search or load mesh files.")
@click.option(
    "--all", "everything", is_flag=True, help=f"Print more than {PRINTED} findings of one code each."
)
def command(
    load: RobotChoice, as_json: bool, fail_on: str, ignore: frozenset[str], no_meshes: bool, everything: bool
) -> int:
    """Check ROBOT (URDF, MJCF, SDF, USD): impossible inertias, open loops, motors that move nothing.

    Each finding states a code, a severity, the element with its line, why it matters and how to correct it.
    An error means that results are wrong or cannot be computed; a warning that they are probably wrong; a
    note only informs. For xacro, the line is the one that generates the element. docs/check.md lists all
    codes.

    Exit status: 0 no finding at or above --fail-on; 1 at least one; 2 the file cannot be read.
    """
    from ..studies.check.check import check, is_readable

    found = check(
        load.robot,
        motors=load.motors,
        xacro_args=load.xacro_args or None,
        package_dirs=load.package_dirs,
        rank_tolerance=load.rank_tolerance,
        closure_tolerance=load.closure_tolerance,
        meshes=not no_meshes,
    )
    fail_on = "note" if load.strict else fail_on
    readable = is_readable(found)
    found = [finding for finding in found if finding.code not in ignore]
    if as_json:
        click.echo(json.dumps([_facts(finding) for finding in found], indent=2))
    else:
        width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
        for line in _lines(found, width, everything):
            click.echo(line)
        click.echo(_tally(load.robot, found))
    if not readable:
        return UNREADABLE
    failing = SEVERITIES[: SEVERITIES.index(fail_on) + 1] if fail_on != "never" else ()
    return FOUND if any(finding.severity in failing for finding in found) else 0


def _facts(finding: Finding) -> dict[str, object]:
    return {
        "code": finding.code,
        "severity": finding.severity,
        "element": finding.element or None,
        "file": finding.file,
        "line": finding.line,
        "message": finding.message,
        "why": finding.why,
        "mend": finding.mend,
    }


def _lines(found: list[Finding], width: int, everything: bool) -> Iterator[str]:
    """Yield the findings as lines of text, grouped by code."""
    groups: dict[str, list[Finding]] = {}
    for finding in found:
        groups.setdefault(finding.code, []).append(finding)
    for code, group in groups.items():
        shown = group if everything else group[:PRINTED]
        for number, finding in enumerate(shown):
            place = f"{finding.place}: " if finding.place else ""
            subject = f"{finding.element}: " if finding.element else ""
            severity = click.style(finding.severity, fg=COLOURS[finding.severity], bold=True)
            yield f"{place}{severity} [{code}]"
            yield from _wrapped(f"{subject}{finding.message}", width)
            if number == 0:  # the reason is the same for all findings of a code
                yield from _wrapped(f"why: {finding.why}", width)
            if number == 0 or finding.mend != shown[number - 1].mend:
                yield from _wrapped(f"mend: {finding.mend}", width)
        if len(group) > len(shown):
            yield f"  ... and {len(group) - len(shown)} more [{code}]: see them with --all"
        yield ""


def _wrapped(text: str, width: int) -> list[str]:
    return textwrap.wrap(
        text,
        width,
        initial_indent="  ",
        subsequent_indent="    ",
        break_long_words=False,
        break_on_hyphens=False,
    )


def _tally(robot: str, found: list[Finding]) -> str:
    counts = Counter[str](finding.severity for finding in found)
    parts = [counted(counts[level], level) for level in SEVERITIES if counts[level]]
    return f"{robot}: {', '.join(parts) or 'nothing looks wrong'}"
