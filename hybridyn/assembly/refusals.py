"""Errors for samples out of reach, or to which no branch leads: what is open, and what is singular."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import AT_SAMPLE, AssemblyError
from ..linkage.elimination import SMALLEST_SINGULAR_VALUE
from ..linkage.newton import Closed
from ..spatial import Array
from .task import Task, WeakRows

if TYPE_CHECKING:  # most tasks are those of one module
    from .chain.task import ChainTask

#: Step of the difference of a singular value [rad, module lengths]: far above rounding.
SLOPE_STEP = 1e-5


class Ended(NamedTuple):
    """Where a motion towards a sample ended.

    Attributes:
        task: The task.
        sample: The sample from which the motion goes to the next.
        q: The last posture, shape (nq,).
        done: Which part of the way it is at.
    """

    task: Task | ChainTask
    sample: int
    q: Array
    done: float

    def weak_rows(self, ways: Array) -> list[WeakRows]:
        """Return the rows that may lose rank where scaled motions lead, shape (n, nv), from the posture."""
        problem, at = self.task.problem, np.array([self.sample])
        task = self.task.headed(self.q[None], at, done=self.done).between(self.sample, np.array([self.done]))
        q = problem.tree.integrate(np.tile(self.q, (len(ways), 1)), ways * problem.col_scale)
        return task.weak_rows(q, np.zeros(len(ways), dtype=int))


class ToSingular(NamedTuple):
    """How far a posture is from the nearest singular one.

    Attributes:
        name: The freedom that moves most on the way.
        distance: By how much it moves, about, in its unit.
        unit: The unit, "m" or "rad".
    """

    name: str
    distance: float
    unit: str


def to_singular(ended: Ended) -> ToSingular:
    """Compute how far the end of a motion is from the nearest singular posture.

    The least singular value s of rows is zero there. Along motions that keep the loops closed it has the
    slope g, and so vanishes after about s / |g| of the steepest of these motions.
    """
    found, task = [], ended.task
    here = ended.weak_rows(np.zeros((1, task.problem.tree.nv)))
    loose = task.loose(ended.q[None])
    for i, one in enumerate(here):
        if not one.rank:
            continue
        _, s, Vt = np.linalg.svd(one.rows[0])
        least, weakest = s[one.rank - 1], one.motions @ Vt[one.rank - 1]
        ways = np.linalg.qr(np.column_stack([weakest, loose]))[0]
        beside = np.linalg.svd(ended.weak_rows(SLOPE_STEP * ways.T)[i].rows, compute_uv=False)
        slope = (beside[:, one.rank - 1] - least) / SLOPE_STEP
        steepest = ways @ slope / max(float(np.linalg.norm(slope)), SMALLEST_SINGULAR_VALUE)
        left = least / max(float(np.linalg.norm(slope)), SMALLEST_SINGULAR_VALUE)
        most = int(np.argmax(np.abs(steepest)))
        found.append((float(left * abs(steepest[most])), most))
    left, freedom = min(found, default=(np.inf, 0))
    moved = task.freedoms[freedom]
    return ToSingular(moved.name, left * float(task.problem.col_scale[freedom]), moved.unit)


def _beyond(task: Task | ChainTask, q: Array) -> str:
    """Return which joint is farthest outside its limits at a posture, shape (nq,), for its range, or ""."""
    found = []
    for one in task.freedoms:
        if one.at is not None and (off := max(one.lower - q[one.at], q[one.at] - one.upper)) > 0.0:
            span = one.upper - one.lower
            found.append((off / span, f"; {one.name} is {off:.2g} {one.unit} outside its limits there"))
    return max(found, default=(0.0, ""))[1]


def _told(ended: Ended | None) -> tuple[str, float | None]:
    """Return what an error says of where a motion ended, and how far that is from a singular posture."""
    if ended is None:
        return "", None
    name, distance, unit = to_singular(ended)
    return (
        f" The motion there ends at {100 * ended.done:.3g} % of the way, where {name} is about "
        f"{distance:.2g} {unit} from a singular posture."
    ), distance


def unreachable(
    task: Task | ChainTask,
    result: Closed,
    sample: int,
    lacking: float = 0.0,
    ended: Ended | None = None,
) -> AssemblyError:
    """Build the error for a sample that no start closes, from the best of several starts.

    The row that is named is the one that is most open there.

    Args:
        lacking: Length that it lacks in any posture [m], zero if it is not known to.
        ended: Where the motion towards it ended, if there was one.
    """
    at = int(np.argmin(result.residual))
    best = float(result.residual[at])
    rows = task.problem.residual(result.q[at : at + 1], np.array([min(sample, len(task.known) - 1)]))[0]
    row = int(np.argmax(np.abs(rows)))
    worst, measure = task.row_names[row], task.row_measures[row]
    what = f"{task.label}, {worst}: the loops do not close" if measure is None else f"{worst}: not reached"
    if best <= task.tolerance:  # but not rounding: a least distance, at a posture where rows lose rank
        why = f"the nearest posture of {task.label}, a singular one, leaves {best:.2g} of its length open"
    elif measure is None:
        why = f"best residual {best:.2g} of the module's length (limit {task.tolerance:.0e})"
    else:
        off, most = (x * measure[0] for x in (best, task.tolerance))
        why = f"the nearest posture of {task.label} misses it by {off:.2g} {measure[1]} (limit {most:.0e})"
    if lacking:
        who = "a loop" if isinstance(task, Task) else "the way to the target"
        why += f" ({who} lacks {lacking:.2g} m in any posture)"
    told, distance = _told(ended)
    return AssemblyError(
        f"{what}{AT_SAMPLE}: {why} after {result.iterations} iterations"
        f"{_beyond(task, result.q[at])}{task.surplus(result.q[at : at + 1])}.{told} The target is out of "
        "reach, or contradicts another one; move it, or give a better guess",
        module=task.module,
        leg=worst,
        residual=best,
        iterations=result.iterations,
        sample=sample,
        distance=distance,
    )


def lost(
    task: Task | ChainTask, result: Closed, sample: int, start: str, ended: Ended | None
) -> AssemblyError:
    """Build the error for a sample to which no branch leads from a start, from what Newton found there.

    Args:
        ended: As for `unreachable`.
    """
    from .chain.lowest import LowestTask  # an error may take its time

    closed = task.closed(result)[0]
    if isinstance(task, LowestTask) and (closed or np.isinf(result.residual[0])):
        return task.lost(sample, start)
    if not closed:
        return unreachable(task, result, sample, ended=ended)
    told, distance = _told(ended)
    return AssemblyError(
        f"{task.label}: no continuous motion leads to the posture{AT_SAMPLE} {start}: it would "
        f"jump to another assembly branch.{told} Go there by a way that avoids the singularity "
        "between them",
        module=task.module,
        sample=sample,
        residual=float(result.residual[0]),
        iterations=result.iterations,
        distance=distance,
    )
