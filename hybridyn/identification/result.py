"""The result of an identification: what is known now, how well, what is not, and whether the rest is noise.

The cumulative periodogram of white noise is a straight line; its largest distance from the line has
Kolmogorov's distribution (Bartlett). A friction that was left out, or a payload that was not told, moves with
the motion: its power stands at low frequencies, and the distance grows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import signal
from scipy.special import kolmogorov

from ..description.names import counted
from ..effects.choice import Choice
from ..errors import ModelError
from ..spatial import Array, Mask
from ..structure.robot import HybridRobot
from .loss_fit import LossFit

#: Probability below which a residual is not noise, shared among the motors (Bonferroni).
SIGNIFICANT = 1e-3
#: Relative standard deviation from which a parameter counts as badly known.
BAD = 0.3
#: Names that a sentence lists.
MOST = 12

#: Head and cells of a column of a table.
Column = tuple[str, Sequence[str]]


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a model leaves over of a motion, judged.

    Attributes:
        time: Times, shape (T,), [s].
        measured: Efforts, shape (T, motors).
        residual: Measured less predicted efforts, shape (T, motors).
        relative: RMS of the residual over that of the effort, shape (motors,).
        frequency: Frequencies of the spectrum, shape (F,), [Hz].
        cumulative: Cumulative share of its power density, shape (F, motors): a straight line for white noise.
        probability: Probability of such a spectrum if the residual is white noise, shape (motors,).
    """

    time: Array
    measured: Array
    residual: Array
    relative: Array
    frequency: Array
    cumulative: Array
    probability: Array

    @property
    def coloured(self) -> Mask:
        """Whether each motor's residual is not noise, shape (motors,)."""
        return np.asarray(self.probability < SIGNIFICANT / len(self.probability))


def residuals(time: Array, measured: Array, residual: Array, weights: Array | None = None) -> Residuals:
    """Judge residuals.

    Args:
        time: Times, shape (T,), [s], evenly apart.
        measured: Efforts, shape (T, motors).
        residual: Measured less predicted efforts, shape (T, motors).
        weights: Weight of each sample, shape (T, motors): outliers count as little as in the estimate.
    """
    own = residual if weights is None else residual * weights
    rate = (len(time) - 1) / (time[-1] - time[0])
    frequency, spectrum = signal.periodogram(own, rate, axis=0)
    frequency, spectrum = frequency[1:], spectrum[1:]
    total = spectrum.sum(axis=0)
    cumulative = np.cumsum(spectrum, axis=0) / np.where(total > 0, total, 1.0)
    count = len(frequency)
    away = np.abs(cumulative - np.arange(1, count + 1)[:, None] / count).max(axis=0)
    size = np.sqrt(np.mean(measured**2, axis=0))
    relative = np.sqrt(np.mean(residual**2, axis=0)) / np.where(size > 0, size, 1.0)
    return Residuals(
        time, measured, residual, relative, frequency, cumulative, kolmogorov(np.sqrt(count) * away)
    )


@dataclass(frozen=True, eq=False, repr=False)
class Identification:
    """Identified parameters, and how far they can be trusted.

    Attributes:
        robot: The robot of the file.
        built: The robot with the identified parameters; or the error why there is none.
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
        losses: Losses that grow with load, or None if none were sought.
        remarks: How the signals were processed.

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> motion = hybridyn.excitation(robot, evaluations=1)
        >>> log = motion.columns(rate=20.0)
        >>> q, v, a = hybridyn.assemble(robot, motors=motion.at(log["time"]))
        >>> tau = hybridyn.idm(robot, q, v, a)
        >>> log |= {f"{name}/effort": tau[:, i] for i, name in enumerate(robot.motors)}
        >>> found = hybridyn.identify(robot, log)
        >>> len(found.names) == len(found.values) == len(found.deviation)
        True
        >>> found.report().splitlines()[0]
        '# Identification of five_bar'
    """

    robot: HybridRobot
    built: HybridRobot | ModelError
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
    losses: LossFit | None
    remarks: tuple[str, ...]

    @property
    def identified(self) -> HybridRobot:
        """The robot with the identified parameters; it can exist.

        Raises:
            ModelError: There is no such robot; all other attributes stand.
        """
        if isinstance(self.built, ModelError):
            raise self.built
        return self.built

    @property
    def relative(self) -> Array:
        """Standard deviation of each base parameter over its magnitude, shape (rank,)."""
        return self.deviation / np.maximum(np.abs(self.values), np.finfo(float).tiny)

    def __repr__(self) -> str:
        """Describe what was done and how well it fits; `report` returns all."""
        return "\n".join([f"Identification of {self.robot.name}", *summary(self)])

    def report(self) -> str:
        """Return a report in Markdown: residuals, parameters with their deviations, what is not known."""
        parts = [
            f"# Identification of {self.robot.name}",
            "\n".join(f"- {line}" for line in summary(self)),
            "## Motors",
            _table(_motors(self)),
            "The probability is that of such a spectrum if the residual were white noise; below "
            f"{SIGNIFICANT / len(self.noise):.1g} the model leaves something out (a friction, a payload, a "
            "flexibility), or noise of the positions is not white in their band.",
            "## Base parameters",
            _table(_parameters(self)),
            *(["## Losses that grow with load", _table(_losses(self.losses))] if self.losses else []),
            "## What is not known",
            "\n\n".join(unknown(self)),
            "## The robot with these parameters",
            _possible(self),
        ]
        return "\n\n".join(parts) + "\n"


def summary(found: Identification) -> list[str]:
    """Return what was done and how well it fits, a line each."""
    size, motors = found.fit.measured.shape
    lines = [
        f"{counted(len(found.values), 'base parameter')} from {counted(size, 'sample')} of "
        f"{counted(motors, 'motor')}, method {found.method}; condition {found.condition:.3g}",
        *found.remarks,
        f"residual: {_percent(found.fit)} of the efforts; {_verdict(found, found.fit)}",
    ]
    if found.validation is not None:
        lines.append(
            f"second motion: {_percent(found.validation)} of the efforts; {_verdict(found, found.validation)}"
        )
    if found.losses is not None:
        lines += found.losses.lines()
    if found.outliers:
        lines.append(f"outliers: {found.outliers:.2%} of the samples count less than half")
    return lines


def unknown(found: Identification) -> list[str]:
    """Return sentences about the parameters that are not known, and why."""
    bad = [name for name, x in zip(found.names, found.relative, strict=True) if x > BAD]
    out = [
        f"{counted(len(bad), 'base parameter')} with a standard deviation above {BAD:.0%}: the motion tells "
        f"little of them, or they are near zero. {_listed(bad)}".strip()
    ]
    if found.never:
        out.append(
            f"{counted(len(found.never), 'standard parameter')} on which no effort of a motor depends, "
            f"whatever the motion: they keep the numbers of the file. {_listed(found.never)}"
        )
    grouped = sum(" + " in name or " - " in name for name in found.names)
    out.append(
        f"{counted(grouped, 'base parameter')} are sums, whose terms no motion tells apart; how a "
        "sum is shared follows the file's numbers."
    )
    return out


def _percent(residuals: Residuals) -> str:
    low, high = residuals.relative.min(), residuals.relative.max()
    return f"{low:.2%} to {high:.2%}"


def _verdict(found: Identification, residuals: Residuals) -> str:
    wrong = [name for name, x in zip(found.robot.motors, residuals.coloured, strict=True) if x]
    return f"it is not white noise at {_listed(wrong)}" if wrong else "it looks like white noise"


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST} more" if len(names) > MOST else ""
    return ", ".join(f"`{name}`" for name in names[:MOST]) + more


def _motors(found: Identification) -> list[Column]:
    """Return the columns of the table of motors."""
    columns: list[Column] = [
        ("motor", [f"`{motor}`" for motor in found.robot.motors]),
        ("noise", [f"{x:.3g}" for x in found.noise]),
        ("unit", found.robot.effort_units),
    ]
    for head, judged in (("residual / effort", found.fit), ("second motion", found.validation)):
        if judged is not None:
            columns.append((head, [f"{x:.2%}" for x in judged.relative]))
            columns.append(("probability", [f"{x:.2g}" for x in judged.probability]))
    if found.constants is not None:
        columns.append(("effort per current", [f"{x:.5g} ± {off:.1g}" for x, off in found.constants.T]))
    return columns


def _parameters(found: Identification) -> list[Column]:
    """Return the columns of the table of base parameters."""
    return [
        ("base parameter", [f"`{name}`" for name in found.names]),
        ("file", [f"{x:.5g}" for x in found.of_file]),
        ("estimate", [f"{x:.5g}" for x in found.values]),
        ("deviation", [f"{x:.2g}" for x in found.deviation]),
        ("relative", [f"{x:.1%}" for x in found.relative]),
        ("possible robot", [f"{x:.5g}" for x in found.of_robot]),
    ]


def _losses(found: LossFit) -> list[Column]:
    """Return the columns of the table of losses."""
    return [
        ("coefficient", [f"`{name}`" for name in found.names]),
        ("estimate", [f"{x:.5g}" for x in found.values]),
        ("deviation", [f"{x:.2g}" for x in found.deviation]),
        ("times larger than if all else were known", [f"{x:.1f}" for x in found.hidden]),
    ]


def _possible(found: Identification) -> str:
    """Return how the robot that can exist differs from the estimate."""
    if isinstance(found.built, ModelError):
        return f"There is no robot with these numbers: {found.built}"
    away = np.abs(found.of_robot - found.values) / np.maximum(found.deviation, np.finfo(float).tiny)
    how = (
        "Some numbers would have been impossible; the conic program found the nearest that are not."
        if found.constrained
        else "All bodies are possible as they were estimated."
    )
    return (
        f"{how} Its base parameters differ from the estimates by at most {away.max():.2g} standard "
        f"deviations (`{found.names[int(away.argmax())]}`)."
    )


def _table(columns: Sequence[Column]) -> str:
    """Write columns as a table in Markdown."""
    heads, cells = zip(*columns, strict=True)
    lines = [heads, ["---"] * len(heads), *zip(*cells, strict=True)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
