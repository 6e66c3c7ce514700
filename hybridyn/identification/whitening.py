"""Efforts as rows whose noise has deviation one: of redundant motors, of what they do together.

Redundant motors may work against each other, by efforts that the model does not tell. What they do together
is Pi tau, with a projector Pi of rank d < motors (`regressor.done_together`). With D the deviations of the
motors' noise and the singular values Pi D = U S V^T, the d rows S^-1 U^T (tau - Y x) have noise of deviation
one. What they say of the noise itself is D V V^T D^-1 (tau - Y x).
"""

from dataclasses import dataclass

import numpy as np

from ..spatial import Array


@dataclass(frozen=True, eq=False)
class Whitening:
    """Rows whose noise has deviation one, of efforts whose noise has given ones.

    Attributes:
        deviation: Deviation of the noise of each sample, shape (T, motors).
        rows: Matrix from efforts to rows, shape (T, d, motors), or None where each motor has its own.
        seen: Part of each motor's variance that the rows see, shape (T, motors).
    """

    deviation: Array
    rows: Array | None
    seen: Array

    @classmethod
    def of(cls, deviation: Array, together: Array | None) -> "Whitening":
        """Return it for noise of given deviation, shape (T, motors), and what motors do together."""
        if together is None:
            return cls(deviation, None, np.ones_like(deviation))
        rank = driven(together, deviation.shape[1])
        U, s, Vt = np.linalg.svd(together * deviation[:, None, :], full_matrices=False)
        rows = np.swapaxes(U[:, :, :rank], 1, 2) / s[:, :rank, None]
        return cls(deviation, rows, np.sum(Vt[:, :rank] ** 2, axis=1))

    def __call__(self, values: Array) -> Array:
        """Return the rows of efforts, shape (T, motors, ...), as (T d, ...)."""
        if self.rows is None:
            at = (...,) + (None,) * (values.ndim - 2)
            white = values / self.deviation[at]
        else:
            white = np.einsum("tdm,tm...->td...", self.rows, values)
        return white.reshape(-1, *values.shape[2:])

    def back(self, white: Array) -> Array:
        """Return what rows, shape (T d, ...), say of the noise of each motor, shape (T, motors, ...)."""
        T = len(self.deviation)
        white = white.reshape(T, -1, *white.shape[1:])
        own = (...,) + (None,) * (white.ndim - 2)
        if self.rows is None:
            return np.asarray(white * self.deviation[own])
        return np.asarray(np.einsum("tdm,td...->tm...", self.rows, white) * self.deviation[own] ** 2)


def driven(together: Array | None, motors: int) -> int:
    """Return the number of independent rows: the rank of Pi, or the motors themselves."""
    return motors if together is None else round(float(np.trace(together, axis1=1, axis2=2).max()))
