"""Chunks of a sweep with gradients, in processes that keep the models of one design."""

from __future__ import annotations

import time
from typing import NamedTuple
from uuid import uuid4

import numpy as np

from ...spatial import Array
from ...threads import one_thread
from .evaluation import Chunk, Evaluated
from .gradients import StudyGradients
from .study_file import StudyFile


class GradientPlan(NamedTuple):
    """What the processes of one run need for the same models.

    Attributes:
        run: Identity of the run.
        base: Values of the design whose models are kept, shape (parameters,).
    """

    run: str
    base: Array


#: The evaluation of the last run, by its identity.
_kept: dict[str, StudyGradients] = {}


def plan_of(study: StudyGradients) -> GradientPlan:
    """Return the plan of a run whose first design loads, and keep its models in this process."""
    assert study.base is not None
    plan = GradientPlan(uuid4().hex, study.base)
    _keep(plan, study)
    return plan


def _keep(plan: GradientPlan, study: StudyGradients) -> None:
    """Keep the models of a run instead of those of the last one."""
    _kept.clear()
    _kept[plan.run] = study


@one_thread()
def evaluate_with_gradients(source: StudyFile, chunk: Chunk, plan: GradientPlan) -> Evaluated:
    """Evaluate the designs of a chunk with their gradients. Nothing of a design depends on the others.

    Raises:
        HybridynError: This process cannot build the models.
    """
    if plan.run not in _kept:
        study = StudyGradients(source)
        study.prepare(plan.base)
        _keep(plan, study)
    started = time.perf_counter()
    with np.errstate(all="ignore"):  # overflow shows in the results
        rows = tuple(_kept[plan.run].row(chunk.start + k, own) for k, own in enumerate(chunk.values))
    return Evaluated(rows, time.perf_counter() - started)
