"""Chunks of a sweep in processes that keep compiled models, and the choice of what is compiled."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple
from uuid import uuid4

import numpy as np

from ...description.records import Description
from ...errors import HybridynError, ModelError, TrajectoryError
from ...spatial import Array, Index
from ...structure.parameters.slots import differences
from ...threads import one_thread
from .compiled_designs import CompiledDesigns, DesignPlan, Structure, check_task
from .evaluation import Chunk, Designer, DesignRow, Evaluated
from .slot_numbers import by_structure
from .study_file import StudyFile

#: Designs that are compared with robots built for them: one in this many, and at most so many in all.
CHECKED_SHARE, MOST_CHECKED = 10, 1000

#: Most structures that have compiled models; bounds the time until a process evaluates its first design.
MOST_STRUCTURES = 16
#: Designs of a structure that are tried until one can make its motions, whose robot is compiled.
TRIED_OF_STRUCTURE = 16


class ChunkModels(NamedTuple):
    """The compiled models of a run, and what evaluates the other designs."""

    designer: Designer
    plan: DesignPlan | None
    of_structures: list[CompiledDesigns]


#: The models of the last run, by its identity.
_kept: dict[str, ChunkModels] = {}


def models_of(source: StudyFile, plan: DesignPlan) -> ChunkModels:
    """Return the models of a run, which each process builds once.

    Raises:
        HybridynError: The models cannot be built.
    """
    if plan.run not in _kept:
        designer = Designer(source)
        own = [CompiledDesigns(designer, structure, plan.designs) for structure in plan.structures]
        _keep(plan, ChunkModels(designer, plan, own))
    return _kept[plan.run]


def _keep(plan: DesignPlan, models: ChunkModels) -> None:
    """Keep the models of a run instead of those of the last one."""
    _kept.clear()
    _kept[plan.run] = models


@one_thread()
def evaluate_chunk(source: StudyFile, chunk: Chunk, plan: DesignPlan | None) -> Evaluated:
    """Evaluate the designs of a chunk. Nothing of a design depends on the others.

    Args:
        plan: What is compiled; None for the general path.

    Raises:
        ModelError: A Python file of the study fails.
        HybridynError: This process cannot build the compiled models, or a design differs from the general
            path.
    """
    models = ChunkModels(Designer(source), None, []) if plan is None else models_of(source, plan)
    started = time.perf_counter()
    with np.errstate(all="ignore"):  # overflow shows in the results
        found = rows_of(models, chunk)
    return replace(found, seconds=time.perf_counter() - started)


def rows_of(models: ChunkModels, chunk: Chunk) -> Evaluated:
    """Evaluate the designs of a chunk, and compare some of them with robots built for them.

    Raises:
        HybridynError: A design differs from the general path.
    """
    rows: list[DesignRow] = []
    found = Evaluated((), 0.0)
    at_once = min((one.at_once for one in models.of_structures), default=len(chunk.values))
    for start in range(chunk.start, chunk.stop, at_once):
        values = chunk.values[start - chunk.start :][:at_once]
        wanted = set(models.plan.checks(start, start + len(values)) if models.plan else ())
        measured: dict[int, tuple[float, ...]] = {}
        left = np.arange(len(values))
        for one in models.of_structures:
            if not len(left):
                break
            own, seen = one.measured(start + left, values[left], wanted)
            measured |= {k: x for k, x in zip(left.tolist(), own, strict=True) if x is not None}
            found = replace(
                found, checked=found.checked + len(seen), difference=max([found.difference, *seen])
            )
            left = np.array([k for k in left.tolist() if k not in measured], dtype=int)
        for k, own_values in enumerate(values):
            row = DesignRow(start + k, tuple(own_values.tolist()), "ok", measured.get(k, ()), "")
            rows.append(row if k in measured else models.designer(start + k, own_values))
        found = replace(found, compiled=found.compiled + len(measured))
    return replace(found, rows=tuple(rows))


def plan_for(
    source: StudyFile, designs: Array, numbers: Index, *, asked: bool = False
) -> tuple[DesignPlan | None, str]:
    """Choose what is compiled for a study, and compile it.

    The models depend on the study alone, so that a run that continues has the same.

    Args:
        designs: Values of the parameters, shape (designs, parameters).
        numbers: Numbers of some designs, spread over the study.
        asked: Whether models are compiled even where that does not pay.

    Returns:
        The plan; or None, and why there are no compiled models, "" where compiling does not pay.
    """
    designer, own, why = Designer(source), list[CompiledDesigns](), ""
    try:
        for name, task in source.study.tasks.items():
            check_task(name, task)
        for structure, some in _structures(designer, designs[numbers]):
            try:
                models = CompiledDesigns(designer, structure, len(designs))
                if not (asked or own or models.pays):
                    return None, ""
                certain = models.certain_of_any(some)
            except (ModelError, TrajectoryError) as error:  # of this robot, or of the table with it
                why = str(error)
                continue
            if certain:
                own.append(models)
            else:
                why = f"compiled models are certain of none of {len(some)} designs"
    except HybridynError as error:
        return None, str(error)
    if not own:
        return None, why
    structures, check = tuple(one.structure for one in own), _checked_of(source, len(designs))
    plan = DesignPlan(uuid4().hex, structures, len(designs), check)
    _keep(plan, ChunkModels(designer, plan, own))
    return plan, ""


def _checked_of(source: StudyFile, count: int) -> int:
    """Return how many of a number of designs are compared with robots built for them."""
    stated = source.study.designs.check
    return min(count, min(MOST_CHECKED, -(-count // CHECKED_SHARE)) if stated is None else stated)


def _structures(designer: Designer, values: Array) -> Iterator[tuple[Structure, Array]]:
    """Yield the structures of more than one of some designs, and in any case the most frequent one.

    Args:
        values: Values of the parameters of these designs, shape (designs, parameters).

    Yields:
        The structure and the values of some of its designs; the most frequent structure first.

    Raises:
        ModelError: No robot of these designs can make its motions.
    """
    variants = designer.variants
    read: list[tuple[Array, Description]] = []
    for own in values:
        with suppress(HybridynError):  # no robot
            read.append((own, variants.description(variants.named(own))))
    groups = by_structure([description for _, description in read])
    found = False
    for group in [*groups[:1], *(group for group in groups[1:MOST_STRUCTURES] if len(group) > 1)]:
        for base in group[:TRIED_OF_STRUCTURE]:
            if designer(0, read[base][0]).status == "ok":
                found = True
                slots = {slot for k in group for slot in differences(read[base][1], read[k][1])}
                structure = Structure(read[base][0], tuple(sorted(slots)))
                yield structure, np.array([read[k][0] for k in group[:TRIED_OF_STRUCTURE]])
                break
    if not found:
        raise ModelError(f"none of {len(read)} designs, spread over the study, can make its motions")
