"""Arithmetic of the oracle: double precision, the machine's longest numbers, or any number of digits.

Each provides elementary functions, the solution of square systems, and a rank-revealing factorisation. Arrays
are NumPy arrays of floats or of mpmath numbers.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[Any]


class Factor(NamedTuple):
    """Rank-revealing factors `A = U inverse^-1 V^T`, with U and V orthonormal and Z the null space of A."""

    U: Numbers
    inverse: Numbers
    V: Numbers
    Z: Numbers

    def least_norm(self, b: Numbers) -> Numbers:
        """Compute the least-norm least-squares solution of `A x = b`."""
        x: Numbers = self.V @ (self.inverse @ (self.U.T @ b))
        return x

    def least_norm_normal(self, b: Numbers) -> Numbers:
        """Compute the least-norm solution of `A^T A x = b`."""
        x: Numbers = self.V @ (self.inverse @ (self.inverse.T @ (self.V.T @ b)))
        return x


class Float64:
    """IEEE double precision; rank from singular values."""

    epsilon = float(np.finfo(float).eps)
    sin, cos = staticmethod(math.sin), staticmethod(math.cos)
    sqrt, atan2 = staticmethod(math.sqrt), staticmethod(math.atan2)
    tanh, exp = staticmethod(math.tanh), staticmethod(math.exp)

    def array(self, values: Any) -> Numbers:
        """Copy `values` into an array of this arithmetic."""
        return np.array(values, dtype=float)

    def factor(self, A: Numbers, tolerance: float, largest: float = 0.0) -> Factor:
        """Factor A by SVD; drop singular values up to `tolerance` x the largest one (or `largest`)."""
        U, s, Vt = np.linalg.svd(A, full_matrices=True)
        rank = int(np.sum(s > tolerance * max(s[0], largest))) if s.size else 0
        return Factor(U[:, :rank], np.diag(1.0 / s[:rank]), Vt[:rank].T, Vt[rank:].T)

    def solve(self, A: Numbers, B: Numbers) -> Numbers:
        """Solve the square system `A X = B`."""
        return np.linalg.solve(A, B)


class Extended:
    """Arrays of mpmath numbers; rank from a column-pivoted Householder QR.

    Args:
        mp: An mpmath context with its precision set (`mpmath.mp`, `mp.dps = 50`).
    """

    def __init__(self, mp: Any) -> None:
        self.mp = mp
        self.epsilon = float(mp.eps)
        self.sin, self.cos, self.sqrt, self.atan2 = mp.sin, mp.cos, mp.sqrt, mp.atan2
        self.tanh, self.exp = mp.tanh, mp.exp

    def array(self, values: Any) -> Numbers:
        """Copy `values` into an array of this arithmetic, each number exactly."""
        source = np.asarray(values)
        numbers = [x if isinstance(x, self.mp.mpf) else self.mp.mpf(float(x)) for x in source.flat]
        out = np.empty(len(numbers), dtype=object)
        out[:] = numbers
        return out.reshape(source.shape)

    def factor(self, A: Numbers, tolerance: float, largest: float = 0.0) -> Factor:
        """Factor A by two QR; drop pivots up to `tolerance` x the largest one (or `largest`)."""
        Q, R, order, rank = self._qr(A, tolerance, largest)
        W, S, turned, _ = self._qr(R[:rank].T, 0.0, 0.0)
        V = np.empty_like(W)
        V[order] = W
        lower = S[:rank].T  # R^T = W S P^T, so A = (Q P) lower (order^-1 W)^T
        inverse = self.array(np.eye(rank))
        for i in range(rank):
            inverse[i] = (
                (inverse[i] - lower[i, :i] @ inverse[:i]) / lower[i, i] if i else inverse[i] / lower[0, 0]
            )
        return Factor(Q[:, :rank][:, turned], inverse, V[:, :rank], V[:, rank:])

    def solve(self, A: Numbers, B: Numbers) -> Numbers:
        """Solve the square system `A X = B` by Gaussian elimination with row pivots."""
        A, X, count = A.copy(), B.copy(), len(A)
        for k in range(count):
            i = k + max(range(count - k), key=lambda j: abs(A[k + j, k]))
            A[[k, i]], X[[k, i]] = A[[i, k]], X[[i, k]]
            for j in range(k + 1, count):
                if A[j, k]:
                    factor = A[j, k] / A[k, k]
                    A[j, k + 1 :] = A[j, k + 1 :] - factor * A[k, k + 1 :]
                    X[j] = X[j] - factor * X[k]
        for i in reversed(range(count)):
            X[i] = ((X[i] - A[i, i + 1 :] @ X[i + 1 :]) if i + 1 < count else X[i]) / A[i, i]
        return X

    def _qr(self, A: Numbers, tolerance: float, largest: float) -> tuple[Numbers, Numbers, list[int], int]:
        """Compute Q (square), R, the column order and the rank of `A[:, order] = Q R`."""
        rows, columns = A.shape
        R, Q, order = A.copy(), self.array(np.eye(rows)), list(range(columns))
        rank = 0
        for k in range(min(rows, columns)):
            norms = [R[k:, j] @ R[k:, j] for j in range(k, columns)]
            best = max(range(len(norms)), key=norms.__getitem__)
            norm = self.sqrt(norms[best])
            largest = max(norm, largest)
            if norm == 0 or norm <= tolerance * largest:
                break
            j = k + best
            R[:, [k, j]], order[k], order[j] = R[:, [j, k]], order[j], order[k]
            w = R[k:, k].copy()
            w[0] += norm if w[0] >= 0 else -norm
            w = w / self.sqrt(w @ w)
            R[k:] = R[k:] - 2 * np.outer(w, w @ R[k:])
            Q[:, k:] = Q[:, k:] - 2 * np.outer(Q[:, k:] @ w, w)
            rank = k + 1
        return Q, R, order, rank


class Long(Extended):
    """Arrays of `numpy.longdouble`, factored like mpmath's numbers and much faster."""

    def __init__(self) -> None:
        self.epsilon = float(np.finfo(np.longdouble).eps)
        self.sin, self.cos, self.sqrt, self.atan2 = np.sin, np.cos, np.sqrt, np.arctan2
        self.tanh, self.exp = np.tanh, np.exp

    def array(self, values: Any) -> Numbers:
        """Copy `values` into an array of this arithmetic, each number exactly."""
        return np.array(values, dtype=np.longdouble)


Arithmetic = Float64 | Extended


def cross(a: Numbers, b: Numbers) -> Numbers:
    """Compute the cross product of two 3-vectors in any arithmetic."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()  # floats are three times as quick as NumPy's own numbers
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
