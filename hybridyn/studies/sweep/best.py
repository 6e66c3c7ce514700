"""The best designs of a sweep and the Pareto front of objectives, shard by shard in bounded memory."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

import numpy as np

from ...errors import HybridynError
from ...spatial import Array, Mask
from .expressions import Expression
from .shards import about_of, read_shards


@dataclass
class Best:
    """The best designs.

    Attributes:
        columns: Columns of the rows: the design, its parameters, objectives, and measures.
        objectives: What is minimised, as the user wrote it.
        rows: The best designs, the best first by the first objective, then the next.
        front: The Pareto front: designs that no other is better than in one objective and not worse in any.
        designs: Number of designs with a row.
        considered: Number of those that are compared.
        left_out: Number of the others by reason.
    """

    columns: tuple[str, ...]
    objectives: tuple[str, ...]
    rows: list[list[float]]
    front: list[list[float]]
    designs: int = 0
    considered: int = 0
    left_out: dict[str, int] = field(default_factory=dict)


def find_best(folder: str | PathLike[str], objectives: str, where: str | None = None, top: int = 10) -> Best:
    """Find the designs of a sweep whose objectives are smallest.

    Args:
        folder: Folder of the results.
        objectives: Expressions of columns with commas between; each is minimised, `-reach` maximises.
        where: A condition that a design has to meet.
        top: Number of designs.

    Raises:
        HybridynError: The folder has no results, an expression is wrong, or no design meets the condition.
    """
    about = about_of(str(folder))
    numbers = ["design", *about.parameters, "unreachable", "singular", *about.measures]
    aims = [Expression(text, numbers, "--best") for text in objectives.split(",")]
    condition = None if where is None else Expression(where, numbers, "--where")
    extra = [aim.text for aim in aims if aim.text not in numbers]
    columns = ("design", *about.parameters, *about.measures, *extra)
    found = Best(columns, tuple(aim.text for aim in aims), [], [])
    best, front = np.empty((2, 0, len(aims) + len(columns)))
    for shard in read_shards(str(folder), [*numbers, "status"]):
        rows = _chosen(found, shard, aims, condition, about.measures)
        best = _ranked(np.concatenate([best, rows]), len(aims))[:top]
        front = _front(np.concatenate([front, rows]), len(aims))
    # The most frequent reason first: which shard has one first depends on computing times.
    found.left_out = dict(sorted(found.left_out.items(), key=lambda reason: (-reason[1], reason[0])))
    if not found.considered:
        why = ", ".join(f"{count:,} {what}" for what, count in found.left_out.items() if count)
        raise HybridynError(f"{folder}: no design is left to compare ({why or 'there are no rows'})")
    found.rows = best[:, len(aims) :].tolist()
    found.front = _ranked(front, len(aims))[:, len(aims) :].tolist()
    return found


def _chosen(
    found: Best, shard: dict[str, Any], aims: list[Expression], condition: Expression | None,
    measures: list[str],
) -> Array:  # fmt: skip
    """Return objectives and columns of the designs to compare, shape (designs, ...), and count the others."""
    statuses = np.array(shard["status"])
    keep: Mask = statuses == "ok"
    found.designs += len(statuses)
    for status in np.unique(statuses[~keep]).tolist():
        _leave(found, status, int((statuses == status).sum()))
    if condition is not None:
        met = np.broadcast_to(np.asarray(condition(shard), dtype=bool), keep.shape)
        _leave(found, f"do not meet '{condition.text}'", int((keep & ~met).sum()))
        keep = keep & met
    values = np.column_stack([np.broadcast_to(aim(shard), keep.shape) for aim in aims]).astype(float)
    known = ~np.isnan(values).any(axis=1)
    _leave(found, "have no number there", int((keep & ~known).sum()))
    keep = keep & known
    found.considered += int(keep.sum())
    by_name = {**shard, **{aim.text: values[:, i] for i, aim in enumerate(aims)}}
    cells = np.column_stack([by_name[name] for name in found.columns]).astype(float)
    return np.column_stack([values, cells])[keep]


def _leave(found: Best, why: str, count: int) -> None:
    found.left_out[why] = found.left_out.get(why, 0) + count


def _ranked(rows: Array, aims: int) -> Array:
    """Sort rows by their objectives, the first of them first, then by design."""
    keys = [rows[:, aims], *(rows[:, i] for i in reversed(range(aims)))]
    return rows[np.lexsort(keys)]


def _front(rows: Array, aims: int) -> Array:
    """Return the rows that no other row dominates."""
    rows = _ranked(rows, aims)
    kept: list[int] = []
    values = rows[:, :aims]
    for i, one in enumerate(values):
        others = values[kept]
        no_worse, better = (others <= one).all(axis=1), (others < one).any(axis=1)
        if not (no_worse & better).any() and not math.isnan(one[0]):
            kept.append(i)
    return rows[kept]
