"""A module's parts for writing out: a core, and groups of equal legs between the base and a platform.

A leg of a group hangs from the base, ends at one platform, and its closure tells all its joints from the
platform's motion. Everything else (platforms, serial joints, loops of other shapes) is the core.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..closure import TreeClosure, TreeCoupling
from ..joints import NQ
from ..mechanism import Mechanism
from ..spatial import Array, Index
from .expressions import Expression, plain, zeros
from .links import Link, aligned, links_of, regrouped
from .rigid import moved, ten_numbers


@dataclass(frozen=True)
class Leg:
    """One leg of a group.

    Attributes:
        links: Its links, parents numbered inside the leg.
        closure: Its closure: frames in aligned axes; `on_a` says that the leg is the predecessor.
        on_a: Whether the leg's body is the closure's predecessor.
        end: Body of the leg that the closure holds, numbered inside the leg (1 is the first).
        platform: Link of the core that it is held to.
        q, v: Its coordinates in the module's spanning tree.
        tree_v: Its freedoms in the tree after the cuts.
        tree_q: Its coordinates in the tree after the cuts.
    """

    links: tuple[Link, ...]
    closure: TreeClosure
    on_a: bool
    end: int
    platform: int
    q: Index
    v: Index
    tree_q: Index
    tree_v: Index


@dataclass(frozen=True)
class Parts:
    """A module ready for writing out.

    Attributes:
        mechanism: The module.
        links: Links of the core.
        turns: New axes of each body of the core (base first) in its old ones, shape (3, 3).
        bodies: For each body of the core (base first) its number in the mechanism's tree.
        platforms: Links of the core that are platforms.
        closures, couplings: Those of the core, bodies and joints numbered in the core, axes aligned.
        closure_rows: Rows of each of them in the mechanism's closures.
        tree_q, tree_v: Coordinates of the core in the tree after the cuts.
        q, v: The same in the spanning tree, -1 for those of platforms.
        groups: Groups of equal legs.
        base: Ten numbers that the links' regrouping hands to the base.
        rank: Independent rows of the core.
        own: Ten numbers of each body of the tree, where they are inputs.
    """

    mechanism: Mechanism
    links: tuple[Link, ...]
    turns: tuple[Array, ...]
    bodies: tuple[int, ...]
    platforms: frozenset[int]
    closures: tuple[TreeClosure, ...]
    couplings: tuple[TreeCoupling, ...]
    closure_rows: tuple[int, ...]
    tree_q: Index
    tree_v: Index
    q: Index
    v: Index
    groups: tuple[tuple[Leg, ...], ...]
    base: Array
    rank: int
    own: tuple[Expression, ...] | None = None


def parts_of(
    mechanism: Mechanism,
    marks: tuple[str, ...],
    *,
    leg_inertia: bool = True,
    regroup: bool = True,
    own: tuple[Expression, ...] | None = None,
) -> Parts:
    """Split a module into its core and its groups of legs.

    Args:
        mechanism: The module.
        marks: What acts on each freedom of its tree; equal legs have equal marks.
        leg_inertia: Whether legs have mass.
        regroup: Whether base inertial parameters are used.
        own: For each body of the tree after the cuts (without the base) its ten numbers as expressions, where
            they are inputs of the model; no legs are grouped then, and nothing is regrouped.
    """
    spec, tree = mechanism.spec, mechanism.tree
    inertias = [ten_numbers(body if leg_inertia else None) for body in spec.leg_bodies]
    links, turns = aligned(links_of(spec.tree, inertias), frozenset(spec.outputs))
    base = np.zeros(10)
    if own is not None:
        links = [
            link if body is None else replace(link, inertia=moved(numbers, plain(turn.T), zeros(3)))
            for link, body, numbers, turn in zip(links, spec.leg_bodies, own, turns[1:], strict=True)
        ]
    elif regroup:
        links, base = regrouped(links)
    closures = [_turned(c, turns) for c in spec.cut_closures]
    q_of, v_of = _spanning_columns(mechanism)
    legs: list[Leg] = []
    gone: set[int] = set()
    for bodies in spec.legs if own is None else ():
        at = _closure_of_leg(mechanism, bodies)
        if at is None:
            continue
        number = {0: 0} | {b: i + 1 for i, b in enumerate(sorted(bodies))}
        joints = [b - 1 for b in sorted(bodies)]
        closure = closures[at]
        on_a = closure.body_a in bodies
        inside = tuple(replace(links[j], parent=number[links[j].parent]) for j in joints)
        tq, tv = (
            np.concatenate([np.arange(*s[j].indices(10**9)) for j in joints])
            for s in (tree.q_slices, tree.v_slices)
        )
        end, platform = (closure.body_a, closure.body_b) if on_a else (closure.body_b, closure.body_a)
        legs.append(Leg(inside, closure, on_a, number[end], platform - 1, q_of[tq], v_of[tv], tq, tv))
        gone |= set(bodies)
    kept = [i for i in range(len(links)) if i + 1 not in gone]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    core = tuple(replace(links[j], parent=number[links[j].parent]) for j in kept)
    used = [i for i, c in enumerate(closures) if c.body_a in number and c.body_b in number]
    tq, tv = (
        np.concatenate([np.zeros(0, dtype=int), *(np.arange(*s[j].indices(10**9)) for j in kept)])
        for s in (tree.q_slices, tree.v_slices)
    )
    rows = mechanism.closures.row_slices
    coupled = [rows[len(closures) + i].start for i in range(len(spec.cut_couplings))]
    return Parts(
        mechanism,
        core,
        tuple(turns[b] for b in number),
        tuple(number),
        frozenset(number[j + 1] - 1 for j in spec.platforms),
        tuple(
            replace(closures[i], body_a=number[closures[i].body_a], body_b=number[closures[i].body_b])
            for i in used
        ),
        tuple(
            replace(c, terms=tuple((number[j + 1] - 1, k) for j, k in c.terms)) for c in spec.cut_couplings
        ),
        tuple([r for i in used for r in range(rows[i].start, rows[i].stop)] + coupled),
        tq,
        tv,
        q_of[tq],
        v_of[tv],
        _groups([replace(leg, platform=number[leg.platform + 1] - 1) for leg in legs], marks),
        base,
        mechanism.reduction.rank - sum(len(leg.tree_v) for leg in legs),
        own,
    )


def _turned(c: TreeClosure, turns: list[Array]) -> TreeClosure:
    """Give a closure's frames in the aligned axes of its bodies."""
    Ta, Tb = turns[c.body_a].T, turns[c.body_b].T
    return replace(c, R_a=Ta @ c.R_a, p_a=Ta @ c.p_a, R_b=Tb @ c.R_b, p_b=Tb @ c.p_b)


def _spanning_columns(mechanism: Mechanism) -> tuple[Index, Index]:
    """Give for each coordinate and freedom of the tree its number in the spanning tree, -1 for platforms'."""
    q, v = np.full(mechanism.tree.nq, -1), np.full(mechanism.tree.nv, -1)
    for i, source in enumerate(mechanism.spec.tree_joint):
        if source is not None:
            for out, to, here in (
                (q, mechanism.spanning.q_slices, mechanism.tree.q_slices),
                (v, mechanism.spanning.v_slices, mechanism.tree.v_slices),
            ):
                out[here[i]] = np.arange(to[source].start, to[source].stop)
    return q, v


def _closure_of_leg(mechanism: Mechanism, bodies: tuple[int, ...]) -> int | None:
    """Give the one closure that ties a leg to a platform and tells its joints, or None."""
    spec = mechanism.spec
    platforms = {j + 1 for j in spec.platforms}
    inside = set(bodies)
    if inside & set(spec.outputs) or any(spec.tree[b - 1].parent not in inside | {0} for b in bodies):
        return None
    if any(j + 1 in inside for c in spec.cut_couplings for j, _ in c.terms):
        return None
    touching = [i for i, c in enumerate(spec.cut_closures) if {c.body_a, c.body_b} & inside]
    if len(touching) != 1:
        return None
    c = spec.cut_closures[touching[0]]
    other = c.body_b if c.body_a in inside else c.body_a
    freedoms = sum(mechanism.tree.v_slices[b - 1].stop - mechanism.tree.v_slices[b - 1].start for b in bodies)
    whole = len(c.translations) == 3 and c.rotation in ("free", "fixed", "parallel")
    hanging = {spec.tree[i].parent for i in range(len(spec.tree)) if i + 1 not in inside}
    if other not in platforms or not whole or c.rows != freedoms or hanging & inside:
        return None
    rows, cols = mechanism.closures.row_slices[touching[0]], np.concatenate(
        [np.arange(mechanism.tree.v_slices[b - 1].start, mechanism.tree.v_slices[b - 1].stop) for b in bodies]
    )  # fmt: skip
    K = mechanism.reduction.scaled(mechanism.generic_K)[:, rows][:, :, cols]
    s = np.linalg.svd(K, compute_uv=False)
    return touching[0] if np.median(s[:, -1] / s[:, 0]) > 1e-4 else None


def _groups(legs: list[Leg], marks: tuple[str, ...]) -> tuple[tuple[Leg, ...], ...]:
    """Gather legs that differ in numbers only."""
    out: dict[tuple[object, ...], list[Leg]] = {}
    for leg in legs:
        shape = tuple((link.kind, link.parent, tuple(link.axis.tolist())) for link in leg.links)
        acting = tuple(marks[k] for k in leg.tree_v)
        out.setdefault((shape, acting, leg.end, leg.platform, leg.closure.rotation), []).append(leg)
    return tuple(tuple(group) for group in out.values())


def width_of(links: tuple[Link, ...]) -> tuple[int, int]:
    """Give the numbers of coordinates and freedoms of links."""
    return sum(NQ[link.kind] for link in links), sum(link.nv for link in links)
