"""Forces of one module over motor accelerations and over its base's, from the direct model's inertias.

With y the forces along the motors, F the wrench on the base, and B the motor map,

    [y; F] = [B^-1 A_t B^-T; E^T B^-T] m_ddot + [B^-1 E; I] A

where A_t, E and I (`equations.direct._inertias`) contain what the module carries.
"""

from __future__ import annotations

import casadi as ca
import numpy as np

from ...equations.expressions import Expression, pack, symbols, symmetric
from ...program import Source, Target
from ..direct import DirectCalls
from ..writer import Writer
from .adjoints import PART
from .dense import matrix
from .motor_motion import MotorMotion


def along_motors(w: Writer, calls: DirectCalls, part: MotorMotion, targets: list[Target]) -> None:
    """Add the call that writes forces over motor accelerations row by row, and over A column by column."""
    n, factors, carried = calls.module.mobility, part.factors, calls.below is not None

    def function() -> ca.Function:
        """Return both matrices."""
        (A_column, A_t), (E_column, E) = symbols("A_t", n * (n + 1) // 2), matrix("E", n, 6)
        (I_column, inertia), (LU, numbers) = symbols("I", 21), symbols("LU", n * n)

        def solved(right: Expression) -> Expression:
            """Return B^-1 times a matrix."""
            return (
                right if factors is None else np.stack([factors.solve(numbers, x) for x in right.T], axis=1)
            )

        D, R = solved(solved(symmetric(A_t, n)).T), solved(E)
        over, onto = (
            (D, R) if not carried else (np.concatenate([D, R.T]), np.concatenate([R, symmetric(inertia, 6)]))
        )
        columns = [A_column, E_column, I_column, *([LU] if factors else [])]
        return ca.Function("inertias", columns, [pack(over.ravel()), pack(onto.T.ravel())])

    key = ("inertias", n, factors.pivots if factors else None, carried)
    sources: list[Source] = [calls.inertias[name] for name in ("A_t", "E", "I")]
    w.call(w.kernel(key, function, PART), 1, [*sources, *([factors.numbers] if factors else [])], targets)
