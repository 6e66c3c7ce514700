"""Closures as UsdPhysics joints that are excluded from the articulation."""

from __future__ import annotations

import numpy as np

from ...description.placement import turned
from ...description.records import Closure
from ...description.usd.joints import AXES
from ...description.usd.trees import SECOND_AXIS
from ..numerals import numeral
from .joints import add_ends, lock
from .prims import Prim

#: Types of prims that lock what a closure locks; its axis is z.
TYPES = {
    ((0, 1, 2), "fixed"): "Fixed",
    ((0, 1, 2), "parallel"): "Revolute",
    ((0, 1), "fixed"): "Prismatic",
    ((0, 1, 2), "free"): "Spherical",
}

#: Rotations of a generic joint that a closure locks. Of a universal joint USD locks the twist about x.
TURNS = {"free": (), "perpendicular": ("rotX",), "parallel": ("rotX", "rotY"), "fixed": AXES[3:]}


def add_closure(parent: Prim, closure: Closure, bodies: tuple[Prim, Prim]) -> None:
    """Add a closure."""
    kind = TYPES.get((closure.translations, closure.rotation), "")
    out = parent.child(f"Physics{kind}Joint", closure.name)
    far = closure.frame_b
    if closure.rotation == "perpendicular":
        far = turned(far, SECOND_AXIS)
        out.text("hybridyn:rotation", closure.rotation)
    add_ends(out, bodies, (closure.frame_a, far))
    out.line("uniform bool physics:excludeFromArticulation = true")
    if kind in ("Revolute", "Prismatic"):
        out.line('uniform token physics:axis = "Z"')
    if not kind:
        lock(out, [AXES[i] for i in closure.translations] + list(TURNS[closure.rotation]))
    if closure.kind != (kind.lower() or "rows"):
        out.text("hybridyn:kind", closure.kind)
    if not np.array_equal(closure.turn, np.eye(3)):
        rows = ", ".join(f"({', '.join(numeral(x) for x in row)})" for row in closure.turn)
        out.line(f"custom matrix3d hybridyn:turn = ({rows})")
