"""Decide whether the spins of a module have inertia.

A thin rod has none about its line: no force may act along its spin, and its acceleration is the least, zero.
What arguments decide is decided where they are known. Between rounding and an inertia that is certainly one,
the general path decides, and where a rod without inertia about its line has mass beside it. Rods that are not
round about their line go the same way as those that are: their momentum couples a spin with other motions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ....dynamics.guards import FORCED
from ....spatial import Array, Index
from ....symbols import Expression, is_zero, minus, times
from ..expressions import along, scalar
from ..least_inertia import AMPLIFIED, CERTAIN
from ..leg_groups import Leg
from ..module_plan import ModulePlan
from ..rigid import Links
from ..scales import Scale, size_of, squares
from .motion import IdleMotion, momenta, twists_of

#: Inertia of a spin that is rounding, over that of its body about all axes, in roundings.
ROUNDED_SPIN = 50.0


@dataclass(frozen=True)
class Decided:
    """Whether a spin has inertia.

    Attributes:
        has: 1 if it has, else 0; an expression where arguments decide.
        guard: Guard that this is certain.
    """

    has: Any
    guard: Any


def decided_of(plan: ModulePlan, rotor: Sequence[float], leg: Leg | None = None) -> list[Decided]:
    """Decide which idle motions of the core, or of a leg, have inertia.

    Args:
        rotor: Rotor inertias over the freedoms of the tree after the cuts.
    """
    links, own, idle = plan.parts.links, plan.parts.tree_v, plan.parts.idle
    if leg is not None:
        links, own, idle = leg.links, leg.tree_v, (leg.idle,) if leg.idle else ()
    turned, out = plan.mechanism.turned_inertia, []
    for spin in idle:
        at = own[list(spin.cols)]
        reference = float(turned[at].max(initial=0.0) or turned.max(initial=0.0))
        out.append(decided(spin, links, np.array(rotor)[at], reference, plan.scale))
    return out


def decided(spin: IdleMotion, links: Links, rotor: Array, reference: float, scale: Scale) -> Decided:
    """Decide whether a spin has inertia.

    Args:
        spin: With freedoms of the links.
        links: Their inertias may be arguments.
        rotor: Rotor inertias on its freedoms, shape (freedoms of its joint,).
        reference: Inertia of its body about all axes, [kg m^2]; zero without mass.
        scale: Scales of the module.
    """
    P, V = momenta(spin, links), twists_of(spin, links)
    turned = [along(P[i], V[i]) for i in P] + [float(rotor @ np.square(np.array(spin.axis, dtype=float)))]
    inertia = scalar(sum(turned[1:], turned[0]))[0]
    unit = reference or 1.0
    across = [x for i in P for x in _across(P[i], V[i], scale.length, unit)]
    if not isinstance(inertia, ca.SX) and not any(isinstance(x, ca.SX) for x in across):
        known = float(inertia > ROUNDED_SPIN * scale.eps * unit)
        return Decided(known, (1.0 - known) * sum((x / unforced(scale)) ** 2 for x in across))
    ratio = inertia / unit
    has = ca.if_else(ratio > np.sqrt(ROUNDED_SPIN * CERTAIN) * scale.eps, 1.0, 0.0)
    coupled = squares(np.array(across, dtype=object))
    off = [
        has * CERTAIN * scale.eps / ratio,
        has * coupled / (AMPLIFIED * ratio * ratio),
        (1.0 - has) * ratio / (ROUNDED_SPIN * scale.eps),
        *((1.0 - has) * x / unforced(scale) for x in across),
    ]
    return Decided(has, squares(np.array(off, dtype=object)))


def _across(P: Expression, V: Expression, length: float, unit: float) -> list[Any]:
    """Return the momentum of a body without that about its line, which couples a spin with other motions."""
    w = V[3:]
    share = times(along(P[3:], w), 1.0 / float(along(w, w)))
    left = [minus(x, times(y, share)) for x, y in zip(P[3:], w, strict=True)]
    return [*(times(x, length / unit) for x in P[:3]), *(times(x, 1.0 / unit) for x in left)]


def unforced(scale: Scale) -> float:
    """Return the largest force on a spin without inertia, as a part of the largest term: rounding."""
    return max(min(scale.closed, FORCED), 100.0 * scale.eps)


def without_forces(plan: ModulePlan, left: Expression, f: Expression, freedoms: Index) -> Any:
    """Return the guard of forces left on spins, from those along freedoms of the tree after the cuts."""
    if all(is_zero(x) for x in left):
        return 0.0
    size = size_of(f, 1.0 / plan.mechanism.reduction.col_scale[freedoms], [], 1.0)
    weight = replace(plan.scale, closed=unforced(plan.scale)).weight(size)
    return times(squares(left), weight)


def idle_without_inertia(plan: ModulePlan, rotor: Array) -> Array:
    """Return the idle motions of a module without inertia, of the tree after the cuts, shape (n, motions).

    Those of the file decide, also where arguments change them.

    Args:
        rotor: Rotor inertias, shape (n,).
    """
    m = plan.mechanism
    turned, M = m.turned_inertia, m.legs.crba(m.postures[:1])[0, 6:, 6:] + np.diag(rotor)
    out: list[Array] = []
    for spin in plan.parts.all_idle:
        motion = np.zeros(m.tree.nv)
        motion[list(spin.cols)] = spin.axis
        reference = turned[list(spin.cols)].max() or turned.max() or 1.0
        if motion @ M @ motion <= ROUNDED_SPIN * plan.scale.eps * reference:
            out.append(motion)
    return np.array(out).reshape(len(out), m.tree.nv).T


def mass_beside(plan: ModulePlan, rotor: Sequence[float], freedoms: Sequence[str], limit: float) -> str:
    """Say which rod of a core has no inertia about its line and mass beside it, as guards tell, or return "".

    Args:
        rotor: As for `decided_of`.
        freedoms: Names of the freedoms of the tree after the cuts.
        limit: That of guards.
    """
    for spin, one in zip(plan.parts.idle, decided_of(plan, rotor), strict=True):
        if isinstance(one.guard, float) and one.guard > limit:
            name = freedoms[int(plan.parts.tree_v[spin.col])]
            return (
                f"the spin of {name} has no inertia, but mass beside its line. Put the centre of mass on the "
                "line, or give it an inertia about it"
            )
    return ""
