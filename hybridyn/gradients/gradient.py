"""What gradients are given and return."""

from __future__ import annotations

from typing import NamedTuple

from ..spatial import Array


class Gradient(NamedTuple):
    """A model's result and its derivative over parameters.

    Attributes:
        value: The result, shape (n,) or (T, n); that of `mass_matrix`, shape (N, N) or (T, N, N).
        over: Its derivative, with one more axis of length k at the end, or that of its weighted sum, shape
            (k,) or (T, k). Those of numbers that open a loop are NaN.
        condition: Largest condition number of the rows of loops, over the samples. The relative error of
            derivatives is about this times the rounding.
    """

    value: Array
    over: Array
    condition: float


class MeasureBars(NamedTuple):
    """Derivatives of a sum over a motion and its efforts, a sample a row.

    Attributes:
        q: Over the freedoms of positions, shape (T, nv).
        v, a: Over rates and accelerations, shape (T, nv) each.
        tau: Over efforts, shape (T, motors).
        links: Over the motion of links in the world, by link, shape (T, 15): position, velocity, angular
            velocity, acceleration of the origin and angular acceleration.
    """

    q: Array
    v: Array
    a: Array
    tau: Array
    links: dict[str, Array]


class MeasureGradients(NamedTuple):
    """Gradients of sums over a motion.

    Attributes:
        efforts: The efforts, shape (T, motors).
        over: Derivatives of each sum, shape (sums, n).
        closing: Smallest singular value of the rows of loops, without units, over the samples.
        closing_over: Its derivative, shape (n,).
        conditioning: Least part that the smallest singular value is of the largest, over the samples.
        conditioning_over: Its derivative, shape (n,).
    """

    efforts: Array
    over: Array
    closing: float
    closing_over: Array
    conditioning: float
    conditioning_over: Array
