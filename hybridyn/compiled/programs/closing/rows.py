"""Rows of closures, couplings, targets and wrists over an extended tree, and a posture's check by them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from ....linkage.angles import turn_rates
from ....linkage.closures import TreeClosure
from ....linkage.tree import Tree
from ....spatial import Array, rotation_from_quaternion
from ....structure.robot import HybridRobot
from ....symbols import Expression, dot
from ...equations.expressions import Folding, pack, plain, symbols, zeros
from ...equations.legs import fold_links
from ...equations.rigid import Links, links_of
from ...equations.scales import largest
from ...loops.loop_rows import LoopRows, fewest_turns, folded
from ...program import Program
from ..writer import ModuleWriter, alike
from .extended import Extended, extended
from .given import ANGLE, Given, GivenCoordinates
from .module_parts import CLOSED_TO_ROUNDING, Part, kinds_of

#: For each link, its body and its placement (R, p) there, which may be arguments (`Bodies.place`).
Places = Mapping[str, tuple[int, Any, Any]]
#: Least cosine of the pitch at which rates of roll and yaw are computed.
LEAST_COSINE = 1e-6


class TreeRows(LoopRows):
    """Rows at one posture: first those of the tree after the cuts, then those of its wrists.

    Attributes:
        upright: Cosines that are positive where no two axes are more than a right angle apart.
        frames: Axes of each target, shape (3, 3).
    """

    def __init__(self, links: Links, q: Expression, v: Expression | None) -> None:
        """Begin without rows."""
        super().__init__(links, q, v)
        self.upright: list[ca.SX] = []
        self.frames: list[Expression] = []

    def close(self, closure: TreeClosure) -> None:
        """Add the rows of a closure."""
        super().close(closure)
        if closure.rotation in ("fixed", "parallel"):
            A, B = (
                dot(self.writer.motion.R[0, body], axes)
                for body, axes in ((closure.body_a, closure.R_a), (closure.body_b, closure.R_b))
            )
            cosines = [ca.SX(dot(A[:, i], B[:, i][:, None])[0]) for i in range(3)]
            whole = cosines[0] + cosines[1] + cosines[2] - 1.0
            self.upright.append(cosines[2] if closure.rotation == "parallel" else whole)

    def prescribe(self, some: GivenCoordinates, wanted: Expression, weld: TreeClosure) -> None:
        """Add the rows of coordinates of a link: x, y, z, roll, pitch and yaw as in `linkage.targets`.

        Args:
            wanted: Their prescribed values, shape (coordinates,).
            weld: Of the frame in which they are measured, A, and that of the link.
        """
        off, over = self.writer.closure(weld)  # the last three rates are angular velocities
        R = dot(weld.R_a.T, dot(self.writer.motion.R[0, weld.body_b], weld.R_b))
        values, to_rates, cosine = coordinate_rows(R, off[:3])
        rows = [*over[:3], *dot(to_rates, over[3:])]
        for row, kind, value in zip(some.rows, some.kinds, wanted, strict=True):
            miss = values[row] - value
            if kind == ANGLE:
                miss = miss - 2 * np.pi * ca.floor(miss / (2 * np.pi) + 0.5)
            self.add(rows[row][None], np.array([miss], dtype=object))
        if ANGLE in some.kinds:
            self.upright.append(ca.SX(cosine - LEAST_COSINE))


def coordinate_rows(R: Expression, p: Expression, side: Any = 1.0) -> tuple[list[Any], Expression, Any]:
    """Return x, y, z, roll, pitch and yaw of a frame in another.

    Args:
        R: Axes of the frame in the other, shape (3, 3).
        p: Its origin there, shape (3,).
        side: 1 for the upright triple of angles, -1 for the other one.

    Returns:
        The coordinates, the map from the angular velocity to the rates of the angles, shape (3, 3), and the
        cosine of the pitch.
    """
    cosine = side * ca.sqrt(R[0, 0] ** 2 + R[1, 0] ** 2)
    roll, yaw = ca.atan2(side * R[2, 1], side * R[2, 2]), ca.atan2(side * R[1, 0], side * R[0, 0])
    angles = [roll, ca.atan2(-R[2, 0], cosine), yaw]
    to_rates = turn_rates((R[0, 0] / cosine, R[1, 0] / cosine), (cosine, -R[2, 0]))
    return [*p, *angles], to_rates, cosine


def _weld(body: int, R_a: Expression, p_a: Expression, R_b: Expression, p_b: Expression) -> TreeClosure:
    """Return the closure of a whole pose of a frame in a body, in a frame of the base."""
    return TreeClosure("", "", 0, R_a, p_a, body, R_b, p_b, (0, 1, 2), "fixed")


def rows_at(
    trees: Sequence[Extended],
    given: Given,
    folding: Folding,
    z: Expression,
    targets: Expression,
    places: Places,
    v: Expression | None = None,
    *,
    exact: bool = False,
) -> TreeRows:
    """Write the rows of modules of one shape.

    Args:
        given: What is prescribed.
        folding: Collects the numbers in which they differ.
        z: Positions of the extended tree, shape (nq,).
        targets: Prescribed poses, then coordinates, shape (7 poses + coordinates,).
        places: Frames of the links whose coordinates are prescribed.
        v: Rates of the freedoms, for `TreeRows.rates`, or None.
        exact: Whether rows on rods hold for open loops, too.
    """
    links = fold_links(folding, [links_of(t.joints) for t in trees])
    out = TreeRows(links, z, v)
    out.exact = exact
    closures, couplings = [t.closures for t in trees], [t.couplings for t in trees]
    out.close_all(closures, couplings, fewest_turns([t.rods for t in trees]), folding, z)
    _prescribe(out, given, targets, places, lambda x: folding.array([x] * len(trees)))
    for same in zip(*(t.welds for t in trees), strict=True):
        out.close(folded(folding, same))
    return out


def _prescribe(
    rows: TreeRows, given: Given, targets: Expression, places: Places, fold: Callable[[Array], Expression]
) -> None:
    """Add the rows of targets; arguments as of `rows_at`, `fold` makes a number that modules share."""
    for i, body in enumerate(given.bodies):
        pose = targets[7 * i : 7 * i + 7]
        rows.frames.append(rotation_from_quaternion(pose[3:]))
        rows.close(_weld(body, rows.frames[-1], pose[:3], plain(np.eye(3)), zeros(3)))
    at = 7 * len(given.bodies)
    for some in given.coordinates:
        frames = [x for link in reversed(some.links) for x in places[link][1:]]
        other_R, other_p, R, p = map(fold, frames)
        rows.prescribe(some, targets[at : at + len(some.names)], _weld(some.body, other_R, other_p, R, p))
        at += len(some.names)


def row_scales(tree: Extended, given: Given) -> Array:
    """Return the factor that makes each row dimensionless, shape (rows,)."""
    pose = np.array([1.0 / tree.length] * 3 + [1.0] * 3)
    coordinates = [1.0 / some.target.units for some in given.coordinates]
    poses, welds = [pose] * len(given.bodies), [pose] * len(tree.welds)
    return np.concatenate([tree.row_scale, *poses, *coordinates, *welds])


def place_program(robot: HybridRobot, parts: Sequence[Part]) -> Program:
    """Write the program "place": from a posture "q_0" to "p" and "g", the platforms and what is prescribed.

    The guard is at most 1 where the posture closes the loops to rounding.

    Args:
        parts: Its modules but a free base; only joints are prescribed.
    """
    w = ModuleWriter("place", {"q_0": "q"}, {"p": "p", "g": "g"}, kinds_of(robot, parts))

    def key(k: int) -> tuple[object, ...]:
        """Return what parts with the same kernel have in common."""
        m = parts[k].module.mechanism
        spanning = tuple((j.kind, j.parent, tuple(j.axis.tolist())) for j in m.spanning.joints)
        return extended(m).shape, parts[k].given, spanning, tuple(m.cut.bodies.tolist())

    for shape, numbers in alike(range(len(parts)), key).items():
        w.add(shape, numbers, _kernel([parts[k] for k in numbers]))
    return w.program()


def _kernel(parts: Sequence[Part]) -> tuple[ca.Function, Array]:
    """Return the kernel of modules of one shape, and the table of numbers in which they differ."""
    given, trees = parts[0].given, [extended(part.module.mechanism) for part in parts]
    e, m, folding = trees[0], parts[0].module.mechanism, Folding()
    spanning = m.spanning
    column, q = symbols("q", spanning.nq)
    links = fold_links(folding, [links_of(x.module.mechanism.spec.spanning) for x in parts])
    motion = Tree([*links.values()]).sweep(q[None])
    z = []
    for joint, source in enumerate(e.source):
        if source is None:
            body = int(m.cut.bodies[joint + 1])
            z.append(np.concatenate([motion.p[0, body], quaternion_of(motion.R[0, body])]))
        else:
            z.append(q[spanning.q_slices[source]])
    rows = rows_at(trees, given, folding, np.concatenate([zeros(0), *z]), zeros(0), {})
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
        if not joint.kind.additive:
            unit = q[at][joint.kind.shift :]
            off = ca.fmax(off, ca.fabs(sum((x * x for x in unit), ca.SX(-1.0))))
    return off


def quaternion_of(R: Expression) -> Expression:
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
