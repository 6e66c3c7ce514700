"""The best designs of a sweep and the Pareto front of objectives."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from os import PathLike
from typing import NamedTuple

import numpy as np

from ...errors import HybridynError
from ...spatial import Array, Mask
from .expressions import Expression
from .shards import About, about_of, read_shards


class SweepRows(NamedTuple):
    """All rows of a sweep.

    Attributes:
        about: What they belong to.
        columns: Columns of numbers by name, shape (designs,) each: "design", parameters, measures, gradients.
        status: Status of each design, shape (designs,).
        met: Which designs are "ok" and meet the condition, shape (designs,).
    """

    about: About
    columns: dict[str, Array]
    status: Array
    met: Mask


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
        left_out: Number of the others by reason, the most frequent first.
    """

    columns: tuple[str, ...]
    objectives: tuple[str, ...]
    rows: list[list[float]]
    front: list[list[float]]
    designs: int
    considered: int
    left_out: dict[str, int] = field(default_factory=dict)


def rows_of(folder: str | PathLike[str], where: str | None = None) -> SweepRows:
    """Read the rows of a sweep.

    Args:
        where: A condition on the columns, or None.

    Raises:
        HybridynError: The folder has no results, or the condition is wrong.
    """
    about = about_of(str(folder))
    numbers = ["design", *about.parameters, *about.measures, *about.gradients]
    condition = None if where is None else Expression(where, numbers, "--where")
    frame = read_shards(str(folder), [*numbers, "status"])
    columns = {name: frame[name].cast(float).fill_null(np.nan).to_numpy() for name in numbers}
    status = frame["status"].to_numpy()
    met: Mask = status == "ok"
    if condition is not None:
        met = met & np.asarray(condition(columns), dtype=bool)
    return SweepRows(about, columns, status, met)


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
    about, columns, status, met = rows_of(folder, where)
    aims = {text.strip(): Expression(text, [*columns], "--best") for text in objectives.split(",")}
    values = np.column_stack([np.broadcast_to(aim(columns), status.shape) for aim in aims.values()])
    known: Mask = ~np.isnan(values).any(axis=1)
    left = Counter(status[status != "ok"].tolist())
    left[f"do not meet '{(where or '').strip()}'"] = int((status == "ok").sum() - met.sum())
    left["have no number there"] = int((met & ~known).sum())
    left_out = dict(sorted(((why, n) for why, n in left.items() if n), key=lambda one: (-one[1], one[0])))
    keep = np.flatnonzero(met & known)
    if not len(keep):
        why = ", ".join(f"{count:,} {what}" for what, count in left_out.items())
        raise HybridynError(f"{folder}: no design is left to compare ({why or 'there are no rows'})")
    # By the objectives, the first of them first, then by design.
    keep = keep[np.lexsort([columns["design"][keep], *reversed(values[keep].T)])]
    shown = {name: columns[name] for name in ("design", *about.parameters, *about.measures)}
    shown |= {text: x for text, x in zip(aims, values.T, strict=True) if text not in columns}
    table = np.column_stack([*shown.values()])
    front = keep[_front(values[keep])]
    return Best(
        tuple(shown), tuple(aims), table[keep[:top]].tolist(), table[front].tolist(), len(status), len(keep),
        left_out,
    )  # fmt: skip


def _front(values: Array) -> list[int]:
    """Return the places of sorted rows, shape (designs, objectives), that no other row dominates."""
    kept: list[int] = []
    for i, one in enumerate(values):
        others = values[kept]
        if not ((others <= one).all(axis=1) & (others < one).any(axis=1)).any():
            kept.append(i)
    return kept
