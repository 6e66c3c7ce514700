"""What of a robot is sought, and what is held: tau = Y x, with x = M x + held.

Numbers that are held keep what the file states, whatever is found for the others. The first moments and the
inertia of a body about its frame's origin contain its mass: if the mass is sought and they are not, they must
follow it. A file states the centre of mass, and the inertia about it. So a body of which only some numbers
are sought has its numbers about the centre c of the link that it is called by, with h = m (centre - c):

    m x = m c + h,    I = I_c + m (c.c E - c c^T) + 2 c.h E - c h^T - h c^T

Those that are held keep m, h = 0 and I_c. With the matrix G of these equations, the numbers that are held
change by G_hf G_ff^-1 times those that are sought: the rows of M.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase

import numpy as np
from scipy import linalg

from ..description.names import did_you_mean
from ..errors import ModelError
from ..spatial import Array, Index, Mask
from .base_parameters import RANK, BaseParameters, led
from .estimators import TINY
from .inertial import COLUMN, OF_BODY, ROW, ten_numbers

#: Least radius of gyration of a body about its frame that is thought of, of the robot's size.
SMALL = 0.01


@dataclass(frozen=True, eq=False)
class Sought:
    """What is to be identified.

    Attributes:
        model: The base parameters that are sought, over all standard parameters.
        held: Whether each standard parameter is held, shape (p,).
        follow: Numbers that are held, but follow others.
        matrix: How they follow: rows of M, shape (len(follow), p).
    """

    model: BaseParameters
    held: Mask
    follow: Index
    matrix: Array

    @property
    def constant(self) -> Array:
        """What is held of the standard parameters, shape (p,): the file's numbers less M times these."""
        values = self.model.standard.values
        out = np.where(self.held, values, 0.0)
        out[self.follow] -= self.matrix @ values
        return out

    def columns(self, Y: Array) -> Array:
        """Return the columns of the base parameters that are sought, from Y, shape (T, motors, p)."""
        at = self.model.columns
        return np.asarray(Y[:, :, at] + Y[:, :, self.follow] @ self.matrix[:, at])

    def units(self, length: float, x: Array) -> Array:
        """Return how far each standard parameter may be from the file's, shape (p,), zero if it is held.

        Args:
            length: Size of the robot [m].
            x: Estimates of the base parameters, shape (rank,).
        """
        values, columns, unit = (
            self.model.standard.values,
            self.model.columns,
            np.abs(self.model.standard.values),
        )
        for at in self.model.standard.tens:
            about = values[at[[4, 6, 9]]].sum() / 2 / max(values[at[0]], TINY)
            size = np.sqrt(max(about, (SMALL * length) ** 2))
            unit[at] = values[at[0]] * np.repeat([1.0, size, size**2], [1, 3, 6])
        bare = columns[unit[columns] == 0]  # what the file does not state is as large as it is found
        unit[bare] = np.abs(x[unit[columns] == 0]) + TINY
        unit[self.held] = 0.0
        return unit

    def followed(self, length: float, x: Array) -> Array:
        """Return how standard parameters follow base parameters by the least steps, shape (p, rank).

        Arguments are those of `units`, in which steps are measured.
        """
        steps = self.moved(np.diag(self.units(length, x)))
        onto = self.model.combination @ steps
        return np.asarray(steps @ np.linalg.lstsq(onto, np.eye(len(onto)), rcond=None)[0])

    def moved(self, steps: Array) -> Array:
        """Return M times steps of the standard parameters, shape (p, k)."""
        out = np.where(self.held[:, None], 0.0, steps)
        out[self.follow] = self.matrix @ out
        return out


def linear_model(base: BaseParameters, known: Sequence[str] = (), only: Sequence[str] = ("*",)) -> Sought:
    """Return what is to be identified.

    Args:
        base: Base parameters of all.
        known: Names of parameters, or patterns, whose numbers are known.
        only: Names or patterns of those that are to be identified; the others are known.

    Raises:
        ModelError: A pattern matches nothing, or nothing is left to be identified.
    """

    def matching(patterns: Sequence[str]) -> Mask:
        """Return which parameters match a pattern, shape (p,)."""
        out = np.zeros(len(base.standard.names), dtype=bool)
        for pattern in patterns:
            own = np.array([fnmatchcase(name, pattern) for name in base.standard.names])
            if not own.any():
                raise ModelError(f"'{pattern}' is no parameter{did_you_mean(pattern, base.standard.names)}")
            out |= own
        return out

    held = matching(known) | ~matching(only)
    follow, matrix = _followers(base, held)
    K = np.where(held, 0.0, base.combination) + base.combination[:, follow] @ matrix
    K = K * base.unit / base.unit[base.columns, None]
    rank = int((linalg.svdvals(K) > RANK).sum())
    if not rank:
        raise ModelError("nothing is left to be identified: no effort depends on the chosen parameters")
    model = led(K, rank, base.standard, base.unit) if held.any() else base
    return Sought(model, held, follow, matrix)


def _followers(base: BaseParameters, held: Mask) -> tuple[Index, Array]:
    """Return the numbers that are held but follow others, and their rows of M."""
    standard = base.standard
    places, rows = [np.zeros(0, dtype=int)], [np.zeros((0, len(held)))]
    for at in standard.tens:
        own, free = at[held[at]], at[~held[at]]
        if len(own) and len(free):
            G = _about_origin(standard.centres[int(at[0])])
            of_held, of_free = G[held[at]][:, ~held[at]], G[~held[at]][:, ~held[at]]
            row = np.zeros((len(own), len(held)))
            row[:, free] = linalg.solve(of_free.T, of_held.T).T
            places.append(own)
            rows.append(row)
    return np.concatenate(places), np.concatenate(rows)


def _about_origin(c: Array) -> Array:
    """Return the matrix G from the ten numbers about a point, shape (3,), to those about the origin."""
    G = np.eye(len(OF_BODY))
    G[:, 0] = ten_numbers(1.0, c, np.zeros((3, 3)))
    for j, e in enumerate(np.eye(3)):
        shift = 2 * c[j] * np.eye(3) - np.outer(c, e) - np.outer(e, c)
        G[4:, 1 + j] = shift[ROW, COLUMN]
    return G
