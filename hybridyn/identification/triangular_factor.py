"""Long measurements: rows reduced, chunk by chunk, to one triangular factor, never to normal equations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from ..compiled.failures import needs_casadi
from ..effects.choice import Choice
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_efforts, as_positions, as_rates, same_samples
from ..threads import one_thread
from .base_parameters import BaseParameters, base_parameters, triangular
from .parameters import StandardParameters, standard_parameters
from .regressor import effort_rows

if TYPE_CHECKING:
    from .compiled_rows import CompiledRows

#: Samples whose rows are built at once.
AT_ONCE = 1024

#: Positions, rates, accelerations and measured efforts of some samples, shapes (T, nq), (T, nv), (T, nv) and
#: (T, motors).
Chunk = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, eq=False)
class TriangularFactor:
    """Least squares of all samples: |Y x - tau|^2 = |R x - z|^2 + rest^2.

    Attributes:
        base: The base parameters x.
        R: Upper triangular factor of the weighted rows, shape (rank, rank).
        z: Right-hand side, shape (rank,).
        rest: Norm of what no x explains.
        rows: Number of rows: samples times motors.
    """

    base: BaseParameters
    R: Array
    z: Array
    rest: float
    rows: int


def triangular_factor(
    robot: HybridRobot,
    chunks: Iterable[Chunk],
    *,
    effects: Choice = None,
    symmetric: bool = False,
    base: BaseParameters | None = None,
    weights: Array | None = None,
    compiled: bool = False,
    threads: int = 1,
) -> TriangularFactor:
    """Reduce measurements of any length to the triangular factor of their base columns, in bounded memory.

    Args:
        robot: The robot.
        chunks: Samples in parts of any size: q, v, a of the spanning tree and measured efforts.
        effects: As in `regressor`.
        symmetric: As in `regressor`.
        base: `base_parameters` with the same choices, if known.
        weights: Factor of the rows of each motor, such as 1 / standard deviation, shape (motors,).
        compiled: Whether to build C for the rows first (`CompiledRows`), which pays for 100,000 samples.
        threads: Number of threads that share the samples. They do not change the result.

    Raises:
        CompileError: As `CompiledRows`, if `compiled`.
        AssemblyError, SingularityError, TrajectoryError: As `regressor`.
    """
    parameters = standard_parameters(robot, effects=effects, symmetric=symmetric)
    base = base or base_parameters(robot, effects=effects, symmetric=symmetric)
    factor = np.ones(len(robot.motors)) if weights is None else np.asarray(weights, dtype=float)
    if factor.shape != (len(robot.motors),) or not (np.isfinite(factor) & (factor > 0)).all():
        raise TrajectoryError(f"weights must be {len(robot.motors)} positive numbers, one for each motor")
    rows_of = _compiled(robot, parameters, base) if compiled else None

    def reduced(part: Chunk) -> Array:
        """Return the triangular factor of some samples."""
        *motion, tau = part
        Y = rows_of(*motion) if rows_of else effort_rows(robot, parameters, *motion)[..., base.columns]
        new = np.concatenate([Y, tau[..., None]], axis=2) * factor[:, None]
        return triangular(new.reshape(-1, base.rank + 1))

    R, rows = np.zeros((0, base.rank + 1)), 0
    parts = _parts(robot, chunks)
    with one_thread(), ThreadPoolExecutor(threads) as pool:
        while some := list(islice(parts, threads)):
            R = triangular(np.concatenate([R, *pool.map(reduced, some)]))
            rows += sum(part[-1].size for part in some)
    square = np.zeros((base.rank + 1, base.rank + 1))
    square[: len(R)] = R
    rank = base.rank
    return TriangularFactor(
        base, square[:rank, :rank], square[:rank, rank], abs(float(square[rank, rank])), rows
    )


def _compiled(robot: HybridRobot, parameters: StandardParameters, base: BaseParameters) -> CompiledRows:
    """Return the rows in C."""
    needs_casadi()
    from .compiled_rows import CompiledRows

    return CompiledRows(robot, parameters, base.columns)


def _parts(robot: HybridRobot, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """Yield the samples of the chunks in parts of bounded size, after checks of shapes and numbers."""
    for q, v, a, tau in chunks:
        q = as_positions(robot, q)[0]
        v, a = as_rates(robot, v)[0], as_rates(robot, a, "a", "acceleration")[0]
        tau = as_efforts(robot, tau)[0]
        same_samples(q=q, v=v, a=a, tau=tau)
        for first in range(0, len(q), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            yield q[part], v[part], a[part], tau[part]
