"""Chunks of a sweep in processes that keep compiled models, and the choice of what is compiled."""

from __future__ import annotations

import time
from dataclasses import replace
from uuid import uuid4

import numpy as np

from ...description.urdf.xacro_process import keep_child
from ...errors import HybridynError, ModelError
from ...linkage.threads import one_thread
from ...spatial import Array, Index
from ...structure.parameters.slots import Slot, differences
from .compiled_designs import CompiledDesigns, Plan, check_task
from .designs import Designs
from .evaluation import Chunk, Designer, Evaluated, evaluate
from .study_file import StudyFile

#: Fewest designs of a study for which models are compiled, which takes as long as some ten to a hundred.
LEAST_DESIGNS = 200

#: Designs that are compared with robots built for them: one in this many, and at most so many in all.
CHECKED_SHARE, MOST_CHECKED = 10, 1000

#: The models of the last run, by its identity.
_kept: dict[str, CompiledDesigns] = {}


def models_of(source: StudyFile, plan: Plan) -> CompiledDesigns:
    """Return the models of a run, which each process builds once.

    Raises:
        HybridynError: The models cannot be built.
    """
    if plan.run not in _kept:
        _kept.clear()
        _kept[plan.run] = CompiledDesigns(source, plan)
    return _kept[plan.run]


@one_thread()
def evaluate_chunk(source: StudyFile, chunk: Chunk, plan: Plan | None) -> Evaluated:
    """Evaluate the designs of a chunk. Nothing of a design depends on the others.

    Args:
        plan: What is compiled; None for the general path.

    Raises:
        ModelError: A Python file of the study fails.
        HybridynError: This process cannot build the compiled models, or a design differs from the general
            path.
    """
    if plan is None:
        return evaluate(source, chunk)
    keep_child()  # each design expands its own file
    models = models_of(source, plan)
    started = time.perf_counter()
    with np.errstate(all="ignore"):  # overflow shows in the results
        found = models.rows(chunk)
    return replace(found, seconds=time.perf_counter() - started)


def plan_for(source: StudyFile, designs: Designs, numbers: Index) -> tuple[Plan | None, str]:
    """Choose what is compiled for a study, and compile it.

    The choice depends on the study alone, so that a run that continues makes the same.

    Args:
        numbers: Numbers of some designs, spread over the study.

    Returns:
        The plan; or None, and why there are no compiled models.
    """
    if designs.count < LEAST_DESIGNS:
        return None, ""
    keep_child()  # each design expands its own file
    values = [designs.values(number, number + 1)[0] for number in numbers.tolist()]
    try:
        plan = _plan(source, designs, values)
        models = models_of(source, plan)
    except HybridynError as error:
        return None, str(error)
    slotted = models.numbers(np.array(values))
    tables = models.tables(slotted.p) if slotted.possible.any() else []
    if not tables or not np.logical_and.reduce([table.good for table in tables]).any():
        return None, f"compiled models are certain of none of {len(values)} designs"
    return plan, ""


def _plan(source: StudyFile, designs: Designs, values: list[Array]) -> Plan:
    """Find the numbers that differ between designs with some values of the parameters."""
    for name, task in source.study.tasks.items():
        check_task(name, task)
    designer = Designer(source)
    base = next((own for own in values if designer(0, own).status == "ok"), None)
    if base is None:
        raise ModelError(f"none of {len(values)} designs, spread over the study, can make its motions")
    variants = designer.variants
    description = variants.description(variants.named(base))
    slots: set[Slot] = set()
    for own in values:
        try:
            slots |= set(differences(description, variants.description(variants.named(own))))
        except HybridynError:  # no robot, or of another structure
            continue
    check = source.study.designs.check
    if check is None:
        check = min(MOST_CHECKED, -(-designs.count // CHECKED_SHARE))
    count = designs.count
    return Plan(uuid4().hex, base, tuple(sorted(slots)), count, min(check, count))
