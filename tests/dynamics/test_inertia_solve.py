"""Solving with articulated inertias: graded, singular, empty."""

import numpy as np
import pytest

from hybridyn.dynamics.guards import EPS
from hybridyn.dynamics.inertia_solve import InertiaFactor
from tests.comparing import ROUNDING, close_to

GRADES = [1.0, 1e6, 1e12]  # heaviest over lightest coordinate
SAMPLES, SIZE = 5, 4


def drawn(rank: int, grade: float = 1.0) -> np.ndarray:
    """Return C^T C for C of shape (samples, rank, size), its coordinates graded."""
    C = np.random.default_rng(0).normal(size=(SAMPLES, rank, SIZE)) * grade ** -np.linspace(0, 0.5, SIZE)
    return np.matmul(np.swapaxes(C, 1, 2), C)


@pytest.mark.parametrize("grade", GRADES)
def test_light_coordinates_stay_accurate_beside_heavy_ones(grade: float) -> None:
    A = drawn(7, grade)
    x = np.random.default_rng(1).normal(size=(SAMPLES, SIZE, 2)) * grade ** np.linspace(0, 0.5, SIZE)[:, None]
    factor = InertiaFactor(A, 16 * EPS * np.diagonal(A, axis1=1, axis2=2))
    solved, left = factor.solve(np.matmul(A, x))
    assert not factor.massless.any()
    assert not left.any()
    # Every coordinate by itself: its unit is its own rounding.
    unit = grade ** np.linspace(0, 0.5, SIZE)[:, None]
    close_to(solved / unit, x / unit, 1e3 * ROUNDING)


def test_each_sample_decides_by_itself() -> None:
    A = np.stack([drawn(SIZE)[0], drawn(2)[0], np.zeros((SIZE, SIZE))])
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
