"""Motions of the trees of several modules that stand on one another, or on modules whose motion is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...linkage.motion import Motion
from ...linkage.tree import Tree
from ...spatial import Array, Index, Mask, rotate


@dataclass(frozen=True, eq=False)
class CarriedFrame:
    """A frame that a body of a part carries.

    Attributes:
        part: Number of the part; -1 for the base of the chain.
        body: Number of the body in the part's tree.
        ways: Known motions at every sample, each of a frame in the one before, from that body to the frame.
    """

    part: int
    body: int
    ways: tuple[Motion, ...]

    @cached_property
    def inner(self) -> Motion:
        """The frame's known motion in the body at every sample."""
        return reduce(Motion.then, self.ways)

    def ahead(self, step: Array) -> CarriedFrame:
        """Return the place after small times, shape (T,), to second order."""
        return replace(self, ways=(self.inner.ahead(step),))


class ChainMotion(NamedTuple):
    """Motions of the parts' trees, each in its own base."""

    parts: tuple[Motion, ...]

    def take(self, samples: Index | Mask) -> ChainMotion:
        """Return the motions at some samples (indices or a mask)."""
        return ChainMotion(tuple(motion.take(samples) for motion in self.parts))


class ChainTree:
    """The trees of the parts beside one another: their coordinates follow each other.

    Attributes:
        trees: The trees.
        nq: Number of position coordinates.
        nv: Number of velocities.
    """

    def __init__(self, trees: Sequence[Tree]) -> None:
        self.trees = tuple(trees)
        self.nq, self.nv = sum(tree.nq for tree in trees), sum(tree.nv for tree in trees)

    @cached_property
    def q_of(self) -> list[slice]:
        """Coordinates of each part."""
        return [slice(*ends) for ends in pairwise(np.cumsum([0, *(tree.nq for tree in self.trees)]).tolist())]

    @cached_property
    def v_of(self) -> list[slice]:
        """Freedoms of each part."""
        return [slice(*ends) for ends in pairwise(np.cumsum([0, *(tree.nv for tree in self.trees)]).tolist())]

    def integrate(self, q: Array, dq: Array) -> Array:
        """Integrate constant joint twists dq from q over unit time, shapes (T, nq), (T, nv)."""
        parts = zip(self.trees, self.q_of, self.v_of, strict=True)
        return np.concatenate([tree.integrate(q[:, at], dq[:, to]) for tree, at, to in parts], axis=1)

    def bending(self, v: Array) -> Array:
        """Compute the second time derivative of the displacement of constant rates, shape (T, nv)."""
        parts = zip(self.trees, self.v_of, strict=True)
        return np.concatenate([tree.bending(v[:, to]) for tree, to in parts], axis=1)

    def difference(self, q0: Array, q1: Array) -> Array:
        """Compute the joint twists dq with `integrate(q0, dq) = q1`, shape (T, nv)."""
        parts = zip(self.trees, self.q_of, strict=True)
        return np.concatenate([tree.difference(q0[:, at], q1[:, at]) for tree, at in parts], axis=1)

    def sweep(
        self, q: Array, v: Array | None = None, a: Array | None = None, at: ChainMotion | None = None
    ) -> ChainMotion:
        """Compute the motion of every part in its own base, as `Tree.sweep`."""
        known = (None,) * len(self.trees) if at is None else at.parts
        motions = []
        for tree, i, j, own in zip(self.trees, self.q_of, self.v_of, known, strict=True):
            rates, accelerations = (None if x is None else x[:, j] for x in (v, a))
            motions.append(tree.sweep(q[:, i], rates, accelerations, own))
        return ChainMotion(tuple(motions))


@dataclass(frozen=True, eq=False)
class Carried:
    """The parts of a chain and what carries them.

    Attributes:
        bases: The frame that is the base of each part; it is carried by an earlier part.
    """

    bases: tuple[CarriedFrame, ...]

    def way(self, place: CarriedFrame) -> dict[int, int]:
        """Return the parts that move a frame, each with its body that carries the rest of the way."""
        out = {}
        while place.part >= 0:
            out[place.part] = place.body
            place = self.bases[place.part]
        return out


class Frames:
    """Frames of a chain at postures, in the base of the chain; each is computed once.

    Attributes:
        bases: Motion of the base of each part.
    """

    def __init__(self, carried: Carried, motion: ChainMotion, samples: Index, *, moving: bool) -> None:
        """Compute the motions of the parts' bases.

        Args:
            carried: What carries the parts.
            motion: Motions of the parts.
            samples: Index of each posture into the known motions.
            moving: Whether rates and accelerations count; without them, all frames are at rest.
        """
        self._parts, self._samples, self._moving = motion.parts, samples, moving
        self._known: dict[CarriedFrame, Motion] = {}
        self.bases: list[Motion] = []
        for base in carried.bases:
            self.bases.append(self.of(base))

    def of(self, place: CarriedFrame) -> Motion:
        """Return the motion of a frame."""
        if place not in self._known:
            self._known[place] = self._found(place)
        return self._known[place]

    def _found(self, place: CarriedFrame) -> Motion:
        """Compute the motion of a frame."""
        inner = place.inner
        inner = (
            inner.take(self._samples)
            if self._moving
            else _at_rest(inner.R[self._samples], inner.p[self._samples])
        )
        if place.part < 0:
            return inner
        base, body = self.bases[place.part], self._parts[place.part].of_body(place.body)
        return self._then(self._then(base, body), inner)

    def seen(self, link: CarriedFrame, other: CarriedFrame) -> Motion:
        """Return the motion of a frame in another, as that of body 1 of a tree whose base is the other."""
        one, base = self.of(link), self.of(other)
        if self._moving:
            seen = one.seen_from(base)
            rest = Motion.at_rest(len(seen.p))
            return Motion(*(np.stack([x, y], axis=1) for x, y in zip(rest.arrays, seen.arrays, strict=True)))
        back = np.swapaxes(base.R, 1, 2)
        R, p = np.empty((len(back), 2, 3, 3)), np.zeros((len(back), 2, 3))
        R[:, 0], R[:, 1] = np.eye(3), np.matmul(back, one.R)
        p[:, 1] = rotate(back, one.p - base.p)
        return _at_rest(R, p)

    def _then(self, outer: Motion, inner: Motion) -> Motion:
        """Return the motion of a frame in another one."""
        if self._moving:
            return outer.then(inner)
        return _at_rest(np.matmul(outer.R, inner.R), outer.p + rotate(outer.R, inner.p))


def _at_rest(R: Array, p: Array) -> Motion:
    """Return frames at rest at placements, shapes (T, ..., 3, 3) and (T, ..., 3)."""
    zero = np.zeros(p.shape)
    return Motion(R, p, zero, zero, zero, zero)
