"""How well a file closes its loops at home, as evidence for how many of its closure rows are independent.

A row of small singular value is rounding in a coarse file, and a constraint in a fine one. A file that closes
at home to its last digit is not rounded to its fourth.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..linkage.closures import Closures
from ..linkage.newton import generic_postures
from ..linkage.reduction import ROUNDED_ROWS, RankReport, Reduction, decide_rank
from ..spatial import Array

#: A singular value this many times as large as what home leaves open does not come from the same rounding.
EVIDENT = 1e3
#: Rounding to five digits, which home need not show: closure frames may come from the rounded tree at home.
FINEST = 1e-5
#: Loops count as closed to the last digit from this residual on.
CLOSED = 1e-11
#: Postures that must close with the rows in doubt, else those rows contradict the others.
ENOUGH = 12


@dataclass(frozen=True)
class RankEvidence:
    """What home says about rows in doubt.

    Attributes:
        postures: Generic postures that close with them, shape (samples, nq).
        tolerance: Relative singular value from which on rows count.
        counted: Smallest relative singular value among those that count by this evidence.
    """

    postures: Array
    tolerance: float
    counted: float


def rank_by_home(
    closures: Closures, reduction: Reduction, home: Array, open_by: float
) -> RankEvidence | None:
    """Return how rows in doubt count as independent because home closes too well; None where they do not.

    They must close everywhere else as well, and leave the module a motion.

    Args:
        closures: The module's closures, on its tree after the cuts.
        reduction: Their elimination, its ranks fixed without such evidence.
        home: Home posture of the tree, shape (nq,).
        open_by: What it leaves open, relative to the module's length.
    """
    tolerance = max(EVIDENT * open_by, FINEST)
    doubted = _in_doubt(reduction.report)
    if doubted <= tolerance:
        return None
    scales = reduction.row_scale, reduction.col_scale
    postures, _ = generic_postures(closures, home, *scales, max(open_by, CLOSED), rank_tolerance=tolerance)
    if len(postures) < ENOUGH:
        return None
    K = reduction.scaled(closures.matrix(closures.tree.sweep(postures)))
    report = decide_rank(K, tolerance)
    if not report.clear or report.rank == reduction.n:
        return None
    return RankEvidence(postures, tolerance, report.kept)


def _in_doubt(report: RankReport) -> float:
    """Return the largest relative singular value that may or may not count; 0 where there is none."""
    if report.doubted:
        return report.doubted[1]
    return report.dropped if report.dropped > ROUNDED_ROWS else 0.0


def rank_decision(report: RankReport, evidence: RankEvidence | None, open_by: float) -> str:
    """Say how rows were counted where numbers had to decide it, or return an empty text.

    Args:
        report: How the rank was decided.
        evidence: What home said, where it counted.
        open_by: What home leaves open, relative to the module's length.
    """
    closes = f"its loops are closed to {open_by:.1e} of its size at home"
    if evidence:
        return (
            f"closure rows of relative singular values down to {evidence.counted:.1e} count as independent: "
            f"{closes}, so the file is not rounded that much (rank_tolerance decides otherwise)"
        )
    if report.dropped > ROUNDED_ROWS:
        so = "" if report.dropped <= max(EVIDENT * open_by, ROUNDED_ROWS) else ", though "
        return (
            f"closure rows of relative singular values up to {report.dropped:.1e} count as dependent, as "
            f"rounding in the file{so or '; '}{closes} (rank_tolerance decides otherwise)"
        )
    return ""
