"""Split a module into its core and groups of equal legs between the base and a platform.

A leg of a group starts at the base and ends at one platform, and its closure determines all its joints from
the platform's motion, except one idle spin. Everything else (platforms, serial joints, other loops) belongs
to the core.
"""

from __future__ import annotations

from collections.abc import Container, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...linkage.closures import TreeClosure
from ...linkage.couplings import TreeCoupling
from ...spatial import Array, Index
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from ...structure.wrists import axis_frame
from .arguments import ModuleArguments
from .expressions import plain, settled, snap, zeros
from .rigid import LinkNumbers, aligned, links_of, moved, regrouped, ten_numbers
from .rods import Rod, rods_of
from .spins import UNFELT, Spin, first_moment, spins_of

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
    held = _held_legs(mechanism, spins, constants) if free else {}
    kept = [i for i in range(len(links)) if not any(i + 1 in bodies for bodies in held)]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    legs = [_leg(mechanism, bodies, links, closures[at], number, spins) for bodies, at in held.items()]
    used = [i for i, c in enumerate(closures) if c.body_a in number and c.body_b in number]
    core_links, core_closures = _core(links, closures, kept, used)
    known = _core(constants, [_turned(c, axes) for c in mechanism.spec.cut_closures], kept, used)
    columns = _columns(mechanism, kept)
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
        groups=_groups(legs, marks),
        base=base,
        rank=mechanism.reduction.rank - sum(leg.closure.rows for leg in legs),
        spins=_among(spins, columns["tree_v"]),
        rods=rods_of(*known),
    )


def _core(
    links: list[LinkNumbers], closures: list[TreeClosure], kept: list[int], used: list[int]
) -> tuple[tuple[LinkNumbers, ...], tuple[TreeClosure, ...]]:
    """Return some links and closures with bodies numbered in the core."""
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(kept)}
    return _renumbered(links, kept, number), tuple(
        replace(closures[i], body_a=number[closures[i].body_a], body_b=number[closures[i].body_b])
        for i in used
    )


def _among(spins: Sequence[Spin], tree_v: Index) -> tuple[Spin, ...]:
    """Return the spins of some freedoms, numbered among these."""
    number = {int(col): k for k, col in enumerate(tree_v)}
    return tuple(spin.at(number) for spin in spins if number.keys() >= {*spin.cols})


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


def _held_legs(
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


def _leg(
    mechanism: Mechanism, bodies: tuple[int, ...], links: list[LinkNumbers], closure: TreeClosure,
    core: dict[int, int], spins: Sequence[Spin],
) -> Leg:  # fmt: skip
    """Return a leg; `core` numbers the bodies of the core."""
    joints = [b - 1 for b in sorted(bodies)]
    number = {0: 0} | {j + 1: i + 1 for i, j in enumerate(joints)}
    on_a = closure.body_a in bodies
    end, platform = (closure.body_a, closure.body_b) if on_a else (closure.body_b, closure.body_a)
    columns = _columns(mechanism, joints)
    return Leg(
        links=_renumbered(links, joints, number),
        closure=closure,
        on_a=on_a,
        end=number[end],
        platform=core[platform] - 1,
        spin=next(iter(_among(spins, columns["tree_v"])), None),
        **columns,
    )


def _renumbered(
    links: list[LinkNumbers], joints: list[int], number: dict[int, int]
) -> tuple[LinkNumbers, ...]:
    """Return the links of some joints with renumbered parents."""
    return tuple(replace(links[j], parent=number[links[j].parent]) for j in joints)


def _columns(mechanism: Mechanism, joints: list[int]) -> dict[str, Index]:
    """Return coordinates and freedoms of joints of the tree: `tree_q`, `tree_v`, and `q`, `v` (`Parts`)."""
    nothing = np.zeros(0, dtype=int)
    tree, cut = mechanism.tree, mechanism.cut
    q_of, v_of = np.full(tree.nq, -1), np.full(tree.nv, -1)
    q_of[cut.q_to], v_of[cut.v_to] = cut.q_from, cut.v_from
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
    idle = [spin.col for spin in _among(spins, cols)]
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


def _groups(legs: list[Leg], marks: tuple[str, ...]) -> tuple[tuple[Leg, ...], ...]:
    """Group legs that differ in their numbers only."""
    out: dict[tuple[object, ...], list[Leg]] = {}
    for leg in legs:
        axes = [tuple(link.axis.round(ROUNDED_AXIS).tolist()) if link.nv == 1 else () for link in leg.links]
        shape = tuple((link.kind, link.parent, axis) for link, axis in zip(leg.links, axes, strict=True))
        acting = tuple(marks[k] for k in leg.tree_v), leg.spin and leg.spin.cols
        out.setdefault((shape, acting, leg.end, leg.platform, leg.closure.rotation), []).append(leg)
    return tuple(tuple(group) for group in out.values())
