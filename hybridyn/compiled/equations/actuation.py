"""Solve for motor efforts from the generalised force along each motion: B tau = Q, Eq. (33)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from ...dynamics.guards import UNDRIVEN
from ...spatial import Array
from .expressions import Expression, along, dot, is_zero, times, zeros
from .guards import Scale, least_trusted, trusted, weighed
from .static_elimination import Pivots, solve


def motor_efforts(
    B: Expression, Q: Expression, terms: tuple[Any, Array, Scale], share: Array, pivots: Pivots | None
) -> tuple[Expression, Any]:
    """Compute the efforts of a module's motors and the guard of the motor map.

    Args:
        B: Work of each motor along each motion, shape (N, motors).
        Q: Required generalised force, shape (N,).
        terms: The size of the terms of Q as work per scaled coordinate [N m], the unit of each motion,
            shape (N,), and the scales of closure residuals.
        share: Each motor's share of the load if there are more motors than motions, shape (motors,).
        pivots: Pivots of B (`motor_pivots`); not read if there are more motors than motions.
    """
    N, motors = B.shape
    if not motors:
        return zeros(0), _undriven(Q, *terms)
    if motors > N:
        return _least_norm(B, Q, share)
    if pivots is None:  # B is singular at every posture: the general path raises the error
        return zeros(motors), ca.SX(np.inf)
    X, trust = solve(B, Q[:, None], pivots)
    guard = trusted(trust)
    if motors < N:
        guard = guard + _undriven(Q - dot(B, X[:, 0]), *terms)
    return X[:, 0], guard


def _undriven(left: Expression, size: Any, units: Array, scale: Scale) -> Any:
    """Return the guard of generalised forces that no motor can produce."""
    if all(is_zero(x) for x in left):
        return ca.SX(0.0)
    limits = replace(scale, closed=min(scale.closed, UNDRIVEN))
    return weighed([(left * units, 1.0)], limits.weight(size))


def _least_norm(B: Expression, Q: Expression, share: Array) -> tuple[Expression, Any]:
    """Compute tau of least |tau / share| with B tau = Q by a Householder LQ factorisation of B share."""
    N, motors = B.shape
    A = np.array([[times(B[i, j], float(share[j])) for i in range(N)] for j in range(motors)], dtype=object)
    reflections: list[tuple[Expression, Any]] = []
    R = zeros(N, N)
    for k in range(N):
        norm = ca.sqrt(ca.SX(along(A[k:, k], A[k:, k])))  # of plain numbers, too, where B is constant
        signed = ca.if_else(A[k, k] < 0, norm, -norm)
        h = A[k:, k].copy()
        h[0] = h[0] - signed
        scale = -1.0 / (signed * h[0])  # 2 / h'h, h'h = -2 signed h_0
        reflections.append((h, scale))
        R[k, k] = signed
        for j in range(k + 1, N):
            factor = times(scale, along(h, A[k:, j]))
            A[k:, j] = A[k:, j] - [times(factor, x) for x in h]
            R[k, j] = A[k, j]
    y = zeros(motors)
    for i in range(N):  # R^T y = Q
        y[i] = (Q[i] - (along(R[:i, i], y[:i]) if i else 0.0)) / R[i, i]
    for k in reversed(range(N)):
        h, scale = reflections[k]
        factor = times(scale, along(h, y[k:]))
        y[k:] = y[k:] - [times(factor, x) for x in h]
    small: Any = ca.SX(np.inf)
    big: Any = ca.SX(0.0)
    for k in range(N):
        small, big = ca.fmin(small, ca.fabs(R[k, k])), ca.fmax(big, ca.fabs(R[k, k]))
    tau = np.array([times(float(s), x) for s, x in zip(share, y, strict=True)], dtype=object)
    return tau, least_trusted(ca.if_else(big > 0, small / big, 0.0))  # fmax would ignore the NaN of 0 / 0
