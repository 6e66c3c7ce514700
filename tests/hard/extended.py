"""Arithmetic of more digits than double precision, on arrays: NumPy's long double, or mpmath numbers.

`LONG` has a mantissa of 64 bits where the machine has one (rounding 1.1e-19: errors of 1e-13 are known to six
digits); `multiprecision` has as many digits as one likes, and is a thousand times slower.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

Numbers = Any  # arrays of one arithmetic


@dataclass(frozen=True)
class Arithmetic:
    """What is computed in: how numbers get in, and what NumPy does not know of them."""

    array: Callable[[Any], Numbers]
    sin: Callable[[Numbers], Numbers]
    cos: Callable[[Numbers], Numbers]


LONG = Arithmetic(lambda x: np.array(x, dtype=np.longdouble), np.sin, np.cos)
needs_long_double = pytest.mark.skipif(
    np.finfo(np.longdouble).eps > 2e-19, reason="long double is no longer than double on this machine"
)


def multiprecision(mp: Any) -> Arithmetic:
    """Return arithmetic of an mpmath context, of as many digits as that has."""
    enter = np.frompyfunc(lambda x: x if isinstance(x, mp.mpf) else mp.mpf(float(x)), 1, 1)
    return Arithmetic(
        lambda x: np.array(enter(np.asarray(x)), dtype=object),
        np.frompyfunc(mp.sin, 1, 1),
        np.frompyfunc(mp.cos, 1, 1),
    )


def mul(A: Numbers, x: Numbers) -> Numbers:
    """Return matrices times vectors, (..., m, n), (..., n)."""
    return (A @ x[..., None])[..., 0]


def turned(A: Numbers) -> Numbers:
    """Return transposes."""
    return np.swapaxes(A, -1, -2)


def hat(r: Numbers) -> Numbers:
    """Return the matrices of r x, (..., 3, 3)."""
    columns = [np.cross(r, np.broadcast_to(np.eye(3, dtype=int)[i], r.shape)) for i in range(3)]
    return np.stack(columns, axis=-1)


def solve(A: Numbers, B: Numbers) -> Numbers:
    """Solve A X = B by Gauss with row pivoting, (..., n, n), (..., n, k)."""
    n, k = A.shape[-1], B.shape[-1]
    shape = A.shape[:-2]
    M = np.concatenate([A, B], axis=-1).reshape(-1, n, n + k)
    batch = np.arange(len(M))
    for i in range(n):
        best = i + np.argmax(np.abs(M[:, i:, i].astype(float)), axis=1)
        M[batch, i], M[batch, best] = M[batch, best], M[batch, i].copy()
        factors = M[:, i + 1 :, i] / M[:, i, None, i]
        M[:, i + 1 :] = M[:, i + 1 :] - factors[..., None] * M[:, i, None]
    X = M[:, :, n:]
    for i in reversed(range(n)):
        X[:, i] = X[:, i] / M[:, i, i, None]
        X[:, :i] = X[:, :i] - M[:, :i, i, None] * X[:, i, None]
    return X.reshape(*shape, n, k)


def reach(p: Numbers) -> Numbers:
    """Give the acceleration of a point p of a body, and its angular one, over those of the body's origin."""
    eye = np.broadcast_to(np.eye(3, dtype=int), (*p.shape, 3)) + 0 * p[..., None]
    return np.concatenate(
        [np.concatenate([eye, -hat(p)], axis=-1), np.concatenate([0 * eye, eye], axis=-1)], axis=-2
    )


def block(mass: Numbers, inertia: Numbers) -> Numbers:
    """Return 6-D inertias about centres of mass; mass (..., 3), each the same."""
    eye = np.broadcast_to(np.eye(3, dtype=int), inertia.shape)
    none = 0 * inertia
    return np.concatenate(
        [np.concatenate([eye * mass[..., None], none], axis=-1), np.concatenate([none, inertia], axis=-1)],
        axis=-2,
    )


def double(R: Numbers) -> Numbers:
    """Return the 6 x 6 rotation of twists."""
    none = 0 * R
    return np.concatenate([np.concatenate([R, none], axis=-1), np.concatenate([none, R], axis=-1)], axis=-2)
