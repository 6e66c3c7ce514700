"""Solving with articulated inertias: graded, singular, empty."""

import numpy as np
import pytest

from hybridyn.dynamics.guards import EPS
from hybridyn.dynamics.inertia_solve import InertiaFactor
from tests.comparing import ROUNDING, close_to

GRADES = [1.0, 1e6, 1e12]  # heaviest over lightest coordinate
SAMPLES, SIZE = 5, 4


def drawn(rank: int, grade: float = 1.0, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Return roots C, (samples, rank, size), and C^T C, its coordinates graded."""
    C = np.random.default_rng(seed).normal(size=(SAMPLES, rank, SIZE)) * grade ** -np.linspace(0, 0.5, SIZE)
    return C, np.matmul(np.swapaxes(C, 1, 2), C)


def factored(A: np.ndarray) -> InertiaFactor:
    return InertiaFactor(A, 16 * EPS * np.diagonal(A, axis1=1, axis2=2))


@pytest.mark.parametrize("grade", GRADES)
def test_light_coordinates_stay_accurate_beside_heavy_ones(grade: float) -> None:
    _, A = drawn(7, grade)
    x = np.random.default_rng(1).normal(size=(SAMPLES, SIZE, 2)) * grade ** np.linspace(0, 0.5, SIZE)[:, None]
    factor = factored(A)
    solved, left = factor.solve(np.matmul(A, x))
    assert not factor.massless.any()
    assert not left.any()
    # Every coordinate by itself: its unit is its own rounding.
    unit = grade ** np.linspace(0, 0.5, SIZE)[:, None]
    close_to(solved / unit, x / unit, 1e3 * ROUNDING)


def test_principal_motions_diagonalise_the_matrix() -> None:
    _, A = drawn(SIZE, 1e6)
    factor = factored(A)
    turned = np.swapaxes(factor.motions, 1, 2) @ A @ factor.motions
    close_to(turned, factor.values[:, None] * np.eye(SIZE), ROUNDING)


@pytest.mark.parametrize("rank", [0, 1, 3])
def test_motions_without_inertia_are_found_and_left_at_rest(rank: int) -> None:
    C, A = drawn(rank)
    noise = np.full((SAMPLES, SIZE), 1e-13)
    factor = InertiaFactor(A, noise)
    assert (factor.massless.sum(axis=1) == SIZE - rank).all()
    for t in range(SAMPLES):
        null = factor.motions[t][:, factor.massless[t]]
        assert null.shape == (SIZE, SIZE - rank)
        assert np.linalg.matrix_rank(null) == SIZE - rank
        assert np.abs(C[t] @ null).max(initial=0.0) < 10 * ROUNDING * np.abs(null).max()


def test_a_force_that_moves_no_mass_is_left_over() -> None:
    C, A = drawn(3)
    factor = InertiaFactor(A, np.full((SAMPLES, SIZE), 1e-13))
    null = factor.motions[:, :, 0]  # the smallest value stands first
    force = np.einsum("tri,tr->ti", C, np.ones((SAMPLES, 3)))
    x, left = factor.solve(np.stack([force, force + null / np.linalg.norm(null)], axis=-1))
    assert np.abs(left[..., 0]).max() < 100 * ROUNDING
    assert (np.abs(left[..., 1]).max(axis=1) > 0.1).all()
    close_to(np.einsum("tij,tj->ti", A, x[..., 0]), force, 100 * ROUNDING)


def test_each_sample_decides_by_itself() -> None:
    _, whole = drawn(SIZE)
    _, thin = drawn(2)
    A = np.stack([whole[0], thin[0], np.zeros((SIZE, SIZE))])
    factor = InertiaFactor(A, np.full((3, SIZE), 1e-13))
    assert factor.massless.sum(axis=1).tolist() == [0, SIZE - 2, SIZE]
    b = np.random.default_rng(2).normal(size=(3, SIZE, 1))
    alone = [InertiaFactor(A[t : t + 1], np.full((1, SIZE), 1e-13)).solve(b[t : t + 1]) for t in range(3)]
    together = factor.solve(b)
    for t in range(3):
        assert np.array_equal(together[0][t], alone[t][0][0])
        assert np.array_equal(together[1][t], alone[t][1][0])


@pytest.mark.parametrize(("samples", "size"), [(0, 3), (2, 0), (0, 0), (1, 1)])
def test_nothing_is_a_matrix_too(samples: int, size: int) -> None:
    factor = InertiaFactor(np.tile(np.eye(size), (samples, 1, 1)), np.full((samples, size), EPS))
    x, left = factor.solve(np.ones((samples, size, 2)))
    assert np.array_equal(x, np.ones((samples, size, 2)))
    assert not left.any()
