"""Prove that loops cannot close: no side of a polygon is longer than the others together.

Two bodies share a point where a revolute or ball joint connects them, a closure of this kind, or a given
position. Each body keeps the distances between its points in every posture; those along a loop are the sides
of a polygon. All points on a revolute axis are shared; the one nearest to the corner before is taken, so that
the polygon of a planar loop lies in its plane. Bodies with given joints between them count as one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..description.groups import Groups
from ..joints.kinds import JointKind
from ..linkage.loop_problem import LoopProblem
from ..linkage.motion import Motion
from ..linkage.targets import Target
from ..spatial import Array, Index, rotate


class Corner(NamedTuple):
    """A point that two bodies share.

    Attributes:
        bodies: The bodies, from one to the next.
        points: The point on each body, shape (T, 3), [m].
        axes: The axis on each body, shape (T, 3); zero where only the point is shared.
        slack: Largest distance of the two points per unit of residual [m].
        known: Axes along which the points coincide, shape (k, 3) or (T, k, 3).
        part: Which of the two points is known along these axes only; the axes are those of its body.
    """

    bodies: tuple[int, int]
    points: Sequence[Array]
    axes: Sequence[Array]
    slack: float = 0.0
    known: Array = np.eye(3)
    part: int = 0

    @property
    def reversed(self) -> Corner:
        """The same corner, from the other body."""
        return self._replace(
            bodies=self.bodies[::-1], points=self.points[::-1], axes=self.axes[::-1], part=1 - self.part
        )

    @property
    def whole(self) -> bool:
        """Whether the points coincide."""
        return bool(self.known.shape[-2] == 3)

    def seen(self, R: Array, p: Array) -> Corner:
        """Return the corner in a frame in which its own has the placement R, p, shapes (T, 3, 3), (T, 3)."""
        points = [rotate(R, point) + p for point in self.points]
        axes = [rotate(R, axis) for axis in self.axes]
        return self._replace(points=points, axes=axes, known=np.matmul(self.known, np.swapaxes(R, 1, 2)))


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
    whole: Groups[int] = Groups()
    join_given(problem, given, whole.join)
    motion = problem.tree.sweep(q)
    return most_lacking(whole.of(0), corners_of(problem, motion, samples, whole.of), len(q), tolerance)


def join_given(problem: LoopProblem, given: Sequence[int], join: Callable[[int, int], object]) -> None:
    """Join the bodies between which joints have given positions."""
    for joint in given:
        join(problem.tree.joints[joint].parent, joint + 1)


def corners_of(
    problem: LoopProblem, motion: Motion, samples: Index, group: Callable[[int], int]
) -> list[Corner]:
    """Return the points that the bodies of a module share; `group` names what is one rigid body."""
    targets = [
        corner_of(target, motion, samples, (group(0), group(target.body))) for target in problem.targets
    ]
    return [*targets, *_of_loops(problem, motion, group)]


def most_lacking(base: int, corners: list[Corner], samples: int, tolerance: float) -> Array:
    """Compute the length that the loops of corners lack, shape (samples,), [m]; zero if nothing is proven."""
    out = np.zeros(samples)
    for loop in _loops(base, corners):
        out = np.maximum(out, _lacking(loop, tolerance))
    return out


def corner_of(target: Target, motion: Motion, samples: Index, bodies: tuple[int, int]) -> Corner:
    """Return the position of a body that is given on the base, the first of `bodies`."""
    point, known, rows = target.point(motion)
    there = point - target.residual(motion, samples)[:, rows] @ known
    none = (np.zeros_like(point),) * 2
    slack = 2.0 * float(target.units[rows].max(initial=0.0))
    return Corner(bodies, (there, point), none, slack, known)


def _of_loops(problem: LoopProblem, motion: Motion, group: Callable[[int], int]) -> list[Corner]:
    """Return the points that bodies share by joints and closures."""
    out = []
    for i, joint in enumerate(problem.tree.joints):
        bodies = group(joint.parent), group(i + 1)
        if (joint.kind.hinge or joint.kind is JointKind.SPHERICAL) and bodies[0] != bodies[1]:
            axis = motion.R[:, i + 1] @ joint.axis * joint.kind.hinge
            out.append(Corner(bodies, (motion.p[:, i + 1],) * 2, (axis,) * 2))
    for c, at in zip(problem.closures.closures, problem.closures.row_slices, strict=False):
        if c.translations == (0, 1, 2):
            ends = (c.body_a, c.R_a, c.p_a), (c.body_b, c.R_b, c.p_b)
            points = [motion.p[:, b] + motion.R[:, b] @ p for b, _, p in ends]
            axes = [motion.R[:, b] @ R[:, 2] * (c.rotation == "parallel") for b, R, _ in ends]
            slack = 2.0 / float(problem.row_scale[at.start])
            out.append(Corner((group(c.body_a), group(c.body_b)), points, axes, slack))
    return out


def _loops(base: int, corners: list[Corner]) -> list[list[Corner]]:
    """Return a loop of corners through each corner that is on no shortest way from the base to a body."""
    ways: dict[int, list[Corner]] = {base: []}
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


def _turned(loop: list[Corner]) -> list[Corner] | None:
    """Return a loop from a corner on that is known in part, if one is, on the body on which it is.

    Returns:
        The loop, or None if others are known in part, but for the one before, on the same body.
    """
    if all(corner.whole for corner in loop):
        return loop
    if not any(not corner.whole and corner.part == 0 for corner in loop):
        loop = [corner.reversed for corner in reversed(loop)]
    first = next(i for i, corner in enumerate(loop) if not corner.whole and corner.part == 0)
    loop = loop[first:] + loop[:first]
    last = loop[-1].whole or loop[-1].part == 1
    return loop if last and all(corner.whole for corner in loop[1:-1]) else None


def _lacking(loop: list[Corner], tolerance: float) -> Array | float:
    """Compute by how much the longest side of a loop exceeds the others together, shape (T,)."""
    turned = _turned(loop)
    if turned is None:
        return 0.0
    loop, first, last = turned, turned[0], turned[-1]
    here, slack = first.points[1], np.full(len(first.points[1]), first.slack)
    sides = []
    for corner in loop[1:]:
        along = np.einsum("ti,ti->t", here - corner.points[0], corner.axes[0])[:, None]
        sides.append(np.linalg.norm(here - corner.points[0] - along * corner.axes[0], axis=1))
        here = corner.points[1] + along * corner.axes[1]
        slack += corner.slack + 2.0 * np.abs(along[:, 0]) * (corner.slack > 0)
    partial = {id(one): one.known for one in (first, last) if not one.whole}
    known = [*partial.values(), np.eye(3)][0] if len(partial) < 2 else np.zeros((0, 3))
    sides.append(np.linalg.norm(np.matmul(known, (here - first.points[0])[:, :, None])[:, :, 0], axis=1))
    every = np.array(sides)
    # Where the point is given only in part, the last side is at least this long.
    longest = every[-1] if partial else every.max(axis=0)
    out: Array = 2.0 * longest - every.sum(axis=0) - tolerance * slack
    return out
