"""Estimates of losses that grow with load, and whether the motion tells them from constant friction.

Gauss-Newton: around an estimate, efforts are linear in base parameters and coefficients, and an estimator of
the linear model takes its step. It starts without losses, so that it does not depend on a guess.

The model with losses is compared with the one without, in which constant friction takes their place, by
Schwarz's criterion BIC = sum over motors of T ln(residual^2) + parameters ln(rows), and by what both leave of
samples that they have not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..dynamics.load_friction import check_jamming
from ..effects.gears import GearEfficiency
from ..effects.load_friction import LoadFriction
from ..errors import ActuationError, TrajectoryError
from ..spatial import Array
from ..structure.robot import HybridRobot
from .estimators import AGREED, MOST_ROUNDS, Fit, estimate
from .losses import LossRows, SoughtLosses, loss_rows
from .rows import LogRows, LogSource
from .signals import means
from .whitening import Whitening

#: Difference of BIC from which one model is far better than another: Kass & Raftery (1995), "very strong".
CLEAR = 10.0
#: A coefficient below so many of its deviations may be zero.
SURE = 3.0
#: How often a step of the estimate is halved at most.
HALVINGS = 12
#: Part of the largest effort by which a step of the estimate may change efforts that are computed exactly.
ROUNDED = 256 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class LossFit:
    """Coefficients of losses that grow with load, and whether the motion tells them.

    Attributes:
        names: Name of each: "radial of elbow" as in `LoadFriction`, "loss of drive" for 1 / efficiency - 1.
        values: Estimates, shape (n,), [m], [1/m] or without unit.
        deviation: Standard deviation of each, shape (n,).
        hidden: How many times smaller the deviation would be if all else were known, shape (n,): from 10 on,
            other parameters nearly take the coefficient's place.
        effects: The effects with these coefficients; negative ones count as zero.
        bic: By how much BIC is lower than without these losses; above 10 the motion clearly tells them.
        unseen: What the models without and with losses leave of efforts that they have not seen, over these:
            of the second motion, or of each half of the motion by the other; None where halves are too short.
    """

    names: tuple[str, ...]
    values: Array
    deviation: Array
    hidden: Array
    effects: tuple[LoadFriction | GearEfficiency, ...]
    bic: float
    unseen: tuple[float, float] | None

    @property
    def told(self) -> bool:
        """Whether the motion tells these losses from constant friction, also on unseen samples."""
        return self.bic > CLEAR and (self.unseen is None or self.unseen[1] < self.unseen[0])

    def lines(self) -> list[str]:
        """Say what the motion tells of them, a line each."""
        out = [
            f"losses that grow with load: BIC is {abs(self.bic):.4g} {'lower' if self.bic > 0 else 'higher'}"
        ]
        if self.unseen is not None:
            without, with_losses = self.unseen
            out[0] += f", {with_losses:.2%} of unseen efforts is left over, and {without:.2%} without them"
        said = "the motion tells them" if self.told else "the motion does not tell them"
        out[0] += f": {said} from constant friction"
        if vague := [name for name, x, off in self._each if x < SURE * off]:
            out.append(f"may be zero, below {SURE:g} deviations: {', '.join(f'`{name}`' for name in vague)}")
        return out

    @property
    def _each(self) -> list[tuple[str, float, float]]:
        return [*zip(self.names, self.values.tolist(), self.deviation.tolist(), strict=True)]


@dataclass(frozen=True, eq=False)
class LossyRows:
    """Rows of a log and of its losses.

    Attributes:
        data: Thinned rows without losses.
        rows: All samples.
        every: Samples that are averaged.
    """

    data: LogRows
    rows: LossRows
    every: int

    @classmethod
    def of(cls, source: LogSource, losses: SoughtLosses, moves: Array, data: LogRows) -> LossyRows:
        """Compute the rows of a log; `moves` as in `loss_rows`."""
        q, v, a = source.closed(data.log.motion, None)
        Y, known, _ = source.of_states(q, v, a)
        rows = loss_rows(source.robot, source.sought, losses, moves, q, v, a, Y, known)
        return cls(data, rows, source.every_of(data.log))

    def predicted(self, p: Array) -> tuple[Array, Array]:
        """Compute efforts and their derivatives by all parameters, thinned, (T, motors), (T, motors, p)."""
        tau, slope = self.rows.predicted(*np.split(p, [len(self.rows.start)]))
        return means(tau, self.every), means(slope, self.every)

    def with_losses(self, p: Array) -> LogRows:
        """Return the thinned rows, with the efforts of losses among what is known."""
        x = p[: len(self.rows.start)]
        return replace(self.data, known=self.predicted(p)[0] - self.data.Y @ x)

    def fit(self, names: Sequence[str], part: slice = slice(None)) -> Fit:
        """Estimate base parameters and coefficients from a part of the rows.

        Raises:
            TrajectoryError: The motion does not tell one, or the iteration does not settle.
            ActuationError: Friction does not settle on the way.
        """
        measured = self.data.measured[part]
        plain = estimate(self.data.Y[part], measured - self.data.known[part], names[: len(self.rows.start)])
        p = np.concatenate([plain.x, np.zeros(len(names) - len(plain.x))])
        for _ in range(MOST_ROUNDS):
            tau, slope = (x[part] for x in self.predicted(p))
            found = estimate(slope, measured - tau + slope @ p, names)
            step = found.x - p
            if (np.abs(step) <= AGREED * found.deviation).all():
                return found
            nearer = self._nearer(p, step, found.sigma, part)
            if nearer is None and np.abs(slope @ step).max() <= ROUNDED * np.abs(tau).max():
                return found
            if nearer is None:
                raise self._unsettled(
                    names, step / found.deviation, f"and no {2.0**-HALVINGS:g} of that helps"
                )
            p = nearer
        raise self._unsettled(names, step / found.deviation, f"after {MOST_ROUNDS} rounds")

    def _nearer(self, p: Array, step: Array, sigma: Array, part: slice) -> Array | None:
        """Take the longest of a step, its half, its quarter, ... that leaves less of the efforts than p.

        Args:
            sigma: Deviation of each motor's noise for which the step was estimated, shape (motors,).

        Returns:
            Where it leads; None if none of them leaves less.
        """
        before = self._left_over(p, sigma, part)
        for halved in range(HALVINGS):
            nearer: Array = p + step / 2**halved
            if self._left_over(nearer, sigma, part) < before:
                return nearer
        return None

    def _left_over(self, p: Array, sigma: Array, part: slice) -> float:
        """Return the squares that are left over the variances of motors, summed, inf where friction jams."""
        try:
            left = (self.data.measured - self.predicted(p)[0])[part] / sigma
        except ActuationError:
            return float("inf")
        return float(np.sum(left**2))

    def _unsettled(self, names: Sequence[str], step: Array, why: str) -> TrajectoryError:
        """Return the error that names the loss that still moves most, from a step in deviations."""
        moved = np.abs(step[len(self.rows.start) :])
        return TrajectoryError(
            f"losses that grow with load do not settle: '{names[int(np.argmax(moved)) - len(moved)]}' still "
            f"moves by {np.max(moved):.3g} deviations {why}; leave it out, or record a motion under other "
            "loads"
        )


def fit_losses(
    robot: HybridRobot, lossy: LossyRows, second: LossyRows | None, names: Sequence[str]
) -> tuple[Fit, LossFit]:
    """Estimate base parameters and coefficients, and compare with the model without losses.

    Args:
        robot: The robot.
        lossy: The rows of the motion.
        second: Those of a second motion, or None.
        names: Names of base parameters, then of coefficients.

    Raises:
        TrajectoryError, ActuationError: As `LossyRows.fit`, and joints may jam with these coefficients.
    """
    data, r = lossy.data, len(lossy.rows.start)
    found = lossy.fit(names)
    losses, c, T = lossy.rows.losses, found.x[r:], len(data.measured)
    if losses.load is not None:
        law = losses.load._replace(factor=np.maximum(c[: len(losses.load.words)], 0.0))
        check_jamming(law, lossy.rows.of_friction)
    plain = estimate(data.Y, data.measured - data.known, names[:r])
    squares = [np.sum(fit.residual**2, axis=0) for fit in (plain, found)]
    rows = T * data.measured.shape[1]
    bic = float(T * np.sum(np.log(squares[0] / squares[1])) - len(c) * np.log(rows))
    slope = Whitening.of(np.tile(found.sigma, (T, 1)), None)(lossy.predicted(found.x)[1])[:, r:]
    hidden = found.deviation[r:] * np.linalg.norm(slope, axis=0)
    return found, LossFit(
        tuple(names[r:]), c, found.deviation[r:], hidden, losses.as_effects(robot, c), bic,
        _unseen(lossy, second, names, plain, found),
    )  # fmt: skip


def _unseen(
    lossy: LossyRows, second: LossyRows | None, names: Sequence[str], plain: Fit, found: Fit
) -> tuple[float, float] | None:
    """Compute what both models leave of efforts that they have not seen, over these."""
    r, half = len(lossy.rows.start), len(lossy.data.measured) // 2
    if second is not None:
        return _relative(second.data.measured, *_left(second, plain.x, found.x, slice(None)))
    left = list[tuple[Array, Array]]()
    try:
        for seen, hidden in ((slice(half), slice(half, None)), (slice(half, None), slice(half))):
            data = lossy.data
            known = estimate(data.Y[seen], (data.measured - data.known)[seen], names[:r]).x
            left.append(_left(lossy, known, lossy.fit(names, seen).x, hidden))
    except (ActuationError, TrajectoryError):  # of half a motion
        return None
    both = (np.concatenate(parts) for parts in zip(*left, strict=True))
    return _relative(lossy.data.measured, *both)


def _left(lossy: LossyRows, plain: Array, found: Array, part: slice) -> tuple[Array, Array]:
    """Return what both models leave of a part of the rows, shape (T, motors)."""
    data = lossy.data
    without = data.measured - data.known - data.Y @ plain
    return without[part], (data.measured - lossy.predicted(found)[0])[part]


def _relative(measured: Array, *left: Array) -> tuple[float, float]:
    """Return RMS over motors of what is left over the RMS effort of each, for both models."""
    size = np.sqrt(np.mean(measured**2, axis=0))
    first, second = (float(np.sqrt(np.mean(np.mean(x**2, axis=0) / size**2))) for x in left)
    return first, second
