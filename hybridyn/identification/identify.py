"""Identify the dynamic parameters of a robot from a measured motion, and judge the result."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..compiled.model import CompiledRobot
from ..description.names import did_you_mean
from ..effects.choice import Choice
from ..errors import ModelError, TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from ..threads import one_thread
from .base_parameters import base_parameters, units
from .consistent import consistent
from .estimators import METHODS, Fit, estimate
from .judging import Residuals, residuals
from .parameters import StandardParameters, standard_parameters, with_parameters
from .rows import LinearModel, Rows, Source, check_robot, check_scales, linear_model
from .signals import read_log

#: Least radius of gyration of a body about its frame that is thought of, of the robot's size.
SMALL = 0.01
TINY = np.finfo(float).tiny


@dataclass(frozen=True, eq=False)
class Identification:
    """Identified parameters, and how far they can be trusted.

    Attributes:
        robot: The robot of the file.
        identified: The robot with the identified parameters; it can exist.
        effects: The effects in the model.
        method: "wls", "irls" or "iv".
        names: Base parameters, as sums of standard parameters, shape (rank,).
        values: Their estimates, shape (rank,), SI units.
        deviation: Standard deviation of each.
        of_file: The numbers of the robot's file.
        of_robot: Those of `identified`.
        standard: All standard parameters of `identified`, by name.
        constants: Effort per current of each motor, and its standard deviation, shape (2, motors), where
            the log has currents; else None.
        noise: Standard deviation of each motor's noise, shape (motors,), [N or N m].
        condition: Condition number of the weighted regressor with scaled columns.
        outliers: Share of samples that count less than half.
        fit: Residuals of the motion that was used.
        validation: Residuals of a second motion, or None.
        constrained: Whether `identified` had to be kept possible by the conic program.
        never: Standard parameters on which no effort depends.
        remarks: How the signals were processed.
    """

    robot: HybridRobot
    identified: HybridRobot
    effects: Choice
    method: str
    names: tuple[str, ...]
    values: Array
    deviation: Array
    of_file: Array
    of_robot: Array
    standard: dict[str, float]
    constants: Array | None
    noise: Array
    condition: float
    outliers: float
    fit: Residuals
    validation: Residuals | None
    constrained: bool
    never: tuple[str, ...]
    remarks: tuple[str, ...]

    @property
    def relative(self) -> Array:
        """Standard deviation of each base parameter over its magnitude, shape (rank,)."""
        return self.deviation / np.maximum(np.abs(self.values), np.finfo(float).tiny)

    def report(self) -> str:
        """Return a report in Markdown: residuals, parameters with their deviations, what is not known."""
        from .report import report

        return report(self)


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
    if method not in METHODS:
        raise ModelError(
            f"there is no method '{method}'{did_you_mean(method, METHODS)}; known: {', '.join(METHODS)}"
        )
    if (method == "iv") != (reference is not None):
        raise ModelError(
            "the method 'iv' takes a reference, the commanded motion, and other methods take none"
        )
    check_robot(robot)
    base = base_parameters(robot, effects=effects, symmetric=symmetric)
    standard = standard_parameters(robot, effects=effects, symmetric=symmetric)
    model = linear_model(base, units(robot, standard), known, only)
    source = Source(robot, model, effects, symmetric, compiled, band, period, every)
    data = source.rows(read_log(robot, table))
    check_scales(source, data)
    instruments = None
    if reference is not None:
        instruments = source.instruments(read_log(robot, reference, efforts=False), data)
    fit, constants = _estimated(robot, model, data, method, instruments)
    count = len(model.names)
    own = replace(fit, x=fit.x[:count], root=fit.root[:count])
    x, constrained = _possible(standard, robot.bodies.size, model, own, prior)

    def judged(data: Rows, weights: Array | None = None) -> Residuals:
        """Judge what the estimate leaves over of a motion."""
        efforts = data.measured if constants is None else data.measured * constants[0]
        return residuals(data.time, efforts, efforts - data.known - data.Y @ fit.x[:count], weights)

    second = None if validate is None else judged(source.rows(read_log(robot, validate)))
    return Identification(
        robot=robot,
        identified=with_parameters(robot, x, effects=effects, symmetric=symmetric),
        effects=effects,
        method=method,
        names=model.names,
        values=fit.x[:count],
        deviation=fit.deviation[:count],
        of_file=model.combination @ base.standard_values,
        of_robot=model.combination @ x,
        standard=dict(zip(base.standard, x.tolist(), strict=True)),
        constants=constants,
        noise=fit.sigma,
        condition=fit.condition,
        outliers=float(np.mean(fit.weights < 0.5)),
        fit=judged(data, fit.weights),
        validation=second,
        constrained=constrained,
        never=base.never,
        remarks=data.log.remarks,
    )


def _estimated(
    robot: HybridRobot, model: LinearModel, data: Rows, method: str, instruments: Array | None
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
    count = len(model.names)
    return fit, np.stack([fit.x[count:], fit.deviation[count:]])


def _possible(
    standard: StandardParameters, length: float, model: LinearModel, fit: Fit, weight: float
) -> tuple[Array, bool]:
    """Compute standard parameters of a robot that can exist, and whether the conic program was needed."""
    values, unit = standard.values, np.abs(standard.values)
    bodies = {tuple(at): at for at in (*standard.bodies.values(), *(at for _, at in standard.payloads))}
    for at in bodies.values():
        about = values[at[[4, 6, 9]]].sum() / 2 / max(values[at[0]], TINY)
        size = np.sqrt(max(about, (SMALL * length) ** 2))
        unit[at] = values[at[0]] * np.repeat([1.0, size, size**2], [1, 3, 6])
    bare = model.columns[unit[model.columns] == 0]  # what the file does not state is as large as it is found
    unit[bare] = np.abs(fit.x[unit[model.columns] == 0]) + TINY
    unit[model.known] = 0.0
    positive = [
        int(i) for term in standard.terms if term.symbol != "offset" for i in term.columns if unit[i] > 0
    ]
    own = [at for at in bodies.values() if unit[at].all()]
    positive += [int(at[0]) for at in bodies.values() if unit[at[0]] and not unit[at].all()]
    return consistent(
        model.combination, fit.x, fit.root, values, unit, own, sorted(set(positive)), weight=weight
    )
