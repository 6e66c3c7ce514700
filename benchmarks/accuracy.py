"""Both models: error against time, size of batches and number of threads, on the same states in one run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

import hybridyn
from benchmarks.cases import case_of
from benchmarks.peers import methods_of
from benchmarks.peers.ours import COMPILED, compiled
from benchmarks.reference import Reference, floor, refer, refuse
from benchmarks.results import CHECK, GOOD, NAN, Row
from benchmarks.timing import LEAST, Candidate, interleaved, measured, timed
from hybridyn import HybridRobot
from hybridyn.spatial import Index
from hybridyn.studies.compare.methods import (
    MODELS,
    Method,
    Model,
    Setting,
    Solver,
    State,
    each,
    swept,
    written,
)
from hybridyn.studies.compare.peer_engine import NotComparableError

#: Velocities: beyond, closing loops in long double takes minutes.
MOST_CLOSED = 100
#: Peers that are called in a loop where batches are compared.
LOOPED = ("pin.constraintDynamics", "pin.lcaba", "pin.rnea, loops open")
SWEEP_ROUNDS, ROUNDS = 3, 7
#: One setting for each peer that is swept, where only one is measured: what reaches 1e-10 up to 16 modules,
#: or comes nearest.
SETTINGS: dict[str, Setting] = {
    "pin.constraintDynamics": {"mu": 1e-8, "iterations": 2},
    "pin.lcaba": {"mu": 1e-2, "iterations": 10},
    "MuJoCo": {"impedance": 0.9999, "iterations": 5},
}
#: Whose cold calls are measured; with accelerations given, Pinocchio has the projection alone.
COLD = (COMPILED, "pin.lcaba", "pin.constraintDynamics", "pin.rnea + projection, dense")
#: Robots, number of cold calls, and bytes that are touched between two.
COLD_ROBOTS, COLD_CALLS, TOUCHED = ("lx4", "five_bar"), 300, 40_000_000


@dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes:
        judged: States whose answers are compared with the reference, and cycled through by single calls.
        batches: Samples per call of the methods that take many; the last is the largest.
        threads: Numbers of threads.
        rounds: Measurements of each call.
        sweep: Every how many settings of a sweep are taken.
        looped: Whether some peers at their cheapest setting are called in a loop for every batch, and others
            are left out.
        least: Shortest measurement [s].
    """

    judged: int = 4
    batches: tuple[int, ...] = (1, 1_000)
    threads: tuple[int, ...] = (1,)
    rounds: int = ROUNDS
    sweep: int = 1
    looped: bool = False
    least: float = LEAST


#: Of batches and threads. A measurement is long, so that threads spread over cores. There are many, the best
#: of which counts, for everybody: threads wait for the slowest of them, so a neighbour that takes a core for
#: a moment shows there first.
BATCHES = Effort(2, (1, 10, 100, 1_000, 10_000), (1, 2, 4), rounds=9, looped=True, least=0.1)


class Problem(NamedTuple):
    """A model to compute, at some states.

    Attributes:
        case: Name of the robot.
        robot: The robot.
        model: Which model.
        states: q, v and what is given (tau or a), arrays over the batch.
        judged: Numbers of the states that have references.
        reference: Their answers.
    """

    case: str
    robot: HybridRobot
    model: Model
    states: State
    judged: Index
    reference: Reference

    @property
    def singles(self) -> list[State]:
        """Return the judged states one by one."""
        return [*zip(*(x[self.judged] for x in self.states), strict=True)]

    def off(self, solve: Solver, *, batches: bool) -> float:
        """Return the error of a solver at the judged states, from one call for all states or one for each."""
        return self.reference.off(
            solve(*self.states)[self.judged] if batches else np.array(each(solve, self.singles))
        )


def posed(case: str, model: Model, effort: Effort) -> Problem:
    """Load a robot, take states of its motion, compute the reference at some."""
    own = case_of(case)
    robot = own.load()
    q, v, a = own.states(robot, effort.batches[-1])
    given = a if model == "idm" else hybridyn.idm(robot, q, v, a)
    judged: Index = np.linspace(0, len(q) - 1, effort.judged).astype(int)
    reference = refer(robot, model, q[judged], v[judged], given[judged])
    return Problem(case, robot, model, (q, v, given), judged, reference)


def checks(problem: Problem) -> Iterator[Row]:
    """State how good the reference is."""
    case, model, reference = problem.case, problem.model, problem.reference
    what = f"{model}: the reference ({reference.kind}), its own error"
    yield Row(case, CHECK, setting=what, error=reference.error)
    if model == "ddm" and problem.robot.nv <= MOST_CLOSED:
        moved = floor(problem.robot, *problem.singles[0])
        yield Row(case, CHECK, setting="ddm: what rounding the state moves the answer by", error=moved)


def measure(model: Model, case: str, effort: Effort) -> list[Row]:
    """Measure every method on a robot.

    Raises:
        WrongModelError: hybridyn's own answer is off.
    """
    problem = posed(case, model, effort)
    out = list(checks(problem))
    candidates: list[Candidate] = []
    for method in methods_of(model):
        if effort.looped and not method.name.startswith(("hybridyn", *LOOPED)):
            continue
        try:
            found = list(candidates_of(method, problem, effort))
        except NotComparableError as why:
            out.append(Row(case, model, method.name, note=str(why)))
            continue
        if method.name.startswith("hybridyn"):
            for row, _, _ in found:
                what = f"{model} by {method.name}, {row.batch} samples"
                refuse(row.error, method.limit, f"{what} of {case}")
                out.append(Row(case, CHECK, setting=what, error=row.error, limit=method.limit))
        candidates += found
    return out + measured(candidates, effort.rounds, effort.least, warm=effort.looped)


def candidates_of(method: Method, problem: Problem, effort: Effort) -> Iterator[Candidate]:
    """Give the calls of a method: at each setting, one sample at a time and in batches if it takes them.

    Raises:
        NotComparableError: It cannot do this robot.
    """
    in_loop = effort.looped and not method.batches
    settings = (cheapest(method, problem, effort),) if in_loop else method.settings[:: effort.sweep]
    method = replace(method, settings=settings)
    sizes = effort.batches if in_loop or method.batches else (1,)
    for threads in effort.threads if method.threads else (1,):
        for one in swept(method, problem.robot, problem.states, problem.judged, sizes, threads):
            row = Row(problem.case, problem.model, method.name, written(one.setting), threads=threads)
            batch = 1 if one.single else one.samples
            error = problem.off(one.solve, batches=method.batches and not one.single)
            yield Candidate(row._replace(batch=batch, error=error), one.samples, one.call)


def cheapest(method: Method, problem: Problem, effort: Effort) -> Setting:
    """Return the setting that reaches `GOOD` in the least time, or the most accurate one where none does."""
    method = replace(method, settings=method.settings[:: effort.sweep])
    calls = [*swept(method, problem.robot, problem.states, problem.judged)]
    errors = [problem.off(one.solve, batches=False) for one in calls]
    good = [one for one, error in zip(calls, errors, strict=True) if error <= GOOD]
    if not good:
        return calls[int(np.argmin(errors))].setting
    times = interleaved([one.call for one in good], SWEEP_ROUNDS)
    return good[times.index(min(times))].setting


def cold(case: str, calls: int = COLD_CALLS) -> list[Row]:
    """Measure single calls of both models after other memory was touched, beside such calls in a row.

    Before each call every line of a block of memory is read and written that is larger than the caches; so
    code and data of the call come from memory.

    Args:
        case: The robot.
        calls: Number of cold calls, of which the median is given.
    """
    block: Any = np.zeros(TOUCHED, dtype=np.uint8)
    out, size = [], compiled(case_of(case).load()).library.built.path.stat().st_size
    effort = Effort(judged=1, batches=(1,))
    for model in MODELS:
        problem = posed(case, model, effort)
        for method in (one for one in methods_of(model) if one.name in COLD):
            method = replace(method, settings=(SETTINGS.get(method.name, {}),))
            try:
                (hot,) = candidates_of(method, problem, effort)
            except NotComparableError as why:
                out.append(Row(case, model, method.name, note=str(why)))
                continue
            times = []
            for _ in range(calls):
                block[::64] += 1
                times.append(timed(hot.call, 1))
            (row,) = measured([hot], ROUNDS)
            row = row._replace(median=1e6 * float(np.median(times)), unit="bytes of code")
            out.append(row._replace(value=size if method.name == COMPILED else NAN))
    return out
