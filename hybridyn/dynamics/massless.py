"""Handle motions without inertia: raise if a force acts on one, else choose least-norm accelerations.

Without a force, the acceleration along such a motion is arbitrary.
"""

from __future__ import annotations

import numpy as np

from ..errors import SingularityError
from ..linkage.elimination import least_squares
from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import Module
from .inertia_solve import InertiaFactor

#: Largest force that may act on a motion without inertia, as a part of the largest term.
FORCED = 1e-9


def check_massless_forces(module: Module, basis: Basis, left: Array, size: Array) -> None:
    """Raise if a force acts on a motion without inertia.

    Args:
        left: Forces on massless motions (`InertiaFactor.solve`), shape (T, N), [N m].
        size: Largest term in the sum of these forces, shape (T,), [N m].

    Raises:
        SingularityError: The message names the motion, the force and the sample.
    """
    force = np.abs(left).max(axis=1, initial=0.0)
    bad = np.flatnonzero(force > FORCED * size)
    if not len(bad):
        return
    t = int(bad[np.argmax(force[bad])])
    motion = basis.Psi[t, :, int(np.argmax(np.abs(left[t])))] / module.mechanism.reduction.col_scale
    name = module.freedom_names()[int(np.argmax(np.abs(motion)))]
    raise SingularityError(
        f"module '{module.name}': the motion of {name} has no inertia, and a force of {force[t]:.3g} N m "
        f"acts on it at sample {t}: its acceleration is not defined. Give a mass to the bodies that it "
        "moves, or drive it by position",
        module=module.name,
        what="inertia",
        condition=np.inf,
        sample=t,
    )


def choose_least_norm(module: Module, basis: Basis, inertia: InertiaFactor, u_dot: Array) -> None:
    """Choose, in place, the least-norm accelerations along motions without inertia.

    Args:
        inertia: Factor of its inertia.
        u_dot: Independent accelerations, shape (T, N); changed at samples with massless motions.
    """
    unit = module.mechanism.reduction.col_scale
    for t in np.flatnonzero(inertia.massless):
        Psi = basis.Psi[t] / unit[:, None]
        null = inertia.null_space(int(t))
        x = Psi @ u_dot[t] + basis.drift[t] / unit
        u_dot[t] -= null @ least_squares((Psi @ null)[None], x[None])[0]
