"""Prove that loops cannot close: no side of a polygon is longer than the others together.

Two bodies share a point where a revolute or ball joint connects them, a closure of this kind, or a given
position. Each body keeps the distances between its points in every posture; those along a loop are the sides
of a polygon. All points on a revolute axis are shared; the one nearest to the corner before is taken, so that
the polygon of a planar loop lies in its plane. Bodies with given joints between them count as one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..description.groups import Groups
from ..linkage.newton import LoopProblem
from ..linkage.tree import Motion
from ..spatial import Array, Index

#: Joints whose bodies share a point, and whether they share an axis.
_SHARED = {"revolute": True, "continuous": True, "spherical": False}


@dataclass(frozen=True, eq=False)
class _Corner:
    """A point that two bodies share.

    Attributes:
        bodies: The bodies, from one to the next.
        points: The point on each body, shape (T, 3), [m].
        axes: The axis on each body, shape (T, 3); zero where only the point is shared.
        slack: Largest distance of the two points per unit of residual [m].
        known: Axes along which the points coincide, shape (k, 3).
    """

    bodies: tuple[int, int]
    points: Sequence[Array]
    axes: Sequence[Array]
    slack: float = 0.0
    known: Array = field(default_factory=lambda: np.eye(3))

    @property
    def reversed(self) -> _Corner:
        """The same corner, from the other body."""
        return replace(self, bodies=self.bodies[::-1], points=self.points[::-1], axes=self.axes[::-1])


def shortfall(
    problem: LoopProblem, q: Array, samples: Index, given: Sequence[int], tolerance: float
) -> Array:
    """Compute the length that a module's loops lack to close in any posture, as far as polygons prove it.

    Args:
        problem: The module's rows.
        q: Positions, shape (T, nq), of which those of the given joints count.
        samples: Index of each into the targets' samples, shape (T,).
        given: Indices of the joints whose positions are given.
        tolerance: Largest scaled residual of a closed posture.

    Returns:
        Shape (T,), [m]; zero where nothing is proven.
    """
    tree = problem.tree
    motion = tree.sweep(q)
    whole: Groups[int] = Groups()
    for joint in given:
        whole.join(tree.joints[joint].parent, joint + 1)
    corners = [*_of_targets(problem, motion, whole, samples), *_of_loops(problem, motion, whole)]
    out = np.zeros(len(q))
    for loop in _loops(whole.of(0), corners):
        out = np.maximum(out, _lacking(loop, tolerance))
    return out


def _of_targets(problem: LoopProblem, motion: Motion, whole: Groups[int], samples: Index) -> list[_Corner]:
    """Return the positions of bodies that are given on the base; `whole` names groups of bodies."""
    out = []
    for target in problem.targets:
        point, known, rows = target.point(motion)
        there = point - target.residual(motion, samples)[:, rows] @ known
        bodies = whole.of(0), whole.of(target.body)
        none = (np.zeros_like(point),) * 2
        slack = 2.0 * float(target.units[rows].max(initial=0.0))
        out.append(_Corner(bodies, (there, point), none, slack, known))
    return out


def _of_loops(problem: LoopProblem, motion: Motion, whole: Groups[int]) -> list[_Corner]:
    """Return the points that bodies share by joints and closures."""
    out = []
    for i, joint in enumerate(problem.tree.joints):
        bodies = whole.of(joint.parent), whole.of(i + 1)
        if joint.kind in _SHARED and bodies[0] != bodies[1]:
            axis = motion.R[:, i + 1] @ joint.axis * _SHARED[joint.kind]
            out.append(_Corner(bodies, (motion.p[:, i + 1],) * 2, (axis,) * 2))
    for c, at in zip(problem.closures.closures, problem.closures.row_slices, strict=False):
        if c.translations == (0, 1, 2):
            ends = (c.body_a, c.R_a, c.p_a), (c.body_b, c.R_b, c.p_b)
            points = [motion.p[:, b] + motion.R[:, b] @ p for b, _, p in ends]
            axes = [motion.R[:, b] @ R[:, 2] * (c.rotation == "parallel") for b, R, _ in ends]
            slack = 2.0 / float(problem.row_scale[at.start])
            out.append(_Corner((whole.of(c.body_a), whole.of(c.body_b)), points, axes, slack))
    return out


def _loops(base: int, corners: list[_Corner]) -> list[list[_Corner]]:
    """Return a loop of corners through each corner that is on no shortest way from the base to a body."""
    ways: dict[int, list[_Corner]] = {base: []}
    queue, others = [base], list(corners)
    for body in queue:
        for corner in corners:
            for one in (corner, corner.reversed):
                if one.bodies[0] == body and one.bodies[1] not in ways:
                    ways[one.bodies[1]] = [*ways[body], one]
                    queue.append(one.bodies[1])
                    others.remove(corner)
    out = []
    for corner in others:
        if corner.bodies[0] in ways:
            there, back = (ways[body] for body in corner.bodies)
            common = sum(1 for a, b in zip(there, back, strict=False) if a is b)
            out.append([*there[common:], corner, *(one.reversed for one in reversed(back[common:]))])
    return out


def _lacking(loop: list[_Corner], tolerance: float) -> Array:
    """Compute by how much the longest side of a loop exceeds the others together, shape (T,)."""
    first, last = loop[0], loop[-1]
    here, slack = first.points[1], np.full(len(first.points[1]), first.slack)
    sides = []
    for corner in loop[1:]:
        along = np.einsum("ti,ti->t", here - corner.points[0], corner.axes[0])[:, None]
        sides.append(np.linalg.norm(here - corner.points[0] - along * corner.axes[0], axis=1))
        here = corner.points[1] + along * corner.axes[1]
        slack += corner.slack + 2.0 * np.abs(along[:, 0]) * (corner.slack > 0)
    partial = {id(one): one.known for one in (first, last) if len(one.known) < 3}
    known = [*partial.values(), np.eye(3)][0] if len(partial) < 2 else np.zeros((0, 3))
    sides.append(np.linalg.norm((here - first.points[0]) @ known.T, axis=1))
    every = np.array(sides)
    # Where the point is given only in part, the last side is at least this long.
    longest = every[-1] if partial else every.max(axis=0)
    out: Array = 2.0 * longest - every.sum(axis=0) - tolerance * slack
    return out
