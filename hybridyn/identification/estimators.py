"""Estimators of x in tau = Y x + noise: weighted, robust, and by instruments; by QR, never normal equations.

Columns are scaled to length one before each factorisation. The rank is that of the scaled columns, by QR with
pivots: a diagonal entry below `DATA_RANK` times the first is none, and what it belongs to is named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ..description.names import counted, listed
from ..errors import TrajectoryError
from ..spatial import Array, Index

#: Least diagonal entry of R that counts, of the first; columns have length one.
DATA_RANK = 1e-8
#: Huber's constant: 95 % efficiency for normal noise.
HUBER = 1.345
#: Weights agree when the parameters move by less than this part of a standard deviation.
AGREED = 1e-3
MOST_ROUNDS = 30
METHODS = ("wls", "irls", "iv")


@dataclass(frozen=True, eq=False)
class Fit:
    """An estimate.

    Attributes:
        x: Estimate, shape (p,).
        root: S with covariance S S^T, shape (p, p).
        sigma: Standard deviation of each motor's noise, shape (motors,).
        weights: Weight of each sample in [0, 1], shape (T, motors); 1 without outliers.
        residual: tau - Y x, shape (T, motors).
        condition: Condition number of the scaled columns.
    """

    x: Array
    root: Array
    sigma: Array
    weights: Array
    residual: Array
    condition: float

    @property
    def deviation(self) -> Array:
        """Standard deviation of each parameter, shape (p,)."""
        out: Array = np.linalg.norm(self.root, axis=1)
        return out


def estimate(
    Y: Array, tau: Array, names: Sequence[str], method: str = "wls", instruments: Array | None = None
) -> Fit:
    """Estimate x, and each motor's noise.

    Args:
        Y: Regressor, shape (T, motors, p).
        tau: Efforts, shape (T, motors).
        names: Name of each parameter, for messages.
        method: "wls": least squares, each motor weighted by its own noise. "irls": the same, and samples
            far off count less (Huber). "iv": instruments, whose noise is not that of Y.
        instruments: The regressor of a motion without this noise, shape (T, motors, p), for "iv".

    Raises:
        TrajectoryError: Samples are too few, or the columns lose rank in the data.
    """
    T, motors, p = Y.shape
    if T * motors <= p or T < 2:
        raise TrajectoryError(
            f"{counted(T, 'sample')} of {counted(motors, 'motor')} cannot determine {p} parameters: record a "
            "longer motion"
        )
    weights, sigma, fit = np.ones((T, motors)), np.ones(motors), None
    least = np.finfo(float).eps * np.sqrt(np.mean(tau**2)) or 1.0
    for _ in range(MOST_ROUNDS):
        before = fit
        fit = _solved(Y, tau, np.sqrt(weights) / sigma, names, instruments if method == "iv" else None)
        if method == "irls":
            sigma = np.maximum(1.4826 * np.median(np.abs(fit.residual), axis=0), least)
            far = np.abs(fit.residual) / sigma
            weights = np.minimum(1.0, HUBER / np.maximum(far, HUBER))
        else:
            used = np.einsum("tmi,tmi->m", *2 * [Y @ fit.root]) / sigma**2  # freedoms that the fit takes
            sigma = np.sqrt(np.sum(fit.residual**2, axis=0) / np.maximum(T - used, 1.0))
            sigma = np.maximum(sigma, least)
        if before is not None and (np.abs(fit.x - before.x) <= AGREED * fit.deviation).all():
            break
    assert fit is not None
    if method == "irls":  # variance of Huber's estimate over that of the last weighted one
        spread, slope = np.mean((weights * far) ** 2), np.mean(far < HUBER)
        fit = replace(fit, root=fit.root * np.sqrt(spread * np.mean(weights)) / slope)
    return replace(fit, sigma=sigma, weights=weights)


def _solved(Y: Array, tau: Array, weights: Array, names: Sequence[str], instruments: Array | None) -> Fit:
    """Solve once with given roots of weights, shape (T, motors).

    With Z = Q R the instruments, x solves (Q^T Y) x = Q^T tau, whose condition is that of Y, not its square.
    """
    rows, scale = _scaled(Y, weights)
    of_z = rows if instruments is None else _scaled(instruments, weights)[0]
    Q, R, order = linalg.qr(of_z, mode="economic", pivoting=True, check_finite=False)
    check_rank(np.asarray(R, dtype=float), order.astype(int), names)
    square = R[:, np.argsort(order)] if instruments is None else Q.T @ rows
    root = (
        linalg.solve_triangular(R, np.eye(len(R)))[np.argsort(order)]
        if instruments is None
        else np.linalg.inv(square)
    )
    x = root @ (Q.T @ (tau * weights).ravel()) / scale
    condition = float(np.linalg.cond(square))
    return Fit(x, root / scale[:, None], np.ones(0), np.ones(0), tau - Y @ x, condition)


def _scaled(Y: Array, weights: Array) -> tuple[Array, Array]:
    """Return weighted rows with columns of length one, shape (T motors, p), and the lengths, shape (p,)."""
    rows = (Y * weights[..., None]).reshape(-1, Y.shape[2])
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0] = 1.0
    return rows / scale, scale


def check_rank(R: Array, order: Index, names: Sequence[str]) -> None:
    """Check the rank of a triangular factor with pivots.

    Raises:
        TrajectoryError: The columns lose rank in the data; the message names those that depend on others.
    """
    diagonal = np.abs(np.diag(R))
    rank = int(np.sum(diagonal > DATA_RANK * diagonal[0]))
    if rank < len(names):
        lost = [names[i] for i in order[rank:]]
        raise TrajectoryError(
            f"the motion does not tell {listed(lost)}: the regressor has rank {rank} of {len(names)} "
            f"(pivot {diagonal[rank]:.1e} against {DATA_RANK * diagonal[0]:.1e}); record a richer motion "
            "(hybridyn.excitation), or leave effects out"
        )
