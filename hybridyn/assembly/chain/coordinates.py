"""Which coordinates of a link vary independently when the modules between it and another link move."""

from __future__ import annotations

import numpy as np

from ...linkage.targets import COORDINATES, CoordinateTarget
from ...spatial import Array
from .between import Between

#: A coordinate is independent of the chosen ones if at least this part of its motion remains when they are
#: fixed. A 3-RPS, for example, moves a little in x when it rolls, but x is no independent coordinate.
INDEPENDENT_SHARE = 0.1


def coordinates_at(between: Between, q: Array) -> tuple[Array, Array]:
    """Compute the scaled Jacobian of a link's coordinates, shape (6, N), and their values, shape (6,)."""
    motion, first = between.motion(q[None]), np.zeros(1, dtype=int)
    relative, target = between.seen(motion), between.relative.target
    assert isinstance(target, CoordinateTarget)
    J = between.maps(motion)[0][0]
    return J, target.headed(relative, first).coordinates(relative, first)[0]


def independent_coordinates(J: Array, first: tuple[str, ...]) -> tuple[str, ...]:
    """Choose coordinates, rows of J (6, N), with independent motions; those in `first` have precedence."""
    s = np.linalg.svd(J, compute_uv=False)
    freedoms = int(np.sum(s > INDEPENDENT_SHARE**4 * s[0])) if s.size and s[0] else 0
    order = [*first, *(name for name in _preferred(J) if name not in first)]
    largest = float(np.linalg.norm(J, axis=1).max(initial=0.0))
    chosen: list[str] = []
    basis = np.zeros((0, J.shape[1]))
    for part in (
        INDEPENDENT_SHARE,
        INDEPENDENT_SHARE**2,
        INDEPENDENT_SHARE**4,
    ):  # the last one accepts all that differ by more than rounding
        for name in order:
            row = J[COORDINATES.index(name)]
            own = row - basis.T @ (basis @ row)
            size = float(np.linalg.norm(own))
            if size > part * largest and name not in chosen and len(basis) < freedoms:
                chosen.append(name)
                basis = np.vstack([basis, own / size])
    return tuple(name for name in COORDINATES if name in chosen)


def _preferred(J: Array) -> tuple[str, ...]:
    """Return the coordinates in order of preference: translations first.

    Angles come first for a platform that only turns, such as one on a ball joint, wherever its origin is.
    """
    s = np.linalg.svd(J, compute_uv=False)
    freedoms = int(np.sum(s > INDEPENDENT_SHARE * s[0])) if s.size and s[0] else 0
    turning = np.linalg.svd(J[3:], compute_uv=False)
    moving = np.linalg.svd(J[:3], compute_uv=False)
    only_turns = freedoms <= 3 and turning[freedoms - 1] > INDEPENDENT_SHARE * turning[0]
    only_moves = freedoms <= 3 and moving[freedoms - 1] > INDEPENDENT_SHARE * moving[0]
    if freedoms and only_turns and not only_moves:
        return (*COORDINATES[3:], *COORDINATES[:3])
    return COORDINATES
