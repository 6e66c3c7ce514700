"""Both models, error against time: every method at every setting, on the same states, in one run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

import hybridyn
from benchmarks.cases import case_of
from benchmarks.gate import refuse
from benchmarks.methods import Method, Model, NotMeasuredError, Setting, Solver, written
from benchmarks.peers import methods_of
from benchmarks.reference import Reference, floor, refer
from benchmarks.results import Check, Point
from benchmarks.timing import Time, interleaved
from hybridyn import HybridRobot
from hybridyn.spatial import Array

NAN = math.nan
#: Velocities: beyond, closing loops in long double takes minutes.
MOST_CLOSED = 100


@dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes:
        judged: States whose answers are compared with the reference, and cycled through by single calls.
        batch: Samples per call of the methods that take many.
        rounds: Measurements of each call.
        sweep: Every how many settings of a sweep are taken.
    """

    judged: int = 4
    batch: int = 1_000
    rounds: int = 7
    sweep: int = 1


class Problem(NamedTuple):
    """A model to compute, at some states.

    Attributes:
        robot: The robot.
        model: Which model.
        states: q, v and what is given (tau or a), arrays over the batch.
        judged: Numbers of the states that have references.
        reference: Their answers.
    """

    robot: HybridRobot
    model: Model
    states: tuple[Array, Array, Array]
    judged: Array
    reference: Reference

    @property
    def singles(self) -> list[tuple[Array, Array, Array]]:
        """Return the judged states one by one."""
        q, v, given = self.states
        return [(q[i].copy(), v[i].copy(), given[i].copy()) for i in self.judged]


class Candidate(NamedTuple):
    """A call to be timed, with what is known of it."""

    method: str
    setting: Setting
    batch: int
    error: float
    call: Callable[[], object]
    samples: int


def posed(case: str, model: Model, effort: Effort) -> Problem:
    """Load a robot, take states of its motion, compute the reference at some."""
    own = case_of(case)
    robot = own.load()
    q, v, a = own.states(robot, effort.batch)
    given = a if model == "idm" else hybridyn.idm(robot, q, v, a)
    judged = np.linspace(0, len(q) - 1, effort.judged).astype(int)
    reference = refer(robot, model, q[judged], v[judged], given[judged])
    return Problem(robot, model, (q, v, given), judged, reference)


def checks(case: str, problem: Problem) -> Iterator[Check]:
    """State how good the reference is."""
    kind, model = problem.reference.kind, problem.model
    yield Check(case, f"{model}: the reference ({kind}), its own error", problem.reference.error, NAN)
    if model == "ddm" and problem.robot.nv <= MOST_CLOSED:
        moved = floor(problem.robot, *problem.singles[0])
        yield Check(case, "ddm: what rounding the state moves the answer by", moved, NAN)


def measure(model: Model, case: str, effort: Effort) -> list[Check | Point]:
    """Measure every method on a robot.

    Raises:
        WrongModelError: hybridyn's own answer is off.
    """
    problem = posed(case, model, effort)
    out: list[Check | Point] = list(checks(case, problem))
    candidates: list[Candidate] = []
    for method in methods_of(model):
        try:
            found = list(candidates_of(method, problem, effort))
        except NotMeasuredError as why:
            out.append(Point(model, case, method.name, "", 0, 0, NAN, NAN, NAN, str(why)))
            continue
        if method.name.startswith("hybridyn"):
            for one in found:
                what = f"{model} by {method.name}, {one.batch} samples"
                refuse(one.error, method.limit, f"{what} of {case}")
                out.append(Check(case, what, one.error, method.limit))
        candidates += found
    times = interleaved([one.call for one in candidates], effort.rounds)
    return out + [point(model, case, one, time) for one, time in zip(candidates, times, strict=True)]


def point(model: Model, case: str, one: Candidate, time: Time) -> Point:
    """Write a timed call as a row."""
    us = 1e6 / one.samples
    setting = written(one.setting)
    return Point(
        model, case, one.method, setting, one.batch, 1, one.error, us * time.least, us * time.median, ""
    )


def candidates_of(method: Method, problem: Problem, effort: Effort) -> Iterator[Candidate]:
    """Give the calls of a method: one sample at a time at each setting, and the whole batch if it takes one.

    Raises:
        NotMeasuredError: It cannot do this robot.
    """
    at, reference = method.prepare(problem.robot), problem.reference
    singles = problem.singles
    for setting in method.settings[:: effort.sweep]:
        solve = at(setting)
        error = reference.off(np.array([solve(*state) for state in singles]))
        yield Candidate(method.name, setting, 1, error, one_by_one(solve, singles), len(singles))
        if method.batches:
            error = reference.off(solve(*problem.states)[problem.judged])
            size = len(problem.states[0])
            yield Candidate(method.name, setting, size, error, together(solve, problem.states), size)


def one_by_one(solve: Solver, states: Sequence[tuple[Array, Array, Array]]) -> Callable[[], object]:
    """Call a solver with one state after the other."""

    def call() -> None:
        for q, v, given in states:
            solve(q, v, given)

    return call


def together(solve: Solver, states: tuple[Array, Array, Array]) -> Callable[[], object]:
    """Call a solver with all states at once."""
    return lambda: solve(*states)
