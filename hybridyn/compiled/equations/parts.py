"""Split a module into its core and groups of equal legs between the base and a platform.

A leg of a group starts at the base and ends at one platform, and its closure determines all its joints from
the platform's motion, except one idle motion. Everything else (platforms, serial joints, other loops) belongs
to the core.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from ...linkage.closures import TreeClosure
from ...linkage.couplings import TreeCoupling
from ...spatial import Array
from ...structure.mechanism import Mechanism
from .arguments import ModuleArguments
from .expressions import plain, settled, snap_point, zeros
from .idle.motion import IdleMotion, idle_among, idle_motions, lines_of_balls
from .leg_groups import Leg, TreeBranch, grouped_legs, held_legs, leg_of
from .rigid import Links, aligned, axes_of, links_of, moved, regrouped, ten_numbers
from .rods import Rod, loosened, rods_of
from .wrist_paths import Path, path_of


@dataclass(frozen=True, eq=False)
class Parts(TreeBranch):
    """A module split into its core, which is a branch, and its groups of equal legs.

    Attributes:
        closures, couplings: Those of the core, axes aligned.
        checked: How many of the closures, the first ones, can be open. The others stand for the wrists that
            place the platforms, and hold at any positions of the joints.
        closure_rows: Their rows in the mechanism's closures.
        groups: Groups of equal legs.
        paths: One path for each wrist of the module.
        base: Ten inertial numbers that regrouping moves to the base.
        rank: Rank of the core's closures.
        idle: Idle motions of the core.
        rods: Rods at the ends of its closures, by the closure's number.
        turns: For each body of the whole tree (base first) its axes in those of the file, shape (3, 3).
    """

    closures: tuple[TreeClosure, ...]
    couplings: tuple[TreeCoupling, ...]
    checked: int
    closure_rows: tuple[int, ...]
    groups: tuple[tuple[Leg, ...], ...]
    paths: tuple[Path, ...]
    base: Array
    rank: int
    idle: tuple[IdleMotion, ...]
    rods: dict[int, Rod]
    turns: tuple[Array, ...]

    @property
    def all_idle(self) -> list[IdleMotion]:
        """All idle motions, with freedoms of the tree after the cuts: first those of legs, by group."""
        legs = [
            leg.idle.in_file(leg.links).at(leg.tree_v) for group in self.groups for leg in group if leg.idle
        ]
        core = [motion.in_file(self.links).at(self.tree_v) for motion in self.idle]
        return legs + core


def parts_of(
    mechanism: Mechanism,
    marks: tuple[str, ...],
    *,
    leg_inertia: bool = True,
    arguments: ModuleArguments | None = None,
    rubbing: Mapping[int, str] = MappingProxyType({}),
) -> Parts:
    """Split a module into its core and its groups of legs.

    Args:
        marks: Motors and laws on each freedom of its tree; equal legs have equal marks.
        leg_inertia: Whether legs have mass.
        arguments: Numbers of the module that are arguments, or None.
        rubbing: A mark for each joint whose wrench is asked for, by its number in the whole tree.
    """
    spec = mechanism.spec if arguments is None else arguments.spec
    free = arguments is None or arguments.free
    driven = {k for k, mark in enumerate(marks) if "motor" in mark}
    idle = idle_motions(mechanism, driven)
    fixed = {weld.body_a for weld in mechanism.cut.welds}.union(spec.outputs)
    lines = lines_of_balls(mechanism, idle, marks, fixed) if free else {}
    axes = axes_of(links_of(mechanism.spec.whole), fixed, lines)
    constants = _links(mechanism, leg_inertia, None, axes, lines)  # these decide on legs and rods
    links = constants if arguments is None else _links(mechanism, leg_inertia, arguments, axes, lines)
    links, base = regrouped(links, rubbing) if free else (links, np.zeros(10))
    closures = [_turned(c, axes, mechanism.length) for c in spec.cut_closures]
    held = held_legs(mechanism, idle, constants) if free else {}
    idle = [motion.in_own_axes(links) for motion in idle]
    of_legs = {body for bodies in held for body in bodies}
    kept = [i for i in range(len(spec.tree)) if i + 1 not in of_legs]
    core = TreeBranch(mechanism, {i: links[i] for i in kept})
    legs = [leg_of(mechanism, bodies, links, closures[at], idle) for bodies, at in held.items()]
    used = [i for i in range(len(closures)) if i not in held.values()]
    known = [_turned(mechanism.spec.cut_closures[i], axes, mechanism.length) for i in used]
    return Parts(
        mechanism=mechanism,
        links=core.links,
        closures=tuple(closures[i] for i in used),
        couplings=spec.cut_couplings,
        checked=len(used) if arguments else sum(i < len(spec.closures) for i in used),
        closure_rows=_rows(mechanism, used),
        groups=grouped_legs(legs, _marked(mechanism, marks, rubbing)),
        paths=tuple(path_of(mechanism, wrist, links) for wrist in spec.wrists),
        base=base,
        rank=mechanism.reduction.rank - sum(leg.closure.rows for leg in legs),
        idle=idle_among(idle, core.tree_v),
        rods=loosened(
            rods_of({i: constants[i] for i in kept}, known, spec.platforms),
            links,
            [closures[i] for i in used],
        ),
        turns=tuple(axes),
    )


def _marked(mechanism: Mechanism, marks: Sequence[str], rubbing: Mapping[int, str]) -> tuple[str, ...]:
    """Return the marks of freedoms with those of the joints that rub."""
    out = list(marks)
    for joint, mark in rubbing.items():
        if joint < len(mechanism.spec.tree):
            for col in range(*mechanism.tree.v_slices[joint].indices(mechanism.tree.nv)):
                out[col] += mark
    return tuple(out)


def _links(
    mechanism: Mechanism,
    leg_inertia: bool,
    arguments: ModuleArguments | None,
    axes: Sequence[Array],
    balls: Container[int],
) -> Links:
    """Return the links of the whole tree, in given axes of their bodies; as for `aligned`."""
    spec = mechanism.spec if arguments is None else arguments.spec
    massive = leg_inertia and arguments is None
    massless = [np.zeros(10)] * (len(spec.whole) - len(spec.tree))  # the wrists
    inertias = [ten_numbers(body if massive else None) for body in spec.leg_bodies]
    links = aligned(links_of(spec.whole, [*inertias, *massless]), axes, balls, mechanism.length)
    if arguments is not None and (leg_inertia or not arguments.free):
        for i, (body, ten) in enumerate(zip(spec.leg_bodies, arguments.own, strict=True)):
            if body is not None:
                own = settled(moved(ten, plain(axes[i + 1].T), zeros(3)))
                links[i] = replace(links[i], inertia=own)
    return links


def _rows(mechanism: Mechanism, used: list[int]) -> tuple[int, ...]:
    """Return the rows of the closures of the core, and of all couplings."""
    rows = mechanism.closures.row_slices
    of_closures = [r for i in used for r in range(rows[i].start, rows[i].stop)]
    coupled = [at.start for at in rows[len(mechanism.spec.cut_closures) :]]
    return (*of_closures, *coupled)


def _turned(c: TreeClosure, axes: Sequence[Array], length: float) -> TreeClosure:
    """Return a closure's frames in the aligned axes of its bodies."""
    Ta, Tb = axes[c.body_a].T, axes[c.body_b].T
    p_a, p_b = snap_point(Ta @ c.p_a, length), snap_point(Tb @ c.p_b, length)
    return replace(c, R_a=Ta @ c.R_a, p_a=p_a, R_b=Tb @ c.R_b, p_b=p_b)
