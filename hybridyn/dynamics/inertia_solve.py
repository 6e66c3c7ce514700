"""Solve A_t x = b with the articulated inertia A_t of a module, symmetric and positive semidefinite.

Its eigenvalues are computed in units of the rounding of its diagonal. Scaled like that, graded matrices
(light legs under a heavy platform) lose no digits, and an eigenvalue of at most one belongs to a motion
without inertia. `rounding` bounds the rounding.
"""

import numpy as np

from ..spatial import Array


class InertiaFactor:
    """The principal motions of many inertia matrices, in units of their rounding: N^T A N = diag(values).

    Attributes:
        A: The matrices, shape (T, n, n).
        motions: N, shape (T, n, n): columns that are orthonormal in the unit of each coordinate, in which its
            rounding is one.
        values: Inertia of each principal motion over its rounding, shape (T, n).
        massless: Principal motions without inertia, whose values are at most one, shape (T, n).
    """

    def __init__(self, A: Array, noise: Array) -> None:
        """Compute the principal motions.

        Args:
            A: Symmetric positive semidefinite matrices, shape (T, n, n), all entries in [kg m^2].
            noise: Rounding of each diagonal entry, shape (T, n), positive where the entry is.
        """
        unit = 1.0 / np.sqrt(np.where(noise > 0, noise, 1.0))
        self.values, vectors = np.linalg.eigh(A * unit[:, :, None] * unit[:, None])
        self.A, self.motions, self.massless = A, vectors * unit[:, :, None], self.values <= 1.0

    def solve(self, b: Array) -> tuple[Array, Array]:
        """Solve A x = b for b of shape (T, n, c), with x = 0 along motions without inertia.

        One step of refinement removes the rounding of the principal motions.

        Returns:
            x, shape (T, n, c), and the force of b on every massless motion, per unit of the coordinate that
            moves most; zero for the others, shape (T, n, c).
        """
        turned, massless = np.swapaxes(self.motions, 1, 2), self.massless
        inverse = self.motions / np.where(massless, np.inf, self.values)[:, None]
        x = np.matmul(inverse, np.matmul(turned, b))
        x += np.matmul(inverse, np.matmul(turned, b - np.matmul(self.A, x)))
        force = np.matmul(turned, b) / np.abs(turned).max(axis=2, keepdims=True, initial=0.0)
        return x, np.where(massless[..., None], force, 0.0)
