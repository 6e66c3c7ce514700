"""Paths through a module's whole tree to the ends of its wrists."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...spatial import Array, Index, indices
from ...structure.mechanism import Mechanism
from ...structure.wrists import Wrist
from ...symbols import Expression
from .chains import Chain, own_columns, sweep
from .expressions import sampled, symbols, zeros
from .guarded_elimination import Pivots, choose_pivots
from .leg_groups import TreeBranch
from .own_axes import own_positions
from .rigid import Links, freedoms


@dataclass(frozen=True, eq=False)
class Path(TreeBranch):
    """The joints from the base, or from a platform, to the end of a wrist, innermost first.

    Attributes:
        wrist: The wrist.
    """

    wrist: Wrist

    @property
    def end(self) -> int:
        """Body at its end."""
        return next(reversed(self.links)) + 1

    @property
    def target(self) -> int:
        """Body to which the end is fixed."""
        return self.mechanism.cut.tree_body(self.wrist.target)

    @cached_property
    def own(self) -> Index:
        """Freedoms of the wrist, among those of the path."""
        return indices(list(freedoms(self.links).values())[-len(self.wrist.joints) :])


def path_of(mechanism: Mechanism, wrist: Wrist, links: Links) -> Path:
    """Return the path to the end of a wrist; `links` are those of the whole tree."""
    spec, joints = mechanism.spec, [mechanism.spec.in_whole[wrist.joints[-1]]]
    while joints[-1] not in spec.platforms and (parent := links[joints[-1]].parent):
        joints.append(parent - 1)
    return Path(mechanism, {i: links[i] for i in reversed(joints)}, wrist)


def wrist_pivots(path: Path, positions: Array) -> Pivots:
    """Choose the pivots of a wrist's Jacobian at positions of the spanning tree, shape (samples, nq)."""
    m, own = path.mechanism, path.v[path.own]
    column, q = symbols("q", len(path.q))
    chain = sweep(path.links, own_positions(path.links, q), zeros(len(path.v)), zeros(6))
    S = wrist_jacobian(path, chain)
    samples = sampled(S, [column], [[x] for x in positions[:, path.q]])  # a platform's pose does not count
    rows = np.array([1 / m.length] * 3 + [1.0] * 3)
    return choose_pivots(samples, S.shape[1], rows, m.spanning_col_scale[own])


def wrist_jacobian(path: Path, chain: Chain) -> Expression:
    """Compute the Jacobian of a wrist's end over the wrist's rates, end frame, shape (6, wrist nv)."""
    columns = own_columns(chain, path.end)
    return np.stack([columns[k] for k in path.own], axis=1)
