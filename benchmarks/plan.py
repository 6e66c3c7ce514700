"""Which points are measured, in the short and in the full run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from benchmarks.measure import gate, in_own_process, main_job, model_cost
from benchmarks.results import Result


@dataclass(frozen=True)
class Plan:
    """A run.

    Attributes:
        checked: Numbers of modules at which the models are compared with the oracle.
        modules: Numbers of modules whose cost is measured.
        samples: Samples per call.
        repeats: Timed calls.
        jobs: Rows and cores of each main job.
    """

    checked: tuple[int, ...]
    modules: tuple[int, ...]
    samples: int
    repeats: int
    jobs: tuple[tuple[int, int], ...]


SHORT = Plan((1,), (1, 2, 4, 8), 32, 1, ((1_000, 2),))
FULL = Plan(
    (1, 4), (1, 2, 4, 8, 16, 32, 64), 500, 2, ((10_000, 1), (10_000, 2), (10_000, 4), (1_000, 2), (40_000, 2))
)


def run(plan: Plan) -> Iterator[Result]:
    """Give results as they come, the gate first.

    Raises:
        WrongModelError: A model is wrong; nothing after it is measured.
    """
    for modules in plan.checked:
        yield from in_own_process(gate, modules)
    for modules in plan.modules:
        yield from in_own_process(model_cost, modules, plan.samples, plan.repeats)
    for rows, cores in plan.jobs:
        yield from main_job(rows, cores)
