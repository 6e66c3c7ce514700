"""Tests of residuals: whether what the model leaves over is noise.

The cumulative periodogram of white noise is a straight line; its largest distance from the line has
Kolmogorov's distribution (Bartlett). A friction that was left out, or a payload that was not told, moves with
the motion: its power stands at low frequencies, and the distance grows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal
from scipy.special import kolmogorov

from ..spatial import Array, Mask

#: Probability below which a residual is not noise, shared among the motors (Bonferroni).
SIGNIFICANT = 1e-3


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a model leaves over of a motion, judged.

    Attributes:
        time: Times, shape (T,), [s].
        measured: Efforts, shape (T, motors).
        residual: Measured less predicted efforts, shape (T, motors).
        relative: RMS of the residual over that of the effort, shape (motors,).
        frequency: Frequencies of the spectrum, shape (F,), [Hz].
        spectrum: Power density of the residual, shape (F, motors).
        cumulative: Its cumulative share, shape (F, motors): a straight line for white noise.
        probability: Probability of such a spectrum if the residual is white noise, shape (motors,).
    """

    time: Array
    measured: Array
    residual: Array
    relative: Array
    frequency: Array
    spectrum: Array
    cumulative: Array
    probability: Array

    @property
    def coloured(self) -> Mask:
        """Whether each motor's residual is not noise, shape (motors,)."""
        out: Mask = self.probability < SIGNIFICANT / len(self.probability)
        return out


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
        time, measured, residual, relative, frequency, spectrum, cumulative, kolmogorov(np.sqrt(count) * away)
    )
