"""Rank-revealing elimination of batches of small matrices.

`pivoted_qr` is the Householder QR with column pivoting (Businger and Golub). The caller fixes the number of
pivots, since rank is a property of the module and not of the posture. `null_basis` returns every solution
of K x = -gamma. No function forms K^T K or an inverse.
"""

from __future__ import annotations

import numpy as np

from ..spatial import Array, Index, Mask, einsum

#: Pivots of scaled rows below this are rounding.
NO_PIVOT = 1e-13
#: Lower bound on scaled singular values in divisions, so that quotients stay finite.
SMALLEST_SINGULAR_VALUE = 1e-100


def pivoted_qr(A: Array, columns: int, rank: int) -> tuple[Array, Index]:
    """Reduce the first `columns` columns by `rank` Householder steps with column pivoting.

    Args:
        A: Matrices, shape (B, m, n); the columns after the first `columns` are right-hand sides.
        columns: Number of leading columns from which pivots are chosen.
        rank: Number of steps, at most min(m, columns).

    Returns:
        The transformed matrices (B, m, n), with an upper triangular leading (rank, rank) block, and the
        column permutation, shape (B, columns).
    """
    A = A.copy()
    B, m, _ = A.shape
    order = np.empty((B, columns), dtype=int)
    order[:] = np.arange(columns)
    batch = np.arange(B)
    for k in range(rank):
        if columns - k > 1:
            block = A[:, k:, k:columns]
            best = k + einsum("bij,bij->bj", block, block).argmax(axis=1)
            for x in (A.swapaxes(1, 2), order) if (best > k).any() else ():
                left = x[:, k].copy()
                x[:, k] = x[batch, best]
                x[batch, best] = left
        if m - k == 1:
            break
        x = A[:, k:, k].copy()
        norm = np.sqrt(einsum("bi,bi->b", x, x))
        alpha = -np.copysign(norm, x[:, 0])
        x[:, 0] -= alpha
        square = einsum("bi,bi->b", x, x)
        beta = 2.0 / np.where(square > 0, square, np.inf)
        rest = A[:, k:, k + 1 :]
        rest -= x[:, :, None] * (beta[:, None] * einsum("bi,bij->bj", x, rest))[:, None, :]
        A[:, k, k] = alpha
        A[:, k + 1 :, k] = 0.0
    return A, order


def pivot_ratio(R: Array, rank: int, size: Array | None = None) -> Array:
    """Compute the smallest pivot of each reduced matrix over a reference size, shape (B,); 1 if rank is 0.

    Args:
        size: The reference size, shape (B,), where it is known; else the largest pivot, or 1, the size of
            scaled rows, if the largest is rounding, too. A single pivot is always the largest.
    """
    if rank == 0:
        return np.ones(len(R))
    pivots = np.abs(R[:, :rank, :rank].diagonal(axis1=1, axis2=2))
    if size is None:
        largest = pivots.max(axis=1)
        size = np.where(largest > NO_PIVOT, largest, 1.0)
    out: Array = pivots.min(axis=1) / size
    return out


def back_substitute(R: Array, rhs: Array) -> Array:
    """Solve R x = rhs, R (B, r, r) upper triangular, rhs (B, r, c); x_i = 0 if pivot i is exactly zero."""
    x, pivots = rhs.copy(), R.diagonal(axis1=1, axis2=2)
    safe = np.where(pivots == 0.0, np.inf, pivots)
    for i in range(R.shape[1] - 1, -1, -1):
        x[:, i] /= safe[:, i, None]
        if i:
            x[:, :i] -= R[:, :i, i, None] * x[:, i, None, :]
    return x


def surplus(R: Array, columns: int, rank: int) -> Array:
    """Compute the largest entry that is left after `rank` pivots over the first, shape (B,)."""
    left = np.abs(R[:, rank:, rank:columns]).max(axis=(1, 2), initial=0.0)
    out: Array = left / np.where(left > 0, np.abs(R[:, 0, 0]), 1.0) if rank else left
    return out


def null_basis(
    K: Array, gamma: Array, rank: int, size: Array | None = None
) -> tuple[Array, Array, Array, Array]:
    """Compute every solution x = Psi u + x0 of K x = -gamma, for K of the given rank.

    The free coordinates u are the non-pivot columns. Psi therefore contains an identity and stays bounded
    however close K comes to losing rank.

    Args:
        K: Matrices, shape (B, m, n).
        gamma: Right-hand sides, shape (B, m).
        rank: Number of pivots.
        size: Reference size of the pivots, as in `pivot_ratio`.

    Returns:
        Psi, shape (B, n, n - rank), x0, shape (B, n), the ratio of the pivots, and the `surplus`, shape (B,).
    """
    B, _, n = K.shape
    R, order = pivoted_qr(np.concatenate([K, gamma[..., None]], axis=-1), n, rank)
    Y = -back_substitute(R[:, :rank, :rank], R[:, :rank, rank:])
    Z = np.zeros((B, n, n - rank + 1))
    Z[:, :rank] = Y
    Z[:, rank:, :-1] = np.eye(n - rank)
    out = np.empty_like(Z)
    out[np.arange(B)[:, None], order] = Z
    return out[:, :, :-1], out[:, :, -1], pivot_ratio(R, rank, size), surplus(R, n, rank)


def full_rank_solution(A: Array, b: Array, least: float) -> tuple[Array, Mask]:
    """Compute the least-squares solution of A x = b by QR, for A of full column rank.

    There are no pivots: a matrix that is nearly singular can pass, and its x is as large as with an SVD.

    Args:
        A: Matrices, shape (B, m, n), n at most m.
        b: Right-hand sides, shape (B, m).
        least: Smallest ratio of the factor's diagonal entries at which A is not nearly singular.

    Returns:
        The solutions, shape (B, n), and the mask of those that are one, shape (B,): A is not nearly singular.
    """
    n = A.shape[2]
    R = np.asarray(np.linalg.qr(np.concatenate([A, b[..., None]], axis=-1), mode="r"))[:, :n]
    sure = pivot_ratio(R, n) > least
    if not sure.all():
        R[~sure, :, :n] = np.eye(n)
    x: Array = np.linalg.solve(R[..., :n], R[..., n:])[..., 0]
    return x, sure


def size_of_rows(s: Array, tolerance: float) -> Array:
    """Return the reference size for singular values of scaled rows, shape (T, 1).

    This is the largest singular value, or 1 (the size of the rows) if the largest is rounding of the file.
    Two hinges of one door whose axes differ in the last digits, for example, do not lock it.

    Args:
        s: Singular values, largest first, shape (T, values).
        tolerance: Singular values below this are rounding.
    """
    return np.where(s[:, :1] > tolerance, s[:, :1], 1.0)


def least_squares(
    A: Array, b: Array, *, relative: float = 1e-12, rank: int | None = None, damping: Array | None = None
) -> Array:
    """Compute the least-norm least-squares solution of A x = b by truncated SVD.

    Args:
        A: Scaled matrices, shape (B, m, n).
        b: Right-hand sides, shape (B, m) or (B, m, k).
        relative: Singular values above this, relative to `size_of_rows`, are used.
        rank: Number of leading singular values that are used instead.
        damping: Added to the squares of the singular values, in units of the largest square, shape (B,).

    Returns:
        Shape (B, n) or (B, n, k).
    """
    if 0 in A.shape:
        return np.zeros((len(A), A.shape[2], *b.shape[2:]))
    return least_norm(np.linalg.svd(A, full_matrices=False), b, relative=relative, rank=rank, damping=damping)


def least_norm(
    factors: tuple[Array, Array, Array],
    b: Array,
    *,
    relative: float = 1e-12,
    rank: int | None = None,
    damping: Array | None = None,
) -> Array:
    """Compute the solution of `least_squares` from U, s and V^T of A, the reduced or the full ones."""
    U, s, Vt = factors
    U, Vt = U[:, :, : s.shape[1]], Vt[:, : s.shape[1]]
    if rank is None:
        keep = s > relative * size_of_rows(s, relative)
    else:
        keep = (np.arange(s.shape[1]) < rank) & (s > 0)
    each = (..., *[None] * (b.ndim - 2))
    keep, safe, y = keep[each], np.where(keep, s, 1.0)[each], einsum("bji,bj...->bi...", U, b)
    y = y / safe if damping is None else y * (safe / (safe * safe + damping[:, None] * s[:, :1] ** 2))
    x: Array = einsum("bji,bj...->bi...", Vt, np.where(keep, y, 0.0))
    return x


def relative_change(J: Array, change: Array, rank: int) -> Array:
    """Compute the 2-norm of J^-1 change on the leading singular values, shape (T,)."""
    if 0 in J.shape:
        return np.zeros(len(J))
    U, s, Vt = np.linalg.svd(J, full_matrices=False)
    top = np.maximum(s[:, :rank, None], SMALLEST_SINGULAR_VALUE)
    part = np.swapaxes(U[:, :, :rank], 1, 2) @ change @ np.swapaxes(Vt[:, :rank], 1, 2) / top
    out: Array = np.linalg.norm(part, 2, axis=(1, 2))
    return out
