"""How much a module's motors take part in its motions; modules where they lose one in every posture."""

import numpy as np

from ..spatial import Array
from ..structure.module import Module

#: A posture is singular if its smallest pivot, or the motors' smallest share in a motion, is below this.
SINGULAR_POSTURE = 1e-5


def motor_share(module: Module, Psi: Array) -> Array | None:
    """Compute the motors' smallest share in a motion: least singular value of S_a Psi, Psi orthonormal.

    Translations are divided by the module's length, so that metres and radians are comparable.

    Args:
        Psi: Basis of its motions, shape (T, n, N).

    Returns:
        Shape (T,), in [0, 1], 0 where motors lose a direction; None if there are no motors or no motions.
    """
    if not module.motors or not module.mobility:
        return None
    orthonormal = np.linalg.qr(Psi / module.mechanism.reduction.col_scale[:, None])[0]
    return np.linalg.svd(orthonormal[:, module.motor_columns], compute_uv=False)[:, -1]


def architecturally_singular(module: Module) -> str:
    """Describe an architectural singularity, or return an empty text if there is none.

    At such a singularity, motors lose a direction in every posture. An example is six legs between similar
    hexagons: one motion of the platform never changes their lengths.
    """
    m = module.mechanism
    if not m.closures.rows or len(module.motors) != m.mobility:
        return ""
    share = motor_share(module, m.generic_Psi)
    if share is None or not len(share) or share.max() >= SINGULAR_POSTURE:
        return ""
    return (
        "architecturally singular: its motors lose a direction in every posture (their share in it is at "
        f"most {share.max():.1e}), so no effort holds it there; change the geometry (base and platform may "
        "be similar hexagons), or choose other motors"
    )
