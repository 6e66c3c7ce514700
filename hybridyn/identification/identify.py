"""Identify the dynamic parameters of a robot from a measured motion, and judge the result.

Estimators of x in tau = Y x + noise: weighted, robust, and by instruments; by QR, never normal equations.

Columns are scaled to length one before each factorisation. The rank is that of the scaled columns, by QR with
pivots: a diagonal entry below `DATA_RANK` times the first is none, and what it belongs to is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import linalg

from ..compiled.model import CompiledRobot
from ..description.names import counted, did_you_mean, listed
from ..effects.choice import Choice
from ..errors import ModelError, TrajectoryError
from ..spatial import Array, Index, Mask
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .base_parameters import BaseParameters, base_parameters
from .inertial import consistent
from .parameters import with_parameters
from .result import Identification, Residuals, residuals
from .rows import Rows, Source, check_robot, check_scales, linear_model
from .signals import read_log

#: Least radius of gyration of a body about its frame that is thought of, of the robot's size.
SMALL = 0.01
TINY = np.finfo(float).tiny
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
        return np.asarray(np.linalg.norm(self.root, axis=1))


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
    (rows, scale), right = _scaled(Y, weights), (tau * weights).ravel()
    if instruments is not None:
        Q = _factors(_scaled(instruments, weights)[0], names)[0]
        rows, right = Q.T @ rows, Q.T @ right
    Q, R, order = _factors(rows, names)
    back = np.argsort(order)
    x = linalg.solve_triangular(R, Q.T @ right)[back] / scale
    root = linalg.solve_triangular(R, np.eye(len(R)))[back] / scale[:, None]
    return Fit(x, root, np.ones(0), np.ones(0), tau - Y @ x, float(np.linalg.cond(R)))


def _scaled(Y: Array, weights: Array) -> tuple[Array, Array]:
    """Return weighted rows with columns of length one, shape (T motors, p), and the lengths, shape (p,)."""
    rows = (Y * weights[..., None]).reshape(-1, Y.shape[2])
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


@one_thread()
def identify(
    robot: HybridRobot,
    table: Any,
    *,
    effects: Choice = "model",
    symmetric: bool = False,
    method: str = "wls",
    reference: Any = None,
    validate: Any = None,
    known: Sequence[str] = (),
    only: Sequence[str] = ("*",),
    prior: float = 1.0,
    band: float | None = None,
    period: float | None = None,
    every: int | None = None,
    compiled: CompiledRobot | None = None,
) -> Identification:
    """Identify dynamic parameters from measured positions and efforts of the motors.

    Passive joints are not measured: the loops are closed for every sample. Estimated are the base parameters,
    which are all that the efforts tell; a robot that can exist and has them follows by a conic program.

    Args:
        robot: The robot, whose geometry is taken as right.
        table: The log: a CSV or Parquet file, or columns by name: 'time', and of every motor
            '<motor>/position' and '<motor>/effort' or '<motor>/current' (docs/identification.md).
        effects: As in `hybridyn.regressor`: "model" has rotor inertia and friction of every motor, and the
            word "offsets" adds a constant to each motor's effort.
        symmetric: Whether legs with equal numbers share their parameters.
        method: "wls": least squares, weighted by each motor's noise. "irls": samples far off count less.
            "iv": instrumental variables, against the bias by noise of positions.
        reference: For "iv": the commanded motion, a table with time and positions, on the log's clock.
        validate: A log of a second motion, on which the result is tested.
        known: Parameters whose numbers in the robot's file are right: names, or patterns as of files.
        only: Parameters to be identified, in the same way; all others are known.
        prior: How far the file's numbers may be wrong, as a part of them: what the efforts do not tell stays
            near them.
        band: As in `processed`, like the next.
        period: Period of a periodic motion [s].
        every: Number of samples that are averaged to one; None chooses by the band.
        compiled: The robot's compiled models, which close loops faster.

    Raises:
        TrajectoryError: The log is too short or too poor, or a column is missing or in another unit.
        ModelError: Effects or names are unknown, or the robot's base is not fixed.
        AssemblyError: The loops cannot be closed at some sample.
    """
    _check_words(method, reference, prior, every)
    check_robot(robot)
    base = base_parameters(robot, effects=effects, symmetric=symmetric)
    model, held = linear_model(base, known, only)
    source = Source(robot, model, held, compiled, band, period, every)
    data = source.rows(read_log(robot, table))
    check_scales(source, data)
    command = None if reference is None else read_log(robot, reference, efforts=False)
    instruments = None if command is None else source.instruments(command, data)
    fit, constants = _estimated(robot, model, data, method, instruments)
    x, constrained = _possible(base, robot.bodies.size, model, held, fit, prior)
    second = None if validate is None else source.rows(read_log(robot, validate))
    return Identification(
        robot=robot,
        identified=with_parameters(robot, x, effects=effects, symmetric=symmetric),
        effects=effects,
        method=method,
        names=model.names,
        values=fit.x,
        deviation=fit.deviation,
        of_file=model.combination @ base.standard.values,
        of_robot=model.combination @ x,
        standard=dict(zip(base.standard.names, x.tolist(), strict=True)),
        constants=constants,
        noise=fit.sigma,
        condition=fit.condition,
        outliers=float(np.mean(fit.weights < 0.5)),
        fit=_judged(data, fit.x, constants, fit.weights),
        validation=None if second is None else _judged(second, fit.x, constants),
        constrained=constrained,
        never=base.never,
        remarks=data.log.remarks,
    )


def _check_words(method: str, reference: Any, prior: float, every: int | None) -> None:
    """Check what the caller wishes.

    Raises:
        ModelError: There is no such method, a number is out of range, or instruments have no reference.
    """
    if method not in METHODS:
        raise ModelError(
            f"there is no method '{method}'{did_you_mean(method, METHODS)}; known: {', '.join(METHODS)}"
        )
    if (method == "iv") != (reference is not None):
        raise ModelError(
            "the method 'iv' takes a reference, the commanded motion, and other methods take none"
        )
    if not prior > 0 or (every is not None and every < 1):
        raise ModelError(f"the prior must be above 0 and every at least 1; they are {prior:g} and {every}")


def _judged(data: Rows, x: Array, constants: Array | None, weights: Array | None = None) -> Residuals:
    """Judge what an estimate leaves over of a motion."""
    efforts = data.measured if constants is None else data.measured * constants[0]
    return residuals(data.time, efforts, efforts - data.known - data.Y @ x, weights)


def _estimated(
    robot: HybridRobot, model: BaseParameters, data: Rows, method: str, instruments: Array | None
) -> tuple[Fit, Array | None]:
    """Estimate the base parameters and, from currents, the constant of each motor."""
    if not data.log.currents:
        return estimate(data.Y, data.measured - data.known, model.names, method, instruments), None
    if not data.known.any(axis=0).all():
        raise TrajectoryError(
            "the log has currents, and efforts per current scale with all parameters: name some that are "
            "known, of each motor's load (known=['* of platform'] after weighing it), or multiply the "
            "currents by the motors' constants and call them efforts", file=data.log.file,
        )  # fmt: skip
    each = -data.measured[:, :, None] * np.eye(len(robot.motors))
    names = [*model.names, *(f"constant of {motor}" for motor in robot.motors)]
    more = None if instruments is None else np.concatenate([instruments, each], axis=2)
    fit = estimate(np.concatenate([data.Y, each], axis=2), -data.known, names, method, more)
    constants = np.stack([fit.x, fit.deviation])[:, len(model.names) :]
    own = slice(len(model.names))
    return replace(fit, x=fit.x[own], root=fit.root[own]), constants


def _possible(
    base: BaseParameters, length: float, model: BaseParameters, known: Mask, fit: Fit, weight: float
) -> tuple[Array, bool]:
    """Compute standard parameters of a robot that can exist, and whether the conic program was needed."""
    bodies, terms, values = base.standard.tens, base.standard.terms, base.standard.values
    unit = np.abs(values)
    for at in bodies:
        about = values[at[[4, 6, 9]]].sum() / 2 / max(values[at[0]], TINY)
        size = np.sqrt(max(about, (SMALL * length) ** 2))
        unit[at] = values[at[0]] * np.repeat([1.0, size, size**2], [1, 3, 6])
    bare = model.columns[unit[model.columns] == 0]  # what the file does not state is as large as it is found
    unit[bare] = np.abs(fit.x[unit[model.columns] == 0]) + TINY
    unit[known] = 0.0
    positive = [int(i) for term in terms if term.symbol != "offset" for i in term.columns if unit[i] > 0]
    own = [at for at in bodies if unit[at].all()]
    positive += [int(at[0]) for at in bodies if unit[at[0]] and not unit[at].all()]
    return consistent(
        model.combination, fit.x, fit.root, values, unit, own, sorted(set(positive)), weight=weight
    )
