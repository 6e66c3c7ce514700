"""Decide whether doubtful closure rows are independent, from the closure residual at the home posture.

A row with a small singular value is rounding if the file is coarse, and a constraint if the file is precise.
A file whose loops close at home to the last digit is not rounded to four digits.
"""

from typing import NamedTuple

import numpy as np

from ..linkage.closures import Closures
from ..linkage.generic_postures import scattered_postures
from ..linkage.motion import Motion
from ..linkage.reduction import ROUNDED_ROWS, RankReport, Reduction, decide_rank
from ..linkage.walking import CLOSED, EVIDENT
from ..spatial import Array

#: Rounding to five digits. Home may not show it, since closure frames may be computed from the rounded tree.
FINEST = 1e-5
#: Rounding to three digits. Doubtful rows that leave a module no freedom count as independent only above
#: this: at its only posture, rows that rounding made independent close as well as others.
FINEST_LOCK = 1e-3
#: Number of postures that must close with the doubtful rows; with fewer, these rows contradict the others.
ENOUGH = 12


class RankEvidence(NamedTuple):
    """Evidence from the home posture that doubtful rows are independent.

    Attributes:
        postures: Generic postures that close with these rows, shape (samples, nq).
        tolerance: Relative singular value above which rows count as independent.
        words: How the rows were counted.
    """

    postures: Array
    tolerance: float
    words: str


def rank_by_home(
    closures: Closures, reduction: Reduction, home: Array, open_by: float
) -> RankEvidence | None:
    """Find out whether doubtful rows are independent because home closes too well for them to be rounding.

    The rows must also close from other starts. Rows that leave the module no freedom close at isolated
    postures only, whatever their cause, so these must be above `FINEST_LOCK`.

    Args:
        closures: The module's closures, on its tree after the cuts.
        reduction: Elimination of the closures, with ranks fixed without this evidence.
        home: Home posture of the tree, shape (nq,).
        open_by: Closure residual at home, relative to the module's length.

    Returns:
        The evidence, or None if no row is in doubt or the doubtful rows count as dependent.
    """
    tolerance, report = max(EVIDENT * open_by, FINEST), reduction.report
    if (report.doubted[1] if report.doubted else report.dropped) <= tolerance:
        return None
    scales = reduction.row_scale, reduction.col_scale
    postures, _ = scattered_postures(closures, home, *scales, max(open_by, CLOSED), rank_tolerance=tolerance)
    if len(postures) < ENOUGH:
        return None
    K = reduction.scaled(closures.matrix(closures.tree.sweep(postures)))
    report = decide_rank(K, tolerance)
    locks = report.rank == reduction.n
    if not report.clear or (locks and report.kept < FINEST_LOCK):
        return None
    return RankEvidence(
        postures,
        tolerance,
        f"closure rows of relative singular values down to {report.kept:.1e} count as independent"
        f"{' and lock it' if locks else ''}: {_closed(open_by)}, so the file is not rounded that much "
        "(rank_tolerance overrides this)",
    )


def dropped_rows(report: RankReport, open_by: float) -> str:
    """Describe how rows that depend on others up to rounding were counted; "" if there are none.

    Args:
        report: How the rank was determined.
        open_by: Closure residual at home, relative to the module's length.
    """
    if report.dropped <= ROUNDED_ROWS:
        return ""
    so = "; " if report.dropped <= max(EVIDENT * open_by, ROUNDED_ROWS) else ", though "
    return (
        f"closure rows of relative singular values up to {report.dropped:.1e} count as dependent, as "
        f"rounding in the file{so}{_closed(open_by)} (rank_tolerance overrides this)"
    )


def singular_home(closures: Closures, reduction: Reduction, at_home: Motion, open_by: float) -> str:
    """Say that the closures lose rank at home; "" if they do not, or if home is too open to tell.

    Args:
        closures: The module's closures.
        reduction: Their scales and their rank at generic postures.
        at_home: Motion of their tree at the home posture.
        open_by: Closure residual there, relative to the module's length.
    """
    if open_by > CLOSED or not reduction.rank:
        return ""
    K = reduction.scaled(closures.matrix(at_home))
    rank = int((np.linalg.svd(K[0], compute_uv=False) > ROUNDED_ROWS).sum())
    if rank >= reduction.rank:
        return ""
    return (
        f"home is a singular posture: its closures have rank {rank} there and {reduction.rank} elsewhere. "
        "Modes of the linkage may meet there, and the mobility is that of one of them; give a home away from "
        "it"
    )


def _closed(open_by: float) -> str:
    return f"its loops are closed to {open_by:.1e} of its size at home"
