"""Motions without inertia: a force on one is refused; where none acts they only make accelerations longer."""

from __future__ import annotations

import numpy as np

from ..errors import SingularityError
from ..linkage.elimination import least_squares
from ..linkage.reduction import Basis
from ..spatial import Array
from ..structure.module import Module
from .inertia_solve import InertiaFactor

#: Part of the largest term that a massless motion may be forced by before it is an error.
FORCED = 1e-9


def refuse_forced(module: Module, basis: Basis, left: Array, size: Array) -> None:
    """Refuse a force on a motion without inertia.

    Args:
        module: The module.
        basis: Its motions.
        left: What the factor of their inertia left of the forces along them, shape (T, N), [N m].
        size: Largest term that the forces were summed from, shape (T,), [N m].

    Raises:
        SingularityError: Naming the motion.
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
        f"acts on it at sample {t}: its acceleration is not defined. Give the bodies it moves a mass, or "
        "drive it by position",
        module=module.name,
        what="inertia",
        condition=np.inf,
        sample=t,
    )


def shorten(module: Module, basis: Basis, inertia: InertiaFactor, u_dot: Array) -> None:
    """Take motions without inertia out of u_dot, shape (T, N), where they only make it longer, in place."""
    unit = module.mechanism.reduction.col_scale
    for t in np.flatnonzero(inertia.massless):
        Psi = basis.Psi[t] / unit[:, None]
        null = inertia.null_space(int(t))
        x = Psi @ u_dot[t] + basis.drift[t] / unit
        u_dot[t] -= null @ least_squares((Psi @ null)[None], x[None])[0]
