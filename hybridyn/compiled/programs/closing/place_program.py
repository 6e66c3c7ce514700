"""Program that checks whether a posture closes the loops, so that rows can follow from it (`c/closing.h`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....linkage.tree import Tree
from ....spatial import Array
from ....structure.robot import HybridRobot
from ...equations.chains import sweep
from ...equations.expressions import Expression, pack, symbols, zeros
from ...equations.folding import Folding
from ...equations.guards import largest
from ...equations.legs import fold_links
from ...equations.links import links_of
from ...program import Program, Worst
from ..writer import Writer
from .closing_programs import places_of
from .extended import extended
from .given import ANGLE
from .part import CLOSED_TO_ROUNDING, Part
from .rows import row_scales, rows_at


def place_program(robot: HybridRobot, parts: Sequence[Part]) -> Program:
    """Write the program "place": from a posture "q_0" to "p" and "g", the platforms and what is prescribed.

    The guard is at most 1 where the posture closes the loops to rounding.

    Args:
        parts: Its modules but a free base; only joints are prescribed.
    """
    shapes: dict[Any, list[int]] = {}
    for k, part in enumerate(parts):
        m = part.module.mechanism
        spanning = tuple((j.kind, j.parent, tuple(j.axis.tolist())) for j in m.spanning.joints)
        key = extended(m).shape, part.given, spanning, tuple(m.cut.bodies.tolist())
        shapes.setdefault(key, []).append(k)
    sizes = sum(part.platforms for part in parts), sum(part.given.size for part in parts)
    w = Writer("place", [("q_0", robot.nq)], [("p", sizes[0]), ("g", sizes[1])])
    for key, numbers in shapes.items():
        function, table = _kernel([parts[k] for k in numbers])
        at = places_of(parts, numbers)
        w.call(
            w.kernel(key, function, "closures"),
            len(numbers),
            [w.from_given("q_0", at["q"]), w.numbers(table, None)],
            [w.result("p", at["p"]), w.result("g", at["g"]), Worst()],
        )
    return w.program()


def _kernel(parts: Sequence[Part]) -> tuple[ca.Function, Array]:
    """Return the kernel of modules of one shape, and the table of numbers in which they differ."""
    given, trees = parts[0].given, [extended(part.module.mechanism) for part in parts]
    e, m, folding = trees[0], parts[0].module.mechanism, Folding()
    spanning = m.spanning
    column, q = symbols("q", spanning.nq)
    massless = [np.zeros(10)] * len(spanning.joints)
    links = fold_links(folding, [links_of(x.module.mechanism.spec.spanning, massless) for x in parts])
    chain = sweep(links, q, zeros(spanning.nv), zeros(6))
    z = []
    for joint, source in enumerate(e.source):
        if source is None:
            body = int(m.cut.bodies[joint + 1])
            z.append(np.concatenate([chain.p0[body], _quaternion(chain.R0[body])]))
        else:
            z.append(q[spanning.q_slices[source]])
    rows = rows_at(trees, given, folding, z, zeros(0), {})
    off = ca.fmax(largest(rows.residual * row_scales(e, given)), _bent(spanning, q))
    g = [
        [ca.atan2(z[joint][1], z[joint][0])] if kind == ANGLE else z[joint]
        for joint, kind in zip(given.joints, given.kinds, strict=True)
    ]
    outputs = [pack(*(z[i] for i in e.platforms)), pack(*g), off / CLOSED_TO_ROUNDING]
    return ca.Function("place", [column, folding.symbol()], outputs), folding.table(len(parts))


def _bent(tree: Tree, q: Expression) -> ca.SX:
    """Return how far cosines and sines of endless joints, and quaternions, are from a length of 1."""
    off = ca.SX(0.0)
    for joint, at in zip(tree.joints, tree.q_slices, strict=True):
        if joint.kind in ("continuous", "spherical", "floating"):
            unit = q[at][3 if joint.kind == "floating" else 0 :]
            off = ca.fmax(off, ca.fabs(sum((x * x for x in unit), ca.SX(-1.0))))
    return off


def _quaternion(R: Expression) -> Expression:
    """Compute the unit quaternion x, y, z, w of a rotation, as `spatial.quaternion_from_rotation`."""
    a, b, c = R[0, 0], R[1, 1], R[2, 2]
    xy, xz, yz = R[0, 1] + R[1, 0], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1]
    wx, wy, wz = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    rows = [
        [1 + a - b - c, xy, xz, wx],
        [xy, 1 - a + b - c, yz, wy],
        [xz, yz, 1 - a - b + c, wz],
        [wx, wy, wz, 1 + a + b + c],
    ]
    best = [ca.SX(x) for x in rows[0]]
    largest_yet = best[0]
    for i in (1, 2, 3):
        better = rows[i][i] > largest_yet
        best = [ca.if_else(better, x, y) for x, y in zip(rows[i], best, strict=True)]
        largest_yet = ca.fmax(largest_yet, rows[i][i])
    length = ca.sqrt(sum((x * x for x in best), ca.SX(0.0)))
    return np.array([x / length for x in best], dtype=object)
