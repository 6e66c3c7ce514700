"""Split a module into its core and groups of equal legs between the base and a platform.

A leg of a group starts at the base and ends at one platform, and its closure determines all its joints from
the platform's motion, except one idle spin. Everything else (platforms, serial joints, other loops) belongs
to the core.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...linkage.closures import TreeClosure
from ...linkage.couplings import TreeCoupling
from ...spatial import Array, Index
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from .arguments import ModuleArguments
from .expressions import plain, settled, zeros
from .leg_groups import Leg, columns_of, grouped_legs, held_legs, leg_of, renumbered_links, spins_among
from .rigid import LinkNumbers, aligned, links_of, moved, regrouped, ten_numbers
from .rods import Rod, rods_of
from .spins import Spin, spins_of


@dataclass(frozen=True, eq=False)
class Parts:
    """A module split into its core and its groups of equal legs.

    Attributes:
        mechanism: The module.
        links: Links of the core.
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
        spins: Idle spins of the core.
        rods: Rods at the ends of its closures, by the closure's number.
    """

    mechanism: Mechanism
    links: tuple[LinkNumbers, ...]
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

    @property
    def idle(self) -> list[Spin]:
        """All idle spins, with freedoms of the tree after the cuts: first those of legs, by group."""
        legs = [leg.spin.at(leg.tree_v) for group in self.groups for leg in group if leg.spin]
        return legs + [spin.at(self.tree_v) for spin in self.spins]


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
    constants, axes = _links(mechanism.spec, leg_inertia, None)  # these decide on legs and rods
    links, turns = (constants, axes) if arguments is None else _links(spec, leg_inertia, arguments)
    links, base = regrouped(links) if free else (links, np.zeros(10))
    closures = [_turned(c, turns) for c in spec.cut_closures]
    driven = {k for k, mark in enumerate(marks) if "motor" in mark}
    spins = spins_of(mechanism, driven)
    held = held_legs(mechanism, spins, constants) if free else {}
    kept = [i for i in range(len(links)) if not any(i + 1 in bodies for bodies in held)]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    legs = [leg_of(mechanism, bodies, links, closures[at], number, spins) for bodies, at in held.items()]
    used = [i for i, c in enumerate(closures) if c.body_a in number and c.body_b in number]
    core_links, core_closures = _core(links, closures, kept, used)
    known = _core(constants, [_turned(c, axes) for c in mechanism.spec.cut_closures], kept, used)
    columns = columns_of(mechanism, kept)
    return Parts(
        mechanism=mechanism,
        links=core_links,
        bodies=tuple(number),
        platforms=frozenset(number[j + 1] - 1 for j in spec.platforms),
        closures=core_closures,
        couplings=tuple(c.of({j: number[j + 1] - 1 for j, _ in c.terms}) for c in spec.cut_couplings),
        checked=len(used) if arguments else sum(i < len(spec.closures) for i in used),
        closure_rows=_rows(mechanism, used),
        **columns,
        groups=grouped_legs(legs, marks),
        base=base,
        rank=mechanism.reduction.rank - sum(leg.closure.rows for leg in legs),
        spins=spins_among(spins, columns["tree_v"]),
        rods=rods_of(*known),
    )


def _core(
    links: list[LinkNumbers], closures: list[TreeClosure], kept: list[int], used: list[int]
) -> tuple[tuple[LinkNumbers, ...], tuple[TreeClosure, ...]]:
    """Return some links and closures with bodies numbered in the core."""
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    return renumbered_links(links, kept, number), tuple(
        replace(closures[i], body_a=number[closures[i].body_a], body_b=number[closures[i].body_b])
        for i in used
    )


def _links(
    spec: ModuleSpec,
    leg_inertia: bool,
    arguments: ModuleArguments | None,
) -> tuple[list[LinkNumbers], list[Array]]:
    """Return the tree's links, and its bodies' turns."""
    massive = leg_inertia and arguments is None
    inertias = [ten_numbers(body if massive else None) for body in spec.leg_bodies]
    links, turns = aligned(links_of(spec.tree, inertias), frozenset(spec.outputs))
    if arguments is not None and (leg_inertia or not arguments.free):
        links = [
            link if body is None else replace(link, inertia=settled(moved(ten, plain(turn.T), zeros(3))))
            for link, body, ten, turn in zip(links, spec.leg_bodies, arguments.own, turns[1:], strict=True)
        ]
    return links, turns


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
