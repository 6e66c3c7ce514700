"""Split a module into its core and groups of equal legs between the base and a platform.

A leg of a group starts at the base and ends at one platform, and its closure determines all its joints from
the platform's motion. Everything else (platforms, serial joints, other loops) belongs to the core.
"""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass, replace

import numpy as np

from ...linkage.closures import TreeClosure, TreeCoupling
from ...linkage.joints import NQ
from ...spatial import Array, Index
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from .arguments.module_arguments import ModuleArguments
from .expressions import plain, settled, zeros
from .rigid import Link, aligned, links_of, moved, regrouped, ten_numbers
from .spins import Rod, Spin, rods_of, spins_of

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

    def among(self, freedoms: Container[int]) -> list[int]:
        """Return those of its freedoms that are among some of `tree_v`, numbered inside the leg."""
        return [j for j, k in enumerate(self.tree_v) if k in freedoms]


@dataclass(frozen=True, eq=False)
class Parts:
    """A module split into its core and its groups of equal legs.

    Attributes:
        mechanism: The module.
        links: Links of the core.
        turns: New axes of each body of the core (base first) in its old axes, shape (3, 3).
        bodies: For each body of the core (base first) its index in the mechanism's tree.
        platforms: Links of the core that are platforms.
        closures, couplings: Those of the core; bodies and joints numbered in the core, axes aligned.
        checked: How many of the closures, the first ones, can be open. The others stand for the wrists that
            place the platforms, and hold at any positions of the joints.
        closure_rows: Their rows in the mechanism's closures.
        tree_q, tree_v: Coordinates and freedoms of the core in the tree after the cuts.
        q, v: The same in the spanning tree, -1 for those of platforms.
        groups: Groups of equal legs.
        base: Ten inertial numbers that regrouping moves to the base.
        rank: Rank of the core's closures.
        spins: Its idle spins.
        rods: Rods at the ends of its closures, by the closure's number.
    """

    mechanism: Mechanism
    links: tuple[Link, ...]
    turns: tuple[Array, ...]
    bodies: tuple[int, ...]
    platforms: frozenset[int]
    closures: tuple[TreeClosure, ...]
    couplings: tuple[TreeCoupling, ...]
    checked: int
    closure_rows: tuple[int, ...]
    tree_q: Index
    tree_v: Index
    q: Index
    v: Index
    groups: tuple[tuple[Leg, ...], ...]
    base: Array
    rank: int
    spins: tuple[Spin, ...]
    rods: dict[int, Rod]


def parts_of(
    mechanism: Mechanism,
    marks: tuple[str, ...],
    *,
    leg_inertia: bool = True,
    arguments: ModuleArguments | None = None,
) -> Parts:
    """Split a module into its core and its groups of legs.

    Args:
        marks: Motors and laws on each freedom of its tree; equal legs have equal marks.
        leg_inertia: Whether legs have mass.
        arguments: Numbers of the module that are arguments, or None.
    """
    spec = mechanism.spec if arguments is None else arguments.spec
    free = arguments is None or arguments.free
    links, turns, base = _links(spec, leg_inertia, arguments)
    if free:
        links, base = regrouped(links)
    closures = [_turned(c, turns) for c in spec.cut_closures]
    held = _held_legs(mechanism) if free else {}
    kept = [i for i in range(len(links)) if not any(i + 1 in bodies for bodies in held)]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    legs = [_leg(mechanism, bodies, links, closures[at], number) for bodies, at in held.items()]
    used = [i for i, c in enumerate(closures) if c.body_a in number and c.body_b in number]
    core_links, core_closures = _core(links, closures, kept, used)
    constants = (core_links, core_closures)
    if arguments is not None:  # rods are found by the numbers that the robot has
        own = _links(mechanism.spec, False, None)
        constants = _core(own[0], [_turned(c, own[1]) for c in mechanism.spec.cut_closures], kept, used)
    columns = _columns(mechanism, kept)
    return Parts(
        mechanism=mechanism,
        links=core_links,
        turns=tuple(turns[body] for body in number),
        bodies=tuple(number),
        platforms=frozenset(number[j + 1] - 1 for j in spec.platforms),
        closures=core_closures,
        couplings=tuple(
            c._replace(terms=tuple((number[j + 1] - 1, k) for j, k in c.terms)) for c in spec.cut_couplings
        ),
        checked=len(used) if arguments else sum(i < len(spec.closures) for i in used),
        closure_rows=_rows(mechanism, used),
        **columns,
        groups=_groups(legs, marks),
        base=base,
        rank=mechanism.reduction.rank - sum(len(leg.tree_v) for leg in legs),
        spins=_spins(mechanism, marks, columns["tree_v"]),
        rods=rods_of(*constants),
    )


def _core(
    links: list[Link], closures: list[TreeClosure], kept: list[int], used: list[int]
) -> tuple[tuple[Link, ...], tuple[TreeClosure, ...]]:
    """Return some links and closures with bodies numbered in the core."""
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    return _renumbered(links, kept, number), tuple(
        replace(closures[i], body_a=number[closures[i].body_a], body_b=number[closures[i].body_b])
        for i in used
    )


def _spins(mechanism: Mechanism, marks: tuple[str, ...], tree_v: Index) -> tuple[Spin, ...]:
    """Return the idle spins of a core, with its freedoms."""
    driven = {k for k, mark in enumerate(marks) if "motor" in mark}
    number = {int(col): k for k, col in enumerate(tree_v)}
    return tuple(spin.at(number) for spin in spins_of(mechanism, driven) if number.keys() >= {*spin.cols})


def _links(
    spec: ModuleSpec,
    leg_inertia: bool,
    arguments: ModuleArguments | None,
) -> tuple[list[Link], list[Array], Array]:
    """Return the tree's links, its bodies' turns, and ten zeros, for what regrouping moves to the base."""
    massive = leg_inertia and arguments is None
    inertias = [ten_numbers(body if massive else None) for body in spec.leg_bodies]
    links, turns = aligned(links_of(spec.tree, inertias), frozenset(spec.outputs))
    if arguments is not None and (leg_inertia or not arguments.free):
        links = [
            link if body is None else replace(link, inertia=settled(moved(ten, plain(turn.T), zeros(3))))
            for link, body, ten, turn in zip(links, spec.leg_bodies, arguments.own, turns[1:], strict=True)
        ]
    return links, turns, np.zeros(10)


def _held_legs(mechanism: Mechanism) -> dict[tuple[int, ...], int]:
    """Return the legs that may be grouped, as bodies of the tree, each with the closure at its end."""
    found = {bodies: _closure_of_leg(mechanism, bodies) for bodies in mechanism.spec.legs}
    return {bodies: at for bodies, at in found.items() if at is not None}


def _leg(
    mechanism: Mechanism, bodies: tuple[int, ...], links: list[Link], closure: TreeClosure,
    core: dict[int, int],
) -> Leg:  # fmt: skip
    """Return a leg; `core` numbers the bodies of the core."""
    joints = [b - 1 for b in sorted(bodies)]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(joints)}
    on_a = closure.body_a in bodies
    end, platform = (closure.body_a, closure.body_b) if on_a else (closure.body_b, closure.body_a)
    return Leg(
        links=_renumbered(links, joints, number),
        closure=closure,
        on_a=on_a,
        end=number[end],
        platform=core[platform] - 1,
        **_columns(mechanism, joints),
    )


def _renumbered(links: list[Link], joints: list[int], number: dict[int, int]) -> tuple[Link, ...]:
    """Return the links of some joints with renumbered parents."""
    return tuple(replace(links[j], parent=number[links[j].parent]) for j in joints)


def _columns(mechanism: Mechanism, joints: list[int]) -> dict[str, Index]:
    """Return coordinates and freedoms of joints of the tree: `tree_q`, `tree_v`, and `q`, `v` (`Parts`)."""
    nothing = np.zeros(0, dtype=int)
    tree, (q_of, v_of) = mechanism.tree, _spanning_columns(mechanism)
    tree_q = np.concatenate([nothing, *(np.arange(tree.nq)[tree.q_slices[j]] for j in joints)])
    tree_v = np.concatenate([nothing, *(np.arange(tree.nv)[tree.v_slices[j]] for j in joints)])
    return {"tree_q": tree_q, "tree_v": tree_v, "q": q_of[tree_q], "v": v_of[tree_v]}


def _rows(mechanism: Mechanism, used: list[int]) -> tuple[int, ...]:
    """Return the rows of the closures of the core, and of all couplings."""
    rows = mechanism.closures.row_slices
    of_closures = [r for i in used for r in range(rows[i].start, rows[i].stop)]
    coupled = [at.start for at in rows[len(mechanism.spec.cut_closures) :]]
    return (*of_closures, *coupled)


def _turned(c: TreeClosure, turns: list[Array]) -> TreeClosure:
    """Return a closure's frames in the aligned axes of its bodies."""
    Ta, Tb = turns[c.body_a].T, turns[c.body_b].T
    return replace(c, R_a=Ta @ c.R_a, p_a=Ta @ c.p_a, R_b=Tb @ c.R_b, p_b=Tb @ c.p_b)


def _spanning_columns(mechanism: Mechanism) -> tuple[Index, Index]:
    """Return the index in the spanning tree of each coordinate and freedom of the tree, -1 for platforms."""
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
    """Return the one closure that connects a leg to a platform and determines its joints, or None."""
    spec, tree, inside = mechanism.spec, mechanism.tree, set(bodies)
    touching = [i for i, c in enumerate(spec.cut_closures) if {c.body_a, c.body_b} & inside]
    if len(touching) != 1 or not _hangs_alone(spec, inside):
        return None
    at = touching[0]
    c = spec.cut_closures[at]
    other = c.body_b if c.body_a in inside else c.body_a
    whole = len(c.translations) == 3 and c.rotation in ("free", "fixed", "parallel")
    cols = np.concatenate([np.arange(tree.nv)[tree.v_slices[b - 1]] for b in bodies])
    if other - 1 not in spec.platforms or not whole or c.rows != len(cols):
        return None
    K = mechanism.reduction.scaled(mechanism.generic_K)[:, mechanism.closures.row_slices[at]][:, :, cols]
    s = np.linalg.svd(K, compute_uv=False)
    return at if np.median(s[:, -1] / s[:, 0]) > LOCATED_LEG else None


def _hangs_alone(spec: ModuleSpec, inside: set[int]) -> bool:
    """Return whether bodies hang from the base alone and carry no other body, no output and no coupling."""
    parents = {spec.tree[b - 1].parent for b in inside}
    hanging = {joint.parent for i, joint in enumerate(spec.tree) if i + 1 not in inside}
    coupled = {j + 1 for c in spec.cut_couplings for j, _ in c.terms}
    return parents <= inside | {0} and not inside & (hanging | coupled | set(spec.outputs))


def _groups(legs: list[Leg], marks: tuple[str, ...]) -> tuple[tuple[Leg, ...], ...]:
    """Group legs that differ in their numbers only."""
    out: dict[tuple[object, ...], list[Leg]] = {}
    for leg in legs:
        shape = tuple((link.kind, link.parent, tuple(link.axis.tolist())) for link in leg.links)
        acting = tuple(marks[k] for k in leg.tree_v)
        out.setdefault((shape, acting, leg.end, leg.platform, leg.closure.rotation), []).append(leg)
    return tuple(tuple(group) for group in out.values())


def width_of(links: tuple[Link, ...]) -> tuple[int, int]:
    """Return the numbers of coordinates and freedoms of links."""
    return sum(NQ[link.kind] for link in links), sum(link.nv for link in links)
