"""`hybridyn info`: show the tree of modules, and what looks wrong in the files."""

import json
import shutil
import sys
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict

import click

from ..errors import HybridynError
from ..figures.module_tree import NO_BREAK, Card, cards
from ..figures.structure import figure_of_cards
from ..structure.robot import HybridRobot
from ..studies.branch import branch
from ..studies.check.check import Finding, check, is_readable
from ..studies.check.loops import home_residuals
from .common.figures import save
from .common.options import Grid, RobotChoice, refuse
from .common.text import counted
from .words.robots import PRINTED

#: Exit status where a finding has the severity of --fail-on.
FOUND = 1
SEVERITIES = ("error", "warning", "note")
#: Limits of the width of text [characters]: terminals may be tiny, and wide text is hard to read.
NARROWEST, WIDEST = 40, 110
#: Points between the limits of each output joint.
POINTS = 9
#: Width of a label such as "closures  " [characters].
LABEL = 10
LETTERS = "R revolute or continuous, P prismatic, H screw, S spherical, E planar, F floating; * motor"
COLOURS = {"error": "red", "warning": "yellow", "note": "cyan"}


def run(
    load: RobotChoice,
    fail_on: str,
    ignore: tuple[str, ...],
    everything: bool,
    no_meshes: bool,
    as_json: bool,
    plot: str | None,
    joints: Sequence[str] | None,
    actuators: str | None,
    grid: Grid | None,
) -> int:
    """Show a robot and the findings, or its motors at output joints, and return the exit status."""
    refuse(((joints is None) != (actuators is None), "--joints and --actuators belong together"))
    refuse((grid is not None and joints is None, "--grid belongs to --joints"))
    if joints is not None and actuators is not None:
        from .common.maps import tell_actuators

        tell_actuators(load(), joints, grid or POINTS, actuators)
        return 0
    robot, problem = None, None
    try:
        robot = load(ranks=True)
    except HybridynError as error:
        problem = error
    found = check(
        load.robot, robot, motors=load.motors, xacro_args=load.xacro_args or None,
        package_dirs=load.package_dirs, rank_tolerance=load.rank_tolerance,
        closure_tolerance=load.closure_tolerance, meshes=not no_meshes,
    )  # fmt: skip
    if problem is not None and not as_json and (load.strict or not is_readable(found)):
        raise problem
    found = [finding for finding in found if finding.code not in ignore]
    singular = {one.element.partition("'")[2][:-1] for one in found if one.code.startswith("singular")}
    tree = [] if robot is None else cards(robot, home_residuals(robot), singular)
    if as_json:
        facts = [asdict(one) | {"element": one.element or None, "severity": one.severity} for one in found]
        click.echo(json.dumps(facts, indent=2))
    else:
        width = min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)
        if robot is not None:
            click.echo("\n".join(_tree(robot, tree, width)))
        click.echo("\n".join([*_findings(found, width, everything), f"{load.robot}: {_tally(found)}"]))
    if problem is not None:
        raise problem
    if plot:
        save(figure_of_cards(tree), plot)
    failing = SEVERITIES[: SEVERITIES.index(fail_on) + 1] if fail_on != "never" else ()
    return FOUND if any(finding.severity in failing for finding in found) else 0


def _tree(robot: HybridRobot, tree: Sequence[Card], width: int) -> Iterator[str]:
    """Yield the lines on a robot: what it is, its modules, and the letters that they use."""
    for told in (*_head(robot), *branch(robot)):
        yield from _wrapped(told, width, "")
    yield from ("", *lines(tree, width), "", LETTERS, "")


def _tally(found: Sequence[Finding]) -> str:
    """Return the numbers of findings by severity, in words."""
    counts = Counter[str](finding.severity for finding in found)
    parts = [counted(counts[level], level) for level in SEVERITIES if counts[level]]
    return ", ".join(parts) or "nothing looks wrong"


def _wrapped(text: str, width: int, first: str = "  ", others: str = "    ") -> list[str]:
    """Break a text into lines, which do not divide words and begin with an indent."""
    broken = textwrap.wrap(
        text, width, initial_indent=first, subsequent_indent=others, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip
    return [line.replace(NO_BREAK, " ") for line in broken]


def _head(robot: HybridRobot) -> Iterator[str]:
    """Yield the lines above the tree: name, base, freedoms, joints and motors."""
    description = robot.description
    yield f"{robot.name} ({description.source})"
    free = counted(robot.mobility, "freedom")
    base = "moving (prescribed)" if robot.base == "moving" else robot.base
    yield f"base '{description.root}' {base}; {counted(len(robot.modules), 'module')}; {free}"
    joints = sum(joint.kind != "fixed" for joint in description.joints)
    motors = counted(len(robot.motors), "motor")
    yield f"{counted(joints, 'movable joint')} (nq {robot.nq}, nv {robot.nv}), {motors}"
    rule = f" (from {description.motors_from})" if description.motors_from else ""
    yield f"motors{rule}: {', '.join(robot.motors) or 'none'}"


def lines(cards: Sequence[Card], width: int) -> Iterator[str]:
    """Yield the cards of the modules as a tree of text, from the ground outwards.

    Args:
        width: Width of a line [characters].
    """
    fancy = "utf" in (sys.stdout.encoding or "").lower()
    branch, last, bar = ("├─ ", "└─ ", "│  ") if fancy else ("|- ", "`- ", "|  ")
    ends = {card.parent: number for number, card in enumerate(cards)}  # the last card on each
    indents = {0: ""}
    yield cards[0].title
    for number, card in enumerate(cards[1:], start=1):
        assert card.parent is not None
        indent, is_last = indents[card.parent], ends[card.parent] == number
        inner = indents[number] = indent + ("   " if is_last else bar)
        first, *rest = _wrapped(f"{card.title}  {card.what}", width, "", " " * LABEL)
        yield f"{indent}{last if is_last else branch}{first}"
        yield from (f"{inner}{line}" for line in rest)
        below = inner + (bar if number in ends else "   ")
        for label, text in card.facts:
            room = max(width, NARROWEST + len(below))
            yield from _wrapped(text, room, below + label.ljust(LABEL), below + " " * LABEL)


def _findings(found: list[Finding], width: int, everything: bool) -> Iterator[str]:
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
