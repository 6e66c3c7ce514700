"""Goals and what was reached, as tables of the report."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from benchmarks.goals import Goal, ProgramGoal, goals, program_goals
from benchmarks.tables import number, table
from benchmarks.texts import PROGRAMS, REACHED

Results = dict[str, list[Any]]


def reached(results: Results) -> Iterator[str]:
    """Write the goals of the models, and those of what stands around them."""
    yield "## Speed goals of the compiled path\n"
    yield "Ratios of times, hybridyn over the peer; those of the general path are shown for comparison.\n"
    rows = [_of_models(goal) for goal in goals(results)]
    yield table(["case", "against", "goal", "compiled", "", "general", "peer"], rows)
    if rows := [_of_programs(goal) for goal in program_goals(results)]:
        yield REACHED
        yield table(["case", "what", "goal", "reached", ""], rows)


def _of_models(goal: Goal) -> list[str]:
    limit = f"at least {goal.goal:g}" if goal.at_least else f"at most {goal.goal:.3g}"
    compiled, general = (number(value) for value in goal.measured)
    return [goal.case, goal.against, limit, compiled, goal.verdict(0), general, goal.peer]


def _of_programs(goal: ProgramGoal) -> list[str]:
    limit = f"at {'least' if goal.at_least else 'most'} {goal.goal:.3g} {goal.unit}".rstrip()
    return [goal.case, goal.what, limit, number(goal.value), goal.verdict()]


def around(results: Results) -> Iterator[str]:
    """Write what a user's program waits for around the models."""
    yield PROGRAMS
    rows = [[r.case, r.program, r.what, number(r.value), r.unit] for r in results["programs"]]
    yield table(["robot", "program", "what", "", ""], rows)
