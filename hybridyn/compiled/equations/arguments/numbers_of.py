"""Traced numbers of modules as expressions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from ....linkage.closures import TreeClosure, TreeCoupling
from ....linkage.joints import TreeJoint
from ....spatial import Array
from ....structure.bodies import Body
from ....structure.module_spec import ModuleSpec
from ....structure.wrists import Wrist
from ..expressions import Expression
from .traced import Traced


def numbers_of(spec: ModuleSpec) -> ModuleSpec:
    """Return a module's traced numbers as expressions; arrays without any are plain numbers.

    Args:
        spec: The module's numbers; entries may be `Traced` with CasADi expressions.
    """

    def joints(every: tuple[TreeJoint, ...]) -> tuple[TreeJoint, ...]:
        """Replace the numbers of joints."""
        return tuple(replace(j, R=_array(j.R), p=_array(j.p)) for j in every)

    def closures(every: tuple[TreeClosure, ...]) -> tuple[TreeClosure, ...]:
        """Replace the numbers of closures."""
        frames = ("R_a", "p_a", "R_b", "p_b")
        return tuple(replace(c, **{name: _array(getattr(c, name)) for name in frames}) for c in every)

    def couplings(every: tuple[TreeCoupling, ...]) -> tuple[TreeCoupling, ...]:
        """Replace the numbers of couplings."""
        return tuple(replace(c, offset=_scalar(c.offset)) for c in every)

    def wrist(w: Wrist) -> Wrist:
        """Replace the numbers of a wrist."""
        return replace(w, R=_array(w.R), p=_array(w.p))

    def body(b: Body) -> Body:
        """Replace the numbers of a body."""
        return replace(b, mass=_scalar(b.mass), com=_array(b.com), inertia=_array(b.inertia))

    return replace(
        spec,
        spanning=joints(spec.spanning),
        tree=joints(spec.tree),
        closures=closures(spec.closures),
        couplings=couplings(spec.couplings),
        cut_closures=closures(spec.cut_closures),
        cut_couplings=couplings(spec.cut_couplings),
        wrists=tuple(wrist(w) for w in spec.wrists),
        outputs_inertia=tuple(body(b) for b in spec.outputs_inertia),
        leg_bodies=tuple(None if b is None else body(b) for b in spec.leg_bodies),
    )


def placed(place: Mapping[str, tuple[int, Array, Array]]) -> dict[str, tuple[int, Expression, Expression]]:
    """Return frames of links as expressions. `place`: `Bodies.place`, whose entries may be `Traced`."""
    return {link: (body, _array(R), _array(p)) for link, (body, R, p) in place.items()}


def depends(spec: ModuleSpec) -> bool:
    """Return whether some number of a module is no plain number."""
    arrays: list[Any] = [x for j in (*spec.spanning, *spec.tree) for x in (j.R, j.p)]
    arrays += [x for c in (*spec.closures, *spec.cut_closures) for x in (c.R_a, c.p_a, c.R_b, c.p_b)]
    arrays += [x for w in spec.wrists for x in (w.R, w.p)] + [c.offset for c in spec.couplings]
    bodies = [b for b in (*spec.outputs_inertia, *spec.leg_bodies) if b is not None]
    arrays += [x for b in bodies for x in (b.mass, b.com, b.inertia)]
    return any(np.asarray(x).dtype == object for x in arrays)


def _scalar(x: Any) -> Any:
    """Return a number, or its expression if it is traced and not constant."""
    if not isinstance(x, Traced):
        return float(x)
    expression = ca.SX(x.expression)
    return float(expression) if expression.is_constant() else expression


def _array(values: Any) -> Any:
    """Return an array of plain numbers, or of expressions if some entry is one."""
    if values.dtype != object:
        return values
    out = np.empty(values.shape, dtype=object)
    for at in np.ndindex(*values.shape):
        out[at] = _scalar(values[at])
    plain = all(isinstance(x, float) for x in out.ravel())
    return out.astype(float) if plain else out
