"""Identify the dynamic parameters of a robot from a measured motion, and judge the result."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..compiled import CompiledRobot
from ..description.names import did_you_mean
from ..effects.choice import Choice
from ..errors import HybridynError, ModelError, TrajectoryError
from ..spatial import Array, Index
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .base_parameters import base_parameters
from .estimators import Fit, estimate
from .logs import Log, read_log
from .loss_fit import LossFit, LossyRows, fit_losses
from .losses import SoughtLosses, sought_losses
from .possible import DEFINITE, Possible, consistent, exists
from .result import Identification, Residuals, residuals
from .robot_with import with_losses, with_parameters
from .rows import LogRows, LogSource, check_robot
from .sought import Sought, linear_model
from .units import check_log, check_scales
from .whitening import Whitening

#: Methods of estimating.
METHODS = ("wls", "irls", "iv")


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
            word "offsets" adds a constant to each motor's effort. The coefficients that "load_friction" and
            "gear_efficiency" state are sought, too, whatever their numbers.
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
        ModelError: Effects or names are unknown, the robot's base is not fixed, or losses that grow with
            load cannot be identified with this robot, method or log.
        ActuationError: Friction that grows with load may jam joints.
        AssemblyError: The loops cannot be closed at some sample.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> motion = hybridyn.excitation(robot, evaluations=1)
        >>> log = motion.columns(rate=20.0)
        >>> q, v, a = hybridyn.assemble(robot, motors=motion.at(log["time"]))
        >>> tau = hybridyn.idm(robot, q, v, a)
        >>> log |= {f"{name}/effort": tau[:, i] for i, name in enumerate(robot.motors)}
        >>> found = hybridyn.identify(robot, log)
        >>> bool(found.fit.relative.max() < 1e-6)
        True
    """
    _check_words(method, reference, prior, every)
    check_robot(robot)
    linear, losses = sought_losses(robot, effects)
    _check_losses(losses, method)
    log = read_log(robot, table)
    base = base_parameters(robot, effects=linear, symmetric=symmetric)
    sought = linear_model(base, known, only)
    source, model = LogSource(robot, sought, compiled, band, period, every), sought.model
    data = _rows(source, log)
    check_scales(source, data)
    command = None if reference is None else read_log(robot, reference, efforts=False)
    instruments = None if command is None else source.instruments(command, data)
    second = None if validate is None else _rows(source, read_log(robot, validate))
    lost: LossFit | None = None
    if losses is None:
        fit, constants = _estimated(robot, sought, data, method, instruments)
    else:
        fit, constants, lost, data, second = _with_losses(robot, source, losses, data, second)
    found = _possible(robot.bodies.size, sought, fit, prior)
    built = _built(robot, found.values, linear, symmetric, () if lost is None else lost.effects)
    why = f"there is no robot with these numbers: {built}" if isinstance(built, ModelError) else ""
    return Identification(
        robot=robot,
        built=built,
        effects=effects,
        method=method,
        names=model.names,
        values=fit.x,
        deviation=fit.deviation,
        of_file=model.combination @ base.standard.values,
        of_robot=model.combination @ found.values,
        standard=dict(zip(base.standard.names, found.values.tolist(), strict=True)),
        constants=constants,
        noise=fit.sigma,
        condition=fit.condition,
        outliers=float(np.mean(fit.weights < 0.5)),
        fit=_judged(data, fit, constants, fit.weights),
        validation=None if second is None else _judged(second, fit, constants),
        constrained=found.constrained,
        never=base.never,
        losses=lost,
        remarks=(*data.log.remarks, *(text for text in (found.remark, why) if text)),
    )


def _rows(source: LogSource, log: Log) -> LogRows:
    """Return the rows of a log, in the units that it says it has."""
    check_log(source, log)
    return source.rows(log)


def _built(
    robot: HybridRobot, values: Array, effects: Choice, symmetric: bool, losses: Sequence[Any]
) -> HybridRobot | ModelError:
    """Build the robot with standard parameters and losses, or return the error why there is none."""
    try:
        built = with_parameters(robot, values, effects=effects, symmetric=symmetric)
        return with_losses(built, losses) if losses else built
    except HybridynError as error:
        return error if isinstance(error, ModelError) else ModelError(str(error))


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


def _check_losses(losses: SoughtLosses | None, method: str) -> None:
    """Check that losses that grow with load are estimated by least squares.

    Raises:
        ModelError: They are not.
    """
    if losses is not None and method != "wls":
        raise ModelError(f"losses that grow with load are estimated by the method 'wls', not '{method}'")


def _with_losses(
    robot: HybridRobot, source: LogSource, losses: SoughtLosses, data: LogRows, second: LogRows | None
) -> tuple[Fit, None, LossFit, LogRows, LogRows | None]:
    """Estimate base parameters and losses; return rows of both motions whose known efforts hold these.

    Raises:
        ModelError: The log has currents.
    """
    if data.log.currents:
        raise ModelError(
            "the log has currents, and losses take efforts: multiply the currents by the motors' constants "
            "and call them efforts", file=data.log.file,
        )  # fmt: skip
    sought, own = source.sought, source.sought.model.names
    plain = estimate(data.Y, data.measured - data.known, own, together=data.together)
    moves = sought.followed(robot.bodies.size, plain.x)
    lossy = LossyRows.of(source, losses, moves, data)
    other = None if second is None else LossyRows.of(source, losses, moves, second)
    found, lost = fit_losses(robot, lossy, other, (*own, *losses.names(robot)))
    part = slice(len(own))
    fit = replace(found, x=found.x[part], root=found.root[part])
    seen = None if other is None else other.with_losses(found.x)
    return fit, None, lost, lossy.with_losses(found.x), seen


def _judged(data: LogRows, fit: Fit, constants: Array | None, weights: Array | None = None) -> Residuals:
    """Judge what an estimate leaves over of a motion."""
    efforts = data.measured if constants is None else data.of_each @ constants[0]
    white = Whitening.of(np.tile(fit.sigma, (len(efforts), 1)), data.together)
    noise = white.back(white(efforts - data.known - data.Y @ fit.x))
    return residuals(data.time, efforts, noise, weights)


def _estimated(
    robot: HybridRobot, sought: Sought, data: LogRows, method: str, instruments: Array | None
) -> tuple[Fit, Array | None]:
    """Estimate the base parameters and, from currents, the constant of each motor."""
    own, together = sought.model.names, data.together
    if not data.log.currents:
        return estimate(data.Y, data.measured - data.known, own, method, instruments, together), None
    if not data.known.any(axis=0).all():
        raise TrajectoryError(
            "the log has currents, and efforts per current scale with all parameters: name some that are "
            "known, of each motor's load (known=['* of platform'] after weighing it), or multiply the "
            "currents by the motors' constants and call them efforts", file=data.log.file,
        )  # fmt: skip
    names = [*own, *(f"constant of {motor}" for motor in robot.motors)]
    more = None if instruments is None else np.concatenate([instruments, -data.of_each], axis=2)
    Y = np.concatenate([data.Y, -data.of_each], axis=2)
    fit = estimate(Y, -data.known, names, method, more, together)
    constants = np.stack([fit.x, fit.deviation])[:, len(own) :]
    part = slice(len(own))
    return replace(fit, x=fit.x[part], root=fit.root[part]), constants


def _possible(length: float, sought: Sought, fit: Fit, weight: float) -> Possible:
    """Compute standard parameters of a robot that can exist."""
    model, standard, unit = sought.model, sought.model.standard, sought.units(length, fit.x)
    values = standard.values
    least, bodies = np.full(len(values), -np.inf), list[Index]()
    for term in standard.terms:
        if term.symbol != "offset":
            least[term.columns] = 0.0
    for at in standard.tens:
        if unit[at].all() or (unit[at].any() and exists(values[at])):
            bodies.append(at)
        else:  # a body that cannot exist in the file, either
            least[at[0]] = DEFINITE * values[at[0]]
    least[unit == 0] = -np.inf
    steps = sought.moved(np.diag(unit))[:, unit > 0]
    return consistent(model.combination, fit.x, fit.root, values, steps, bodies, least, weight=weight)
