"""Find the idle spins of a module, and decide whether they have inertia.

Idle spins: a rod between two balls turns about its axis, which moves no output, motor or centre of mass. A
spin is a motion of one joint about a line that is fixed in the joint's body. The closures of the loops do not
feel it, so it is an independent motion, however the others are chosen. The motions of a module are its spins,
and motions orthogonal to them, as the general path takes them. Where a rod's foot rests on the base, those
need the same forces whatever accelerations the caller gives to the spins; an arm that moves turns the rod
about its line, too, and feels them.

A thin rod has none about its line: no force may act along its spin, and its acceleration is the least, zero.
What arguments decide is decided where they are known. Between rounding and an inertia that is certainly one,
the general path decides, and where a rod without inertia about its line has mass beside it.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from ...assembly.free_motions import IDLE, effects
from ...dynamics.guards import FORCED
from ...spatial import Array, Index, motion_to_body
from ...structure.mechanism import Mechanism
from ...symbols import Expression, dot, is_zero, minus, times
from .expressions import along, numbers, scalar, snap
from .rigid import Links, freedoms, momentum
from .scales import Scale, squares

#: A closure does not feel a motion that opens it by less than this, without units: rounding. The spin of a
#: leg moves its mass by less, too.
UNFELT = 1e-13
#: Inertia of a spin, over that of its body about all axes, that is rounding, and that is none, in roundings.
ROUNDED_SPIN, CERTAIN = 50.0, 5000.0
#: Largest growth of the rounding of a motion's inertia in the accelerations of others, by the square of their
#: coupling over this inertia: to 1e-10.
AMPLIFIED = 5e5


#: Joints that may spin.


@dataclass(frozen=True, eq=False)
class Spin:
    """An idle motion of one joint.

    Attributes:
        cols: Freedoms of the joint, in the tree after the cuts, a core or a leg.
        axis: Rates of these freedoms at a spin of one.
        share: Weights of these freedoms: the spin in a motion is their sum, 0 for motions orthogonal to it.
    """

    cols: tuple[int, ...]
    axis: Expression
    share: Expression

    @property
    def col(self) -> int:
        """The freedom that stands for the spin: the others can make up for it."""
        return self.cols[self.main]

    @property
    def main(self) -> int:
        """The number of this freedom in the joint."""
        return int(np.argmax(np.abs(np.array(self.axis * self.share, dtype=float))))

    def taken_out(self, X: Expression) -> None:
        """Make motions orthogonal to the spin in place, shape (n, motions)."""
        at = list(self.cols)
        share = dot(self.share, X[at])
        for i, x in zip(at, self.axis, strict=True):
            X[i] = [
                y if is_zero(x) or is_zero(z) else y - times(x, z) for y, z in zip(X[i], share, strict=True)
            ]

    def at(self, number: dict[int, int] | Index) -> Spin:
        """Return the spin with its freedoms numbered anew."""
        return replace(self, cols=tuple(int(number[col]) for col in self.cols))


def spins_of(m: Mechanism, driven: Container[int]) -> list[Spin]:
    """Find the idle spins of a module.

    Args:
        m: Its numbers.
        driven: Freedoms of the tree after the cuts that motors drive.
    """
    out: list[Spin] = []
    if not m.closures.rows or not m.mobility:
        return out
    K = m.reduction.scaled(m.generic_K)
    motion = m.tree.sweep(m.postures)
    moved = effects(m, motion)
    for i, (joint, at) in enumerate(zip(m.tree.joints, m.tree.v_slices, strict=True)):
        cols, unit = range(at.start, at.stop), m.reduction.col_scale[at]
        if (
            not (joint.kind.ball or joint.kind.hinge)
            or i in m.spec.platforms
            or any(col in driven for col in cols)
        ):
            continue
        _, s, Vt = np.linalg.svd(K[:, :, at].reshape(-1, len(cols)))
        axis = snap(Vt[-1] * np.sign(Vt[-1][np.argmax(np.abs(Vt[-1]))]))
        alone = len(cols) == 1 or s[-2] > IDLE
        if (
            s[-1] <= UNFELT * np.sqrt(len(K))
            and alone
            and np.abs(moved[:, :, at] @ (unit * axis)).max(initial=0.0) <= IDLE
        ):
            out.append(Spin(tuple(cols), unit * axis, axis / unit))
    return out


@dataclass(frozen=True)
class Decided:
    """Whether a spin has inertia.

    Attributes:
        has: 1 if it has, else 0; an expression where arguments decide.
        guard: Guard that this is certain.
    """

    has: Any
    guard: Any


def twists_of(spin: Spin, links: Links) -> dict[int, Expression]:
    """Return the twists of its body, and of slides on it, at a spin of one; by body, own frames."""
    first = next(i for i, at in freedoms(links).items() if at.start == spin.cols[0])
    twists = {first + 1: dot(numbers(links[first].S), numbers(spin.axis))}
    for i, link in links.items():
        if link.kind.slides and link.parent in twists:
            twists[i + 1] = motion_to_body(numbers(link.R), numbers(link.p), twists[link.parent])
    return twists


def momenta(spin: Spin, links: Links) -> dict[int, Expression]:
    """Compute the momentum of each body that a spin of one moves, own frames, shape (6,)."""
    return {i: momentum(numbers(links[i - 1].inertia), V) for i, V in twists_of(spin, links).items()}


def first_moment(spin: Spin, links: Links) -> Expression:
    """Compute how far a spin of one moves the mass of its body and of slides on it, shape (3 bodies,)."""
    return np.concatenate([P[:3] for P in momenta(spin, links).values()])


def decided(spin: Spin, links: Links, rotor: Array, reference: float, scale: Scale) -> Decided:
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


def without_forces(left: Expression, size: Any, scale: Scale) -> Any:
    """Return the guard of forces on spins without inertia, from terms of a given size."""
    weight = replace(scale, closed=unforced(scale)).weight(size)
    return times(squares(left), weight)
