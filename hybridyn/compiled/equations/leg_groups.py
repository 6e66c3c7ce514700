"""Legs of a module that hang alone between its base and a platform, and groups of equal ones."""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...linkage.closures import TreeClosure
from ...spatial import Array, Index
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from ...structure.wrists import axis_frame
from .expressions import snap
from .rigid import LinkNumbers
from .spins import UNFELT, Spin, first_moment

#: Digits in which the axes of equal legs agree; the rest is rounding.
ROUNDED_AXIS = 14

#: Least reciprocal condition number (median over generic postures) of a leg's closure Jacobian: above it the
#: closure determines the leg's joints.
LOCATED_LEG = 1e-4


@dataclass(frozen=True, eq=False)
class Leg:
    """One leg of a group.

    Attributes:
        links: Its links, parents numbered inside the leg.
        closure: Its closure, with frames in aligned axes.
        on_a: Whether the leg's body is the closure's predecessor.
        end: Body of the leg in the closure, numbered inside the leg (1 is the first).
        platform: Link of the core that the closure connects it to.
        spin: Its idle spin, with freedoms of the leg, or None.
        q, v: Its coordinates in the module's spanning tree.
        tree_v: Its freedoms in the tree after the cuts.
        tree_q: Its coordinates in the tree after the cuts.
    """

    links: tuple[LinkNumbers, ...]
    closure: TreeClosure
    on_a: bool
    end: int
    platform: int
    spin: Spin | None
    q: Index
    v: Index
    tree_q: Index
    tree_v: Index

    @property
    def unspun(self) -> Array:
        """Basis of its joint rates orthogonal to its spin, shape (nv, rows of the closure)."""
        basis = np.eye(len(self.tree_v))
        if self.spin is None:
            return basis
        at = list(self.spin.cols)
        own = snap(axis_frame(self.spin.axis))[:, :2] if len(at) == 3 else np.zeros((1, 0))
        return np.concatenate([basis[:, : at[0]], basis[:, at] @ own, basis[:, at[-1] + 1 :]], axis=1)

    def of_spin(self, name: str) -> Array:
        """Return "axis" or "share" of its spin over all its freedoms, zeros without a spin, shape (nv,)."""
        out = np.zeros(len(self.tree_v))
        if self.spin:
            out[list(self.spin.cols)] = getattr(self.spin, name)
        return out

    def among(self, freedoms: Container[int]) -> list[int]:
        """Return those of its freedoms that are among some of `tree_v`, numbered inside the leg."""
        return [j for j, k in enumerate(self.tree_v) if k in freedoms]


def held_legs(
    mechanism: Mechanism, spins: Sequence[Spin], links: list[LinkNumbers]
) -> dict[tuple[int, ...], int]:
    """Return the legs that may be grouped, as bodies of the tree, each with the closure at its end.

    A spin that moves mass by more than rounding, if less than `IDLE`, is left to the core, as are those of
    floating bodies.
    """
    size = mechanism.length * sum(body.mass for body in mechanism.spec.leg_bodies if body)
    still = [
        spin
        for spin in spins
        if len(spin.cols) <= 3 and np.abs(first_moment(spin, links)).max() <= UNFELT * size
    ]
    found = {bodies: _closure_of_leg(mechanism, bodies, still) for bodies in mechanism.spec.legs}
    return {bodies: at for bodies, at in found.items() if at is not None}


def leg_of(
    mechanism: Mechanism, bodies: tuple[int, ...], links: list[LinkNumbers], closure: TreeClosure,
    core: dict[int, int], spins: Sequence[Spin],
) -> Leg:  # fmt: skip
    """Return a leg; `core` numbers the bodies of the core."""
    joints = [b - 1 for b in sorted(bodies)]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(joints)}
    on_a = closure.body_a in bodies
    end, platform = (closure.body_a, closure.body_b) if on_a else (closure.body_b, closure.body_a)
    columns = columns_of(mechanism, joints)
    return Leg(
        links=renumbered_links(links, joints, number),
        closure=closure,
        on_a=on_a,
        end=number[end],
        platform=core[platform] - 1,
        spin=next(iter(spins_among(spins, columns["tree_v"])), None),
        **columns,
    )


def _closure_of_leg(mechanism: Mechanism, bodies: tuple[int, ...], spins: Sequence[Spin]) -> int | None:
    """Return the one closure that connects a leg to a platform and determines all but its spin, or None."""
    spec, tree, inside = mechanism.spec, mechanism.tree, set(bodies)
    touching = [i for i, c in enumerate(spec.cut_closures) if {c.body_a, c.body_b} & inside]
    if len(touching) != 1 or not _hangs_alone(spec, inside):
        return None
    at = touching[0]
    c = spec.cut_closures[at]
    other = c.body_b if c.body_a in inside else c.body_a
    whole = len(c.translations) == 3 and c.rotation in ("free", "fixed", "parallel")
    cols = np.concatenate([np.arange(tree.nv)[tree.v_slices[b - 1]] for b in bodies])
    idle = [spin.col for spin in spins_among(spins, cols)]
    determined = np.delete(cols, idle)
    if other - 1 not in spec.platforms or not whole or c.rows != len(determined) or len(idle) > 1:
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
        axes = [tuple(link.axis.round(ROUNDED_AXIS).tolist()) if link.nv == 1 else () for link in leg.links]
        shape = tuple((link.kind, link.parent, axis) for link, axis in zip(leg.links, axes, strict=True))
        acting = tuple(marks[k] for k in leg.tree_v), leg.spin and leg.spin.cols
        out.setdefault((shape, acting, leg.end, leg.platform, leg.closure.rotation), []).append(leg)
    return tuple(tuple(group) for group in out.values())


def spins_among(spins: Sequence[Spin], tree_v: Index) -> tuple[Spin, ...]:
    """Return the spins of some freedoms, numbered among these."""
    number = {int(col): k for k, col in enumerate(tree_v)}
    return tuple(spin.at(number) for spin in spins if number.keys() >= {*spin.cols})


def renumbered_links(
    links: list[LinkNumbers], joints: list[int], number: dict[int, int]
) -> tuple[LinkNumbers, ...]:
    """Return the links of some joints with renumbered parents."""
    return tuple(replace(links[j], parent=number[links[j].parent]) for j in joints)


def columns_of(mechanism: Mechanism, joints: list[int]) -> dict[str, Index]:
    """Return coordinates and freedoms of joints of the tree: `tree_q`, `tree_v`, and `q`, `v` (`Parts`)."""
    nothing = np.zeros(0, dtype=int)
    tree, cut = mechanism.tree, mechanism.cut
    q_of, v_of = np.full(tree.nq, -1), np.full(tree.nv, -1)
    q_of[cut.q_to], v_of[cut.v_to] = cut.q_from, cut.v_from
    tree_q = np.concatenate([nothing, *(np.arange(tree.nq)[tree.q_slices[j]] for j in joints)])
    tree_v = np.concatenate([nothing, *(np.arange(tree.nv)[tree.v_slices[j]] for j in joints)])
    return {"tree_q": tree_q, "tree_v": tree_v, "q": q_of[tree_q], "v": v_of[tree_v]}
