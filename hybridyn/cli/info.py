"""`hybridyn info`: show the tree of modules, and what looks wrong in the files."""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict

import click

from ..errors import HybridynError
from ..figures.module_tree import Card, cards
from ..figures.structure import figure_of_cards
from ..structure.robot import HybridRobot
from ..studies.check.check import Finding, check, is_readable
from ..studies.check.loops import home_residuals
from ..studies.home import branch
from .common.figures import save
from .common.options import RobotChoice
from .common.text import counted, terminal_width, wrapped
from .common.tree import head, lines
from .words import PRINTED

#: Exit status where a finding has the severity of --fail-on.
FOUND = 1
SEVERITIES = ("error", "warning", "note")
COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}


def run(
    load: RobotChoice,
    fail_on: str,
    ignore: tuple[str, ...],
    everything: bool,
    no_meshes: bool,
    as_json: bool,
    plot: str | None,
) -> int:
    """Show a robot and the findings, and return the exit status."""
    robot, problem = None, None
    try:
        robot = load(ranks=True)
    except HybridynError as error:
        problem = error
    found = check(
        load.robot,
        robot,
        motors=load.motors,
        xacro_args=load.xacro_args or None,
        package_dirs=load.package_dirs,
        rank_tolerance=load.rank_tolerance,
        closure_tolerance=load.closure_tolerance,
        meshes=not no_meshes,
    )
    if problem is not None and not as_json and (load.strict or not is_readable(found)):
        raise problem
    found = [finding for finding in found if finding.code not in ignore]
    if as_json:
        facts = [asdict(one) | {"element": one.element or None, "severity": one.severity} for one in found]
        click.echo(json.dumps(facts, indent=2))
    else:
        if robot is not None:
            _show(robot, found)
        for line in _lines(found, terminal_width(), everything):
            click.echo(line)
        click.echo(_tally(load.robot, found))
    if problem is not None:
        raise problem
    if plot and robot is not None:
        save(figure_of_cards(_cards(robot, found)), plot)
    failing = SEVERITIES[: SEVERITIES.index(fail_on) + 1] if fail_on != "never" else ()
    return FOUND if any(finding.severity in failing for finding in found) else 0


def _cards(robot: HybridRobot, found: list[Finding]) -> list[Card]:
    """Return the cards of the modules."""
    singular = {one.element.partition("'")[2][:-1] for one in found if one.code.startswith("singular")}
    return cards(robot, home_residuals(robot), singular)


def _show(robot: HybridRobot, found: list[Finding]) -> None:
    """Print the tree of modules."""
    width = terminal_width()
    for line in (*head(robot), *branch(robot)):
        click.echo("\n".join(wrapped(line, width, "")))
    click.echo()
    for line in lines(_cards(robot, found), width):
        click.echo(line)
    click.echo("\nR revolute or continuous, P prismatic, S spherical, E planar, F floating; * motor\n")


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
            yield from wrapped(f"{subject}{finding.message}", width)
            if number == 0:  # the reason is the same for all findings of a code
                yield from wrapped(f"why: {finding.why}", width)
            if number == 0 or finding.mend != shown[number - 1].mend:
                yield from wrapped(f"mend: {finding.mend}", width)
        if len(group) > len(shown):
            yield f"  ... and {len(group) - len(shown)} more [{code}]: see them with --all"
        yield ""


def _tally(robot: str, found: list[Finding]) -> str:
    counts = Counter[str](finding.severity for finding in found)
    parts = [counted(counts[level], level) for level in SEVERITIES if counts[level]]
    return f"{robot}: {', '.join(parts) or 'nothing looks wrong'}"
