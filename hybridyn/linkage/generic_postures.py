"""Draw assembled postures of one module at random; rank and mobility are determined from them.

Where their ranks differ, or home has more, or rows nearly depend on others, these postures lie near singular
ones or in several modes of the linkage. Then the postures of walks from home replace them, if the gap in the
singular values opens there (`walking`): the rank is the largest that is seen in home's mode.

The postures of larger modules are kept in the cache folder, for robots that are loaded again. An entry is
named by a hash of all that the postures depend on, also of this package's files. Its numbers are those that
the search found, bit by bit.
"""

from __future__ import annotations

import pickle

import numpy as np

from ..description.cache_folder import hashed, keep, kept, state_of
from ..logs import warn
from ..spatial import Array
from .closures import Closures
from .loop_problem import LoopProblem
from .motion import Motion
from .newton import STALLED, Closed, close
from .reduction import RANK_TOLERANCE, report_on
from .walking import CLOSED, Level, ranks, relative_values, walk, widest

#: Scatter of starts about the home posture, increasing [rad, module lengths], and starts per posture wanted.
SPREADS = ((0.15, 2), (0.5, 4), (1.5, 8), (3.0, 16))

#: Freedoms from which on walks from home are tried first, which take a tenth of the time of scattered starts.
#: A platform on six legs has fewer: scattered postures show better which of its freedoms serve as pivots.
LARGE = 60
#: Freedoms from which on a search takes longer than reading its result, several times.
WORTH_KEEPING = 12
#: Folder of the entries in the cache folder.
FOLDER = "postures"


def generic_postures(
    closures: Closures,
    home: Array,
    row_scale: Array,
    col_scale: Array,
    tolerance: float,
    *,
    count: int = 24,
) -> tuple[Array, float]:
    """Find assembled postures, away from singular ones, from which rank and mobility are determined.

    Args:
        closures: The module's closures.
        home: Centre of the starts, shape (nq,).
        row_scale: Factor of each row.
        col_scale: Unit of each freedom.
        tolerance: Largest scaled residual of a closed posture (rounding of the file).
        count: Number of postures wanted.

    Returns:
        Postures, shape (at most count, nq), empty if none closed, and the smallest residual reached.
    """
    problem = LoopProblem(closures, row_scale, col_scale, np.ones(closures.tree.nv, dtype=bool))
    if closures.tree.nv >= LARGE:
        walked = _walked(problem, home, tolerance, count)
        if walked is not None and len(walked):
            return walked, float(_residuals(problem, walked).min())
        warn(
            "a module of %d freedoms is open or near a singular posture at home: looking for others takes up "
            "to minutes. A home with closed loops, away from it, loads at once", closures.tree.nv,
        )  # fmt: skip
    postures, best = scattered_postures(closures, home, row_scale, col_scale, tolerance, count=count)
    if len(postures):
        postures = _away_from_singular(problem, home, postures, tolerance, count)
    return postures, best


def _away_from_singular(
    problem: LoopProblem, home: Array, scattered: Array, tolerance: float, count: int
) -> Array:
    """Replace postures that leave the rank in doubt by those of walks, if the gap opens there.

    The walks start at home or, if it is open or singular, at the scattered posture of the largest rank.

    Args:
        problem: The rows, and all freedoms of their tree.
        home: Posture from which to walk, closed or not, shape (nq,).
        scattered: Closed postures, shape (postures, nq).
        tolerance: Largest scaled residual of a closed posture.
        count: Number of postures wanted.
    """
    _, level, at_home = _closed(problem, home, tolerance)
    values = relative_values(problem, problem.tree.sweep(scattered))
    seen, report = ranks(values, RANK_TOLERANCE), report_on(values, problem.closures.rows, RANK_TOLERANCE)
    clear = report.clear and report.doubted is None and report.dropped <= level.rounding
    if clear and len(scattered) == count and seen.min() == seen.max() >= at_home:
        return scattered
    best = max(range(len(seen)), key=lambda i: (seen[i], values[i, : seen[i]].min(initial=1.0)))
    for start in (home, scattered[best]):
        walked = _walked(problem, start, tolerance, count)
        if walked is not None:
            return walked if len(walked) else scattered
    return scattered


def _walked(problem: LoopProblem, start: Array, tolerance: float, count: int) -> Array | None:
    """Walk from the nearest closed posture to where the gap in the singular values is open.

    Args:
        problem: The rows, and all freedoms of their tree.
        start: Shape (nq,).
        tolerance: Largest scaled residual of a closed posture.
        count: Number of postures wanted.

    Returns:
        At most `count` postures, none if the gap opens at less than half as many; None if the start does not
        close, is singular, or has no motion.
    """
    q, level, rank = _closed(problem, start, tolerance)
    walked = walk(problem, q, level) if rank else None
    if walked is None or not len(walked.q) or (ranks(walked.values, level.rounding) > rank).any():
        return None
    found = widest(walked, level, count)
    return found if 2 * len(found) >= count else found[:0]


def _closed(problem: LoopProblem, q: Array, tolerance: float) -> tuple[Array, Level, int]:
    """Return the nearest closed posture, how precisely it is closed, and its rank: zero if it is open."""
    motion = problem.tree.sweep(q[None])
    residual = _residuals(problem, q[None], motion)[0]
    if residual > CLOSED:
        closed = close(problem, q[None], least=True)
        q, residual = closed.q[0], closed.residual[0]
        motion = problem.tree.sweep(closed.q)
    level = Level.of(float(residual), tolerance)
    values = relative_values(problem, motion)
    return q, level, int(ranks(values, level.rounding)[0]) if residual <= tolerance else 0


def _residuals(problem: LoopProblem, q: Array, motion: Motion | None = None) -> Array:
    """Compute the largest scaled residual of each posture, shape (T,), whose motion may be known."""
    out: Array = np.abs(problem.residual(q, np.zeros(len(q), dtype=int), motion)).max(axis=1)
    return out


def scattered_postures(
    closures: Closures, home: Array, row_scale: Array, col_scale: Array, tolerance: float, *,
    count: int = 24, rank_tolerance: float = RANK_TOLERANCE,
) -> tuple[Array, float]:  # fmt: skip
    """Draw assembled postures about a home posture.

    The scatter of the starts (seeded, so that results are reproducible) increases until some of them close.
    The remaining postures are then drawn near those found.

    Args:
        closures: The module's closures.
        home: Centre of the starts, shape (nq,).
        row_scale: Factor of each row.
        col_scale: Unit of each freedom.
        tolerance: Largest scaled residual of a closed posture (rounding of the file).
        count: Number of postures wanted.
        rank_tolerance: Relative singular value from which on rows count as independent.

    Returns:
        Postures, shape (at most count, nq), empty if none closed, and the smallest residual reached.
    """
    tree = closures.tree
    every = np.ones(tree.nv, dtype=bool)
    problem = LoopProblem(closures, row_scale, col_scale, every, rank_tolerance=rank_tolerance)
    search, size = _Search(problem, tolerance), tree.nv
    rng = np.random.default_rng(2010)
    for spread, share in SPREADS:
        search.about(home[None], rng.uniform(-spread, spread, (share * count, size)), count)
        if len(search.found):
            break
    else:
        search.resume(count)
    for share in (2, 4):
        if 0 < len(search.found) < count:
            near = search.found.copy()
            search.about(near, rng.uniform(-SPREADS[0][0], SPREADS[0][0], (share * count, size)), count)
    return search.found[:count], search.best


def kept_generic_postures(
    closures: Closures, home: Array, row_scale: Array, col_scale: Array, tolerance: float
) -> tuple[Array, float]:
    """Return `generic_postures`, from the cache folder if they are there."""
    given = (home, row_scale, col_scale, tolerance)
    if closures.tree.nv < WORTH_KEEPING:
        return generic_postures(closures, *given)
    about = hashed(np.__version__, *map(state_of, ("hybridyn", "hybridyn.linkage")))
    parts = closures.tree.joints, closures.closures, closures.couplings  # the rest follows from them
    name = hashed(about, pickle.dumps((parts, given)).hex())
    found = kept(name, FOLDER)
    if found is not None:
        return _postures(found["postures"], closures.tree.nq), found["best"]
    postures, best = generic_postures(closures, *given)
    keep(name, {"postures": postures.tolist(), "best": best}, FOLDER)
    return postures, best


def _postures(listed: list[list[float]] | list[Array], nq: int) -> Array:
    """Return postures as an array, shape (postures, nq), where either may be 0."""
    return np.array(listed, dtype=float).reshape(len(listed), nq)


class _Search:
    """Search for postures that close a problem's loops.

    Attributes:
        found: The postures so far, shape (found, nq).
        best: Smallest residual reached.
    """

    def __init__(self, problem: LoopProblem, tolerance: float) -> None:
        self._problem, self._tolerance = problem, tolerance
        self.found, self.best = np.zeros((0, problem.tree.nq)), np.inf
        self._left: list[tuple[float, Array]] = []

    def about(self, centres: Array, scatter: Array, count: int) -> None:
        """Start near each posture in turn until `count` are found; drop starts that stall.

        Args:
            centres: The postures, shape (centres, nq).
            scatter: Steps away from them, shape (starts, nv), scaled.
            count: Number of postures wanted. As many starts run first, which mostly suffice, then batches of
                twice as many.
        """
        q = centres[np.arange(len(scatter)) % len(centres)]
        starts = self._problem.tree.integrate(q, scatter * self._problem.col_scale)
        for some in np.split(starts, range(count, len(starts), 2 * count)):
            closed = self._keep(close(self._problem, some, least=True, enough=STALLED))
            self._left += zip(closed.residual.tolist(), closed.q, strict=True)
            self._left = sorted(self._left, key=lambda pair: pair[0])[:count]
            if len(self.found) >= count:
                return

    def resume(self, count: int) -> None:
        """Resume the `count` dropped starts with the smallest residuals, without dropping any."""
        q = _postures([q for _, q in self._left[:count]], self._problem.tree.nq)
        self._keep(close(self._problem, q, least=True))

    def _keep(self, closed: Closed) -> Closed:
        """Add the postures that closed to `found`, and update `best`."""
        good = (closed.residual <= self._tolerance) & (closed.step < 1e-6)
        self.found = np.concatenate([self.found, closed.q[good]])
        self.best = min(self.best, float(closed.residual.min(initial=np.inf)))
        return closed
