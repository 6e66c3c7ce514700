"""Judge an engine in every way in which it can take a robot, some in processes of their own."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator

from ...spatial import Array
from ...structure.robot import HybridRobot
from .apart import judged_apart
from .engine import NotComparableError, Way
from .judging import Verdict, judge
from .own_file import OwnFile
from .states import State

Ways = Callable[[HybridRobot, OwnFile], Iterator[Way]]

#: Engines, with the format of the robot's file ("" for any), that are judged in processes of their own:
#: Newton prints, Drake's libraries do not bear Pinocchio's, and Pinocchio's reader of MJCF may crash.
APART = {("drake", ""), ("newton", ""), ("pinocchio", "MJCF")}


def judge_engine(
    robot: HybridRobot,
    own: OwnFile,
    states: list[State],
    names: tuple[str, str],
    tolerance: float,
    start: Array | None,
) -> list[Verdict]:
    """Judge every way into an engine."""
    apart = {(names[0], ""), (names[0], own.format)} & APART
    out = []
    for number, (way, _) in enumerate(_ways(names[0])(robot, own)):
        task = (number, robot, own, states, names, tolerance, start)
        out.append(judged_apart(names, way, task) if apart else judge_way(*task))
    return out


def judge_way(
    number: int,
    robot: HybridRobot,
    own: OwnFile,
    states: list[State],
    names: tuple[str, str],
    tolerance: float,
    start: Array | None,
) -> Verdict:
    """Judge one way into an engine; a refusal becomes part of the verdict."""
    words, build = list(_ways(names[0])(robot, own))[number]
    try:
        engine = build()
    except NotComparableError as error:
        return Verdict(*names, words, refusal=str(error))
    try:
        return judge(robot, engine, states, names, tolerance, start)
    except (NotComparableError, RuntimeError, ValueError, ArithmeticError) as error:
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        return Verdict(*names, engine.way, refusal=reason, notes=engine.notes)


def _ways(name: str) -> Ways:
    ways: Ways = importlib.import_module(f"{__package__}.engines.{name}_engine").ways
    return ways
