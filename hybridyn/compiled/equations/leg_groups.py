"""Branches of a module's whole tree; legs that hang alone between base and a platform, grouped by equality.

A branch is some joints of the whole tree (`structure.cut`), by their numbers there.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...linkage.closures import TreeClosure
from ...spatial import Index, indices
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from .idle.motion import IdleMotion, first_moment, idle_among
from .rigid import Links
from .rods import UNFELT

#: Digits in which the axes of equal legs agree; the rest is rounding.
ROUNDED_AXIS = 14

#: Least reciprocal condition number (median over generic postures) of a leg's closure Jacobian: above it the
#: closure determines the leg's joints.
LOCATED_LEG = 1e-4


@dataclass(frozen=True, eq=False)
class TreeBranch:
    """Some joints of the whole tree of a module.

    Attributes:
        mechanism: The module.
        links: Their links, parents first, by the number of the joint in the whole tree.
    """

    mechanism: Mechanism
    links: Links

    @cached_property
    def tree_q(self) -> Index:
        """Its coordinates in the whole tree."""
        return indices(self.mechanism.cut.whole.q_slices[i] for i in self.links)

    @cached_property
    def tree_v(self) -> Index:
        """Its freedoms in the whole tree."""
        return indices(self.mechanism.cut.whole.v_slices[i] for i in self.links)

    @property
    def q(self) -> Index:
        """Its coordinates in the module's spanning tree, -1 for those of platforms."""
        return self.mechanism.cut.q_in[self.tree_q]

    @property
    def v(self) -> Index:
        """Its freedoms in the module's spanning tree, -1 for those of platforms."""
        return self.mechanism.cut.v_in[self.tree_v]


@dataclass(frozen=True, eq=False)
class Leg(TreeBranch):
    """One leg of a group.

    Attributes:
        closure: Its closure, with frames in aligned axes.
        on_a: Whether the leg's body is the closure's predecessor.
        idle: Its idle motion, with freedoms of the leg, or None.
    """

    closure: TreeClosure
    on_a: bool
    idle: IdleMotion | None

    @property
    def end(self) -> int:
        """Body of the leg in the closure."""
        return self.closure.body_a if self.on_a else self.closure.body_b

    @property
    def platform(self) -> int:
        """Joint of the platform that the closure connects it to."""
        return (self.closure.body_b if self.on_a else self.closure.body_a) - 1

    def among(self, freedoms: Container[int]) -> list[int]:
        """Return those of its freedoms that are among some of `tree_v`, numbered inside the leg."""
        return [j for j, k in enumerate(self.tree_v) if k in freedoms]


def held_legs(mechanism: Mechanism, idle: Sequence[IdleMotion], links: Links) -> dict[tuple[int, ...], int]:
    """Return the legs that may be grouped, as bodies of the tree, each with the closure at its end.

    An idle motion that moves mass by more than rounding, if less than `IDLE`, is left to the core, as are
    those of floating bodies.
    """
    size = mechanism.length * sum(body.mass for body in mechanism.spec.leg_bodies if body)
    still = [
        motion
        for motion in idle
        if len(motion.cols) <= 3
        and np.abs(first_moment(motion.in_own_axes(links), links)).max() <= UNFELT * size
    ]
    found = {bodies: _closure_of_leg(mechanism, bodies, still) for bodies in mechanism.spec.legs}
    return {bodies: at for bodies, at in found.items() if at is not None}


def leg_of(
    mechanism: Mechanism,
    bodies: tuple[int, ...],
    links: Links,
    closure: TreeClosure,
    idle: Sequence[IdleMotion],
) -> Leg:
    """Return a leg."""
    own = TreeBranch(mechanism, {i: links[i] for i in sorted(body - 1 for body in bodies)})
    own_idle = next(iter(idle_among(idle, own.tree_v)), None)
    return Leg(mechanism, own.links, closure, closure.body_a in bodies, own_idle)


def _closure_of_leg(mechanism: Mechanism, bodies: tuple[int, ...], idle: Sequence[IdleMotion]) -> int | None:
    """Return the closure between a leg and a platform that determines all but its idle motion, or None."""
    spec, tree, inside = mechanism.spec, mechanism.tree, set(bodies)
    touching = [i for i, c in enumerate(spec.cut_closures) if {c.body_a, c.body_b} & inside]
    wrists = {weld.body_b for weld in mechanism.cut.welds}  # of which some may end in it
    if len(touching) != 1 or wrists & inside or not _hangs_alone(spec, inside):
        return None
    at = touching[0]
    c = spec.cut_closures[at]
    other = c.body_b if c.body_a in inside else c.body_a
    whole = len(c.translations) == 3 and c.rotation in ("free", "fixed", "parallel")
    cols = np.concatenate([np.arange(tree.nv)[tree.v_slices[b - 1]] for b in bodies])
    own = [motion.col for motion in idle_among(idle, cols)]
    determined = np.delete(cols, own)
    if other - 1 not in spec.platforms or not whole or c.rows != len(determined) or len(own) > 1:
        return None
    K = mechanism.reduction.scaled(mechanism.generic_K)[:, mechanism.closures.row_slices[at]][
        :, :, determined
    ]
    s = np.linalg.svd(K, compute_uv=False)
    return at if np.median(s[:, -1] / s[:, 0]) > LOCATED_LEG else None


def _hangs_alone(spec: ModuleSpec, inside: set[int]) -> bool:
    """Return whether bodies hang from the base alone and carry no other body, no output and no coupling."""
    parents = {spec.tree[b - 1].parent for b in inside}
    hanging = {joint.parent for i, joint in enumerate(spec.tree) if i + 1 not in inside}
    coupled = {j + 1 for c in spec.cut_couplings for j, _ in c.terms}
    return parents <= inside | {0} and not inside & (hanging | coupled | set(spec.outputs))


def grouped_legs(legs: list[Leg], marks: tuple[str, ...]) -> tuple[tuple[Leg, ...], ...]:
    """Group legs that differ in their numbers only."""
    out: dict[tuple[object, ...], list[Leg]] = {}
    for leg in legs:
        links, place = leg.links.values(), {0: 0} | {i + 1: n for n, i in enumerate(leg.links, 1)}
        axes = [tuple(link.axis.round(ROUNDED_AXIS).tolist()) if link.nv == 1 else () for link in links]
        shape = tuple(
            (link.kind, place[link.parent], axis, link.pitch, link.ball is None)
            for link, axis in zip(links, axes, strict=True)
        )
        acting = tuple(marks[k] for k in leg.tree_v), leg.idle and leg.idle.cols
        key = shape, acting, place[leg.end], leg.platform, leg.closure.rotation
        out.setdefault(key, []).append(leg)
    return tuple(tuple(group) for group in out.values())
