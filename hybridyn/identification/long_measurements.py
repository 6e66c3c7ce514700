"""Measurements of any length, reduced chunk by chunk to one triangular factor, not to normal equations."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np

from ..compiled import needs_casadi
from ..effects.choice import Choice
from ..errors import TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..structure.samples import as_accelerations, as_efforts, as_positions, as_rates, same_samples
from ..threads import one_thread
from .base_parameters import BaseParameters, base_parameters, triangular
from .regressor import done_together, effort_rows
from .whitening import Whitening

#: Samples whose rows are built at once.
AT_ONCE = 1024

#: Positions, rates, accelerations and measured efforts of some samples, shapes (T, nq), (T, nv), (T, nv) and
#: (T, motors).
Chunk = tuple[Array, Array, Array, Array]


@dataclass(frozen=True, eq=False)
class TriangularFactor:
    """Least squares of all samples: |Y x - tau|^2 = |R x - z|^2 + rest^2, of what motors do together.

    Attributes:
        base: The base parameters x.
        R: Upper triangular factor of the weighted rows, shape (rank, rank).
        z: Right-hand side, shape (rank,).
        rest: Norm of what no x explains.
        rows: Number of rows: samples times motors, or the motions that redundant ones drive.
    """

    base: BaseParameters
    R: Array
    z: Array
    rest: float
    rows: int


def triangular_factor(
    robot: HybridRobot, chunks: Iterable[Chunk], *, effects: Choice = None, symmetric: bool = False,
    base: BaseParameters | None = None, weights: Array | None = None, compiled: bool = False,
    threads: int = 1,
) -> TriangularFactor:  # fmt: skip
    """Reduce measurements of any length to the triangular factor of their base columns, in bounded memory.

    Args:
        robot: The robot.
        chunks: Samples in parts of any size: q, v, a of the spanning tree and measured efforts.
        effects: As in `regressor`.
        symmetric: As in `regressor`.
        base: `base_parameters` with the same choices, if known.
        weights: Factor of the rows of each motor, such as 1 / standard deviation, shape (motors,); those
            of redundant motors matter for what they do together.
        compiled: Whether to build C for the rows first (`CompiledRows`), which pays for 100,000 samples.
        threads: Number of threads that share the samples. They do not change the result.

    Raises:
        CompileError: As `CompiledRows`, if `compiled`.
        AssemblyError, SingularityError, TrajectoryError: As `regressor`.
    """
    base = base or base_parameters(robot, effects=effects, symmetric=symmetric)
    rank = base.rank
    factor = np.ones(len(robot.motors)) if weights is None else np.asarray(weights, dtype=float)
    if factor.shape != (len(robot.motors),) or not (np.isfinite(factor) & (factor > 0)).all():
        raise TrajectoryError(f"weights must be {len(robot.motors)} positive numbers, one for each motor")
    reduced = partial(_reduced, robot, _rows_of(robot, base, compiled), factor)
    R, rows = np.zeros((rank + 1, rank + 1)), 0
    parts = _parts(robot, chunks)
    with one_thread(), ThreadPoolExecutor(threads) as pool:
        while some := list(islice(parts, threads)):
            new = [*pool.map(reduced, some)]
            R = triangular(np.concatenate([R, *(factor for factor, _ in new)]))
            rows += sum(count for _, count in new)
    return TriangularFactor(base, R[:rank, :rank], R[:rank, rank], abs(float(R[rank, rank])), rows)


def _rows_of(robot: HybridRobot, base: BaseParameters, compiled: bool) -> Callable[..., Array]:
    """Return the function of q, v, a that computes the base columns of Y, shape (T, motors, rank)."""
    if compiled:
        needs_casadi()
        from .compiled_rows import CompiledRows

        return CompiledRows(robot, base.standard, base.columns)
    return lambda q, v, a: effort_rows(robot, base.standard, q, v, a, together=True)[..., base.columns]


def _reduced(
    robot: HybridRobot, rows_of: Callable[..., Array], factor: Array, part: Chunk
) -> tuple[Array, int]:
    """Return the triangular factor of some samples, and the number of their rows."""
    *motion, tau = part
    white = Whitening.of(np.tile(1 / factor, (len(tau), 1)), done_together(robot, motion[0]))
    new = white(np.concatenate([rows_of(*motion), tau[..., None]], axis=2))
    return triangular(new), len(new)


def _parts(robot: HybridRobot, chunks: Iterable[Chunk]) -> Iterator[Chunk]:
    """Yield the samples of the chunks in parts of bounded size, after checks of shapes and numbers."""
    for q, v, a, tau in chunks:
        q = as_positions(robot, q)[0]
        v, a = as_rates(robot, v)[0], as_accelerations(robot, a)[0]
        tau = as_efforts(robot, tau)[0]
        same_samples(q=q, v=v, a=a, tau=tau)
        for first in range(0, len(q), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            yield q[part], v[part], a[part], tau[part]
