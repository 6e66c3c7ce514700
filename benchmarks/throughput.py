"""Time per sample against batch size and threads, with `pin.lcaba` and `pin.rnea` in a loop beside them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.accuracy import Effort, Problem, one_by_one, posed, together
from benchmarks.gate import refuse
from benchmarks.methods import Method, Model, NotMeasuredError, Setting, Solver, written
from benchmarks.peers import methods_of
from benchmarks.results import Point
from benchmarks.timing import interleaved
from hybridyn.spatial import Array

LOOPED = {"ddm": ("pin.constraintDynamics", "pin.lcaba"), "idm": ("pin.rnea, loops open",)}
#: Error at which a swept peer's cheapest setting is taken.
GOOD = 1e-10
SWEEP_ROUNDS = 3
#: A measurement repeats a call until it takes this long [s]: threads spread over cores.
MEASURED = 0.1


@dataclass(frozen=True)
class Load:
    """What is measured.

    Attributes:
        batches: Samples per call.
        threads: Numbers of threads.
        rounds: Measurements of each call, the best of which counts, for everybody. Many: threads wait for the
            slowest of them, so a neighbour that takes a core for a moment shows there first.
    """

    batches: tuple[int, ...] = (1, 10, 100, 1_000, 10_000)
    threads: tuple[int, ...] = (1, 2, 4)
    rounds: int = 9


def measure(model: Model, case: str, load: Load) -> list[Point]:
    """Measure a robot.

    Raises:
        WrongModelError: hybridyn's own answer is off.
    """
    problem = posed(case, model, Effort(judged=2, batch=max(load.batches)))
    rows: list[tuple[str, str, int, int, float]] = []
    calls: list[Callable[[], object]] = []
    out: list[Point] = []
    for method in methods_of(model):
        try:
            for row, call in loads_of(method, problem, load):
                rows.append(row)
                calls.append(call)
        except NotMeasuredError as why:
            out.append(Point(model, case, method.name, "", 0, 0, math.nan, math.nan, math.nan, str(why)))
    for (name, setting, batch, threads, error), time in zip(
        rows, interleaved(calls, load.rounds, MEASURED, warm=True), strict=True
    ):
        us = 1e6 / batch
        out.append(
            Point(model, case, name, setting, batch, threads, error, us * time.least, us * time.median, "")
        )
    return out


def loads_of(
    method: Method, problem: Problem, load: Load
) -> Iterator[tuple[tuple[str, str, int, int, float], Callable[[], object]]]:
    """Return a method's calls: hybridyn's at every batch and number of threads, a peer's in a loop.

    Raises:
        NotMeasuredError: It cannot do this robot.
    """
    ours = method.name.startswith("hybridyn")
    if not ours and method.name not in LOOPED[problem.model]:
        return
    for threads in load.threads if method.threads else (1,):
        at = method.prepare(problem.robot, threads)
        setting = {} if ours else cheapest(at, method.settings, problem)
        solve = at(setting)
        if ours:
            error = problem.reference.off(solve(*problem.states)[problem.judged])
            refuse(error, method.limit, f"{problem.model} by {method.name} on {threads} threads")
        else:
            error = problem.reference.off(np.array([solve(*state) for state in problem.singles]))
        for batch in load.batches:
            q, v, given = (np.ascontiguousarray(x[:batch]) for x in problem.states)
            if not ours:
                call: Callable[[], object] = looped(solve, (q, v, given))
            elif batch == 1:
                call = one_by_one(solve, problem.singles[:1])
            else:
                call = together(solve, (q, v, given))
            yield (method.name, written(setting), batch, threads, error), call


def cheapest(at: Callable[[Setting], Solver], settings: tuple[Setting, ...], problem: Problem) -> Setting:
    """Return the setting that reaches `GOOD` in the least time, or the most accurate one where none does."""
    singles = problem.singles
    solvers = [at(setting) for setting in settings]
    errors = [problem.reference.off(np.array([solve(*s) for s in singles])) for solve in solvers]
    good = [i for i, error in enumerate(errors) if error <= GOOD]
    if not good:
        return settings[int(np.argmin(errors))]
    times = interleaved(
        [
            looped(solvers[i], (problem.states[0][:4], problem.states[1][:4], problem.states[2][:4]))
            for i in good
        ],
        SWEEP_ROUNDS,
    )
    return settings[min(zip(times, good, strict=True))[1]]


def looped(solve: Solver, states: tuple[Array, Array, Array]) -> Callable[[], object]:
    """Call a solver in a loop, and keep every answer, as who needs a batch must."""
    q, v, given = states

    def call() -> Array:
        return np.array([solve(*state) for state in zip(q, v, given, strict=True)])

    return call
