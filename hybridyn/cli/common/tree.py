"""The tree of modules as text."""

import sys
import textwrap
from collections.abc import Iterator, Sequence

from ...figures.module_tree import Card
from ...structure.robot import HybridRobot
from .text import NARROWEST, counted

#: Width of a label such as "closures  " [characters].
LABEL = 10


def head(robot: HybridRobot) -> Iterator[str]:
    """Yield the lines above the tree: name, base, freedoms, joints and motors."""
    description = robot.description
    yield f"{robot.name} ({description.source})"
    free = counted(robot.mobility, "freedom")
    base = {"fixed": "fixed", "moving": "moving (prescribed)", "floating": "floating"}[robot.base]
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
        first, *rest = _wrapped("", "", f"{card.title}  {card.what}", width)
        yield f"{indent}{last if is_last else branch}{first}"
        yield from (f"{inner}{line}" for line in rest)
        for label, text in card.facts:
            yield from _wrapped(inner + (bar if number in ends else "   "), label, text, width)


def _wrapped(indent: str, label: str, text: str, width: int) -> list[str]:
    """Break a text into lines behind an indent and a label."""
    return [
        line.replace("\u00a0", " ")
        for line in textwrap.wrap(
            text,
            max(width - len(indent), NARROWEST) + len(indent),
            initial_indent=indent + (label.ljust(LABEL) if indent else ""),
            subsequent_indent=indent + " " * LABEL,
            break_long_words=False,
            break_on_hyphens=False,
        )
    ]
