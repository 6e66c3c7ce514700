"""Rank-revealing elimination: factors, null spaces, and what happens when pivots vanish."""

import numpy as np
import pytest

from hybridyn.linkage.elimination import (
    back_substitute,
    full_rank_solution,
    least_squares,
    null_basis,
    pivot_ratio,
    pivoted_qr,
)
from tests.support.comparing import ROUNDING, close_to

BATCH = 20
GROWTH = 100  # largest entry of Psi that a well conditioned draw of this size may reach


def matrices(m: int, n: int, rank: int, seed: int = 0) -> np.ndarray:
    """Draw matrices of a rank and of modest condition."""
    rng = np.random.default_rng([seed, m, n, rank])
    U = np.linalg.qr(rng.normal(size=(BATCH, m, m)))[0][:, :, :rank]
    V = np.linalg.qr(rng.normal(size=(BATCH, n, n)))[0][:, :, :rank]
    return (U * np.linspace(1, 3, rank)) @ np.swapaxes(V, 1, 2)


SHAPES = [(5, 5, 5), (3, 7, 3), (8, 6, 6), (8, 6, 4), (6, 9, 2), (1, 4, 1), (4, 1, 1), (3, 3, 0)]


@pytest.mark.parametrize(("m", "n", "rank"), SHAPES)
def test_pivoted_qr_is_a_factorisation(m: int, n: int, rank: int) -> None:
    """Transformed right-hand sides give Q^T, so A P = Q R can be checked, and the input is left alone."""
    A = matrices(m, n, rank)
    both = np.concatenate([A, np.tile(np.eye(m), (BATCH, 1, 1))], axis=-1)
    kept = both.copy()
    out, order = pivoted_qr(both, n, rank)
    assert np.array_equal(both, kept)
    R, Qt = out[:, :, :n], out[:, :, n:]
    close_to(Qt @ np.swapaxes(Qt, 1, 2), np.tile(np.eye(m), (BATCH, 1, 1)), ROUNDING)
    close_to(np.swapaxes(Qt, 1, 2) @ R, np.take_along_axis(A, order[:, None, :], axis=2), ROUNDING)
    assert np.abs(np.tril(R[:, :, :rank], -1)).max(initial=0.0) < ROUNDING
    assert np.abs(R[:, rank:]).max(initial=0.0) < ROUNDING  # nothing is left below the rank
    assert (np.sort(order, axis=1) == np.arange(n)).all()
    diagonal = np.abs(np.diagonal(R[:, :rank, :rank], axis1=1, axis2=2))
    assert (np.diff(diagonal, axis=1) <= ROUNDING).all()


def test_pivot_ratio_sees_how_close_rank_is_to_falling() -> None:
    A = np.array([np.diag([2.0, 1.0, 1e-9]), np.eye(3), np.zeros((3, 3)), np.diag([1.0, 1.0, 0.0])])
    R, _ = pivoted_qr(A, 3, 3)
    close_to(pivot_ratio(R, 3), np.array([0.5e-9, 1.0, 0.0, 0.0]), ROUNDING)
    assert (pivot_ratio(R, 0) == 1.0).all()


def test_back_substitution_gives_zero_where_a_pivot_is_exactly_zero() -> None:
    R = np.triu(matrices(4, 4, 4))
    R[1, 2, 2] = 0.0
    rhs = np.random.default_rng(1).normal(size=(BATCH, 4, 2))
    x = back_substitute(R, rhs)
    assert np.isfinite(x).all()
    assert not x[1, 2].any()
    good = np.arange(BATCH) != 1
    close_to((R @ x)[good], rhs[good], ROUNDING * 100)


@pytest.mark.parametrize(("m", "n", "rank"), SHAPES)
def test_null_basis_solves_the_rows(m: int, n: int, rank: int) -> None:
    K = matrices(m, n, rank)
    gamma = (K @ np.random.default_rng(3).normal(size=(BATCH, n, 1)))[..., 0]
    Psi, x0, pivot, left = null_basis(K, gamma, rank)
    assert (left < ROUNDING).all()
    assert Psi.shape == (BATCH, n, n - rank)
    assert np.abs(K @ Psi).max(initial=0.0) < ROUNDING * max(np.abs(Psi).max(initial=0.0), 1.0)
    assert (
        np.abs(np.einsum("tij,tj->ti", K, x0) + gamma).max() < ROUNDING * max(np.abs(gamma).max(), 1.0) * 10
    )
    assert np.abs(Psi).max(initial=0.0) < GROWTH
    assert (np.linalg.matrix_rank(Psi) == n - rank).all() if n > rank else True
    assert (pivot > 0.1).all()
    for psi in Psi:  # the free coordinates are unknowns themselves
        assert sum(any(np.array_equal(row, e) for row in psi) for e in np.eye(n - rank)) == n - rank


@pytest.mark.parametrize("small", [1e-6, 1e-12, 1e-15, 0.0])
def test_null_basis_stays_bounded_as_rank_falls(small: float) -> None:
    """The rank is kept, the basis grows no more than pivoting allows, and the rows stay satisfied."""
    U, V = np.linalg.qr(np.random.default_rng(5).normal(size=(2, BATCH, 6, 6)))[0]
    K = (U[:, :4, :4] * np.array([1, 0.8, 0.5, small])) @ np.swapaxes(V[:, :, :4], 1, 2)
    Psi, x0, pivot, _ = null_basis(K, np.zeros((BATCH, 4)), 4)
    assert np.isfinite(Psi).all()
    assert not x0.any()
    assert np.abs(Psi).max() < GROWTH
    if small > 1e-15:
        assert np.abs(K @ Psi).max() < 1e3 * ROUNDING
        assert (pivot < 10 * small).all()


def test_equal_columns_and_empty_rows_are_no_obstacle() -> None:
    K = np.ones((2, 3, 4))
    K[:, 1] = 0.0
    K[:, 2] = -2.0
    Psi, x0, _, left = null_basis(K, np.array([[1.0, 0.0, -2.0]] * 2), 1)
    assert np.abs(K @ Psi).max() < ROUNDING
    close_to(np.einsum("tij,tj->ti", K, x0), np.array([[-1.0, 0.0, 2.0]] * 2), ROUNDING)
    assert (left < ROUNDING).all()
    Psi, x0, pivot, left = null_basis(np.zeros((2, 0, 3)), np.zeros((2, 0)), 0)
    assert not left.any()
    assert np.array_equal(Psi, np.tile(np.eye(3), (2, 1, 1)))
    assert not x0.any()
    assert (pivot == 1.0).all()


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e-6])
def test_what_is_left_of_more_rank_is_told(size: float) -> None:
    """The fourth singular value, seen after three pivots: within the growth of an elimination."""
    U, V = np.linalg.qr(np.random.default_rng(6).normal(size=(2, BATCH, 6, 6)))[0]
    K = (U[:, :, :4] * np.array([1, 0.8, 0.5, 0.5 * size])) @ np.swapaxes(V[:, :, :4], 1, 2)
    left = null_basis(K, np.zeros((BATCH, 6)), 3)[3]
    assert (size / GROWTH < left).all()
    assert (left < GROWTH * size).all()


@pytest.mark.parametrize(("m", "n", "rank"), SHAPES)
def test_least_squares_is_the_pseudo_inverse(m: int, n: int, rank: int) -> None:
    A, b = matrices(m, n, rank), np.random.default_rng(2).normal(size=(BATCH, m))
    expected = np.einsum("tij,tj->ti", np.linalg.pinv(A, rcond=1e-10), b)
    close_to(least_squares(A, b), expected, 10 * ROUNDING) if rank else None
    close_to(least_squares(A, b, rank=rank), expected, 10 * ROUNDING)


def test_least_squares_of_nothing_and_with_a_rank() -> None:
    assert least_squares(np.zeros((2, 0, 3)), np.zeros((2, 0))).tolist() == [[0.0] * 3] * 2
    assert least_squares(np.zeros((2, 3, 0)), np.zeros((2, 3))).shape == (2, 0)
    assert not least_squares(np.zeros((2, 3, 3)), np.ones((2, 3))).any()
    # With a rank, rounding of the file is ignored: a singular value of 1e-6 must not blow its part of b up.
    A, b = np.diag([1.0, 0.5, 1e-6])[None], np.ones((1, 3))
    assert least_squares(A, b, rank=2).max() == 2.0
    assert least_squares(A, b).max() == pytest.approx(1e6)


@pytest.mark.parametrize(("m", "n"), [(5, 5), (8, 6), (4, 1)])
def test_solutions_of_full_rank_are_sure_away_from_singular_matrices(m: int, n: int) -> None:
    A, b = matrices(m, n, n), np.random.default_rng(4).normal(size=(BATCH, m))
    A[1, :, -1] = A[1, :, 0] if n > 1 else 0.0
    x, sure = full_rank_solution(A, b, 1e-4)
    assert np.flatnonzero(~sure).tolist() == [1]
    assert np.isfinite(x).all()
    close_to(x[sure], np.einsum("tij,tj->ti", np.linalg.pinv(A[sure]), b[sure]), 10 * ROUNDING)
