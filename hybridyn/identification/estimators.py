"""Estimators of x in tau = Y x + noise: weighted, robust, and by instruments; by QR, never normal equations.

Columns are scaled to length one before each factorisation. The rank is that of the scaled columns, by QR with
pivots: a diagonal entry below `DATA_RANK` times the first is none, and what it belongs to is named.

Of redundant motors only what they do together is compared (`whitening`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg, stats

from ..description.names import counted, listed
from ..errors import TrajectoryError
from ..spatial import Array, Index
from .whitening import Whitening, driven

#: Least diagonal entry of R that counts, of the first; columns have length one.
DATA_RANK = 1e-8
#: Part of normal noise within Huber's limit, 1.345 deviations of one row: 95 % efficiency.
INSIDE = 0.8214
#: Weights agree when the parameters move by less than this part of a standard deviation.
AGREED = 1e-3
MOST_ROUNDS = 30
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Fit:
    """An estimate.

    Attributes:
        x: Estimate, shape (p,).
        root: S with covariance S S^T, shape (p, p).
        sigma: Standard deviation of each motor's noise, shape (motors,).
        weights: Weight of each sample in [0, 1], shape (T, motors); 1 without outliers.
        residual: What tau - Y x says of the noise, shape (T, motors).
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
        return np.asarray(np.linalg.norm(self.root, axis=1))


def estimate(
    Y: Array, tau: Array, names: Sequence[str], method: str = "wls", instruments: Array | None = None,
    together: Array | None = None,
) -> Fit:  # fmt: skip
    """Estimate x, and each motor's noise.

    Args:
        Y, tau: Regressor, shape (T, motors, p), and efforts, shape (T, motors).
        names: Name of each parameter, for messages.
        method: "wls": least squares, each motor weighted by its own noise. "irls": the same, and samples
            far off count less (Huber). "iv": instruments, whose noise is not that of Y.
        instruments: The regressor of a motion without this noise, shape (T, motors, p), for "iv".
        together: What the motors do together, if they are redundant: Pi, shape (T, motors, motors).

    Raises:
        TrajectoryError: Samples are too few, or the columns lose rank in the data.
    """
    T, motors, p = Y.shape
    rank = driven(together, motors)
    if T * rank <= p or T < 2:
        raise TrajectoryError(
            f"{counted(T, 'sample')} of {counted(motors, 'motor')} cannot determine {p} parameters: record a "
            "longer motion"
        )
    sigma, fit, weights = _sizes(tau), None, np.ones((T, 1))
    least = np.finfo(float).eps * np.maximum(sigma, TINY)
    for _ in range(MOST_ROUNDS):
        before, white = fit, Whitening.of(np.tile(sigma, (T, 1)), together)
        fit = _solved(Y, tau, white, np.sqrt(weights), names, instruments if method == "iv" else None)
        if method == "irls":
            size, weights, inflated = _huber(white, fit)
            sigma = size * (sigma if together is None else _proportions(white, fit, weights))
        else:
            sigma = _deviations(white, white(fit.residual), white(Y @ fit.root))
        sigma = np.maximum(sigma, least)
        if before is not None and (np.abs(fit.x - before.x) <= AGREED * fit.deviation).all():
            break
    assert fit is not None
    root = fit.root * inflated if method == "irls" else fit.root
    return replace(fit, root=root, sigma=sigma, weights=np.broadcast_to(weights, (T, motors)))


def _huber(white: Whitening, fit: Fit) -> tuple[Array, Array, float]:
    """Weigh residuals by Huber's function: those of each motor, or of all together if they are redundant.

    Returns:
        How many times larger the noise is than it was taken for, shape (groups,); weights, (T, groups); and
        the deviation of Huber's estimate over that of the last weighted one.
    """
    T = len(fit.residual)
    rows = white(fit.residual).reshape(T, -1)
    far = np.abs(rows) if white.rows is None else np.linalg.norm(rows, axis=1, keepdims=True)
    d = rows.shape[1] // far.shape[1]
    half, limit = np.sqrt(stats.chi2.ppf([0.5, INSIDE], d))
    size = np.median(far, axis=0) / half
    far = far / np.maximum(size, TINY)
    weights = np.minimum(1.0, limit / np.maximum(far, limit))
    spread = np.mean((weights * far) ** 2) / d
    slope = np.mean(np.where(far < limit, 1.0, (1.0 - 1.0 / d) * weights))
    return size, weights, float(np.sqrt(spread * np.mean(weights)) / slope)


def _deviations(white: Whitening, rows: Array, whole: Array | None = None) -> Array:
    """Estimate the deviation of each motor's noise, shape (motors,), from rows of residuals, shape (T d,).

    Where rows see a part of a motor's noise only, its variance is that of the residual, and the rest that of
    before, all together as large as the residuals say (a step of EM, in which no variance collapses).

    Args:
        whole: Rows of Y S, shape (T d, p); their squares are the freedoms that the fit takes.
    """
    T, motors = white.deviation.shape
    taken, p = np.zeros(motors), 0 if whole is None else whole.shape[1]
    if whole is not None:
        each = white.back(whole) / white.deviation[..., None]
        taken = np.einsum("tmi,tmi->m", each, each)
    before = np.sum(rows**2) / max(len(rows) - p, 1) * white.deviation[0] ** 2
    unseen = before * np.sum(1.0 - white.seen, axis=0)
    seen = np.sum(white.back(rows) ** 2, axis=0)
    return np.asarray(np.sqrt((seen + unseen) / np.maximum(T - taken, 1.0)))


def _proportions(white: Whitening, fit: Fit, weights: Array) -> Array:
    """Return deviations in the proportions of residuals with weights, as large as before together."""
    rows = (white(fit.residual).reshape(len(weights), -1) * weights).ravel()
    return np.asarray(_deviations(white, rows) / np.sqrt(np.maximum(np.mean(rows**2), TINY)))


def _sizes(tau: Array) -> Array:
    """Return the sizes of efforts of several units, shape (motors,): with these, estimating begins."""
    size = np.sqrt(np.mean(tau**2, axis=0))
    return np.where(size > 0, size, size.max(initial=0.0) or 1.0)


def _solved(
    Y: Array,
    tau: Array,
    white: Whitening,
    weights: Array,
    names: Sequence[str],
    instruments: Array | None,
) -> Fit:
    """Solve once with a given whitening, and roots of weights, shape (T, motors or 1).

    With Z = Q R the instruments, x solves (Q^T Y) x = Q^T tau, whose condition is that of Y, not its square.
    """
    right = white(tau)
    each = np.broadcast_to(weights, (len(tau), len(right) // len(tau))).ravel()
    (rows, scale), right = _scaled(white(Y) * each[:, None]), right * each
    if instruments is not None:
        Q = _factors(_scaled(white(instruments) * each[:, None])[0], names)[0]
        rows, right = Q.T @ rows, Q.T @ right
    Q, R, order = _factors(rows, names)
    back = np.argsort(order)
    x = linalg.solve_triangular(R, Q.T @ right)[back] / scale
    root = linalg.solve_triangular(R, np.eye(len(R)))[back] / scale[:, None]
    residual = white.back(white(tau - Y @ x))
    return Fit(x, root, np.ones(0), np.ones(0), residual, float(np.linalg.cond(R)))


def _scaled(rows: Array) -> tuple[Array, Array]:
    """Return rows with columns of length one, shape (k, p), and the lengths, shape (p,)."""
    scale = np.linalg.norm(rows, axis=0)
    scale[scale == 0] = 1.0
    return rows / scale, scale


def _factors(rows: Array, names: Sequence[str]) -> tuple[Array, Array, Index]:
    """Return Q, R and the order of the columns of a QR with pivots, shapes (k, p), (p, p) and (p,).

    Raises:
        TrajectoryError: The columns lose rank in the data; the message names those that depend on others.
    """
    Q, R, order = linalg.qr(rows, mode="economic", pivoting=True, check_finite=False)
    diagonal = np.abs(np.diag(R))
    rank = int(np.sum(diagonal > DATA_RANK * diagonal[0]))
    if rank < len(names):
        lost = [names[i] for i in order[rank:]]
        raise TrajectoryError(
            f"the motion does not tell {listed(lost)}: the regressor has rank {rank} of {len(names)} "
            f"(pivot {diagonal[rank]:.1e} against {DATA_RANK * diagonal[0]:.1e}); record a richer motion "
            "(hybridyn.excitation), or leave effects out"
        )
    return np.asarray(Q, dtype=float), np.asarray(R, dtype=float), order.astype(int)
