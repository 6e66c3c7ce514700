"""Paths through a module's spanning tree to the ends of its wrists."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...spatial import Array, Index
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from ...structure.wrists import Wrist
from ...symbols import Expression
from .chains import Chain, own_columns, sweep
from .expressions import sampled, symbols, zeros
from .guarded_elimination import Pivots, choose_pivots
from .rigid import LinkNumbers, links_of


@dataclass(frozen=True, eq=False)
class Path:
    """The joints from the base to the end of a wrist, innermost first.

    Attributes:
        wrist: The wrist.
        links: Its joints as a chain of links.
        wrist_v: Freedoms of the wrist in the path.
        q, v: Coordinates in the module's spanning tree.
    """

    wrist: Wrist
    links: tuple[LinkNumbers, ...]
    wrist_v: slice
    q: Index
    v: Index


def path_of(mechanism: Mechanism, spec: ModuleSpec, wrist: Wrist) -> Path:
    """Return the path to the end of a wrist; `spec` has the module's numbers, which may be arguments."""
    joints = [wrist.joints[-1]]
    while (parent := spec.spanning[joints[-1]].parent) != 0:
        joints.append(parent - 1)
    joints = joints[::-1]
    chain = links_of(tuple(spec.spanning[j] for j in joints), [np.zeros(10)] * len(joints))
    links = tuple(
        LinkNumbers(link.kind, i, link.R, link.p, link.axis, link.inertia) for i, link in enumerate(chain)
    )
    q, v = (
        np.concatenate([np.arange(slices[j].start, slices[j].stop) for j in joints])
        for slices in (mechanism.spanning.q_slices, mechanism.spanning.v_slices)
    )
    before = sum(link.nv for link in links[: joints.index(wrist.joints[0])])
    return Path(wrist, links, slice(before, len(v)), q, v)


def wrist_pivots(m: Mechanism, path: Path, positions: Array) -> Pivots:
    """Choose the pivots of a wrist's Jacobian at positions of the spanning tree, shape (samples, nq)."""
    column, q = symbols("q", len(path.q))
    chain = sweep(list(path.links), q, zeros(len(path.v)), zeros(6))
    S = wrist_jacobian(path, chain)
    samples = sampled(S, [column], [[x] for x in positions[:, path.q]])
    rows, cols = np.array([1 / m.length] * 3 + [1.0] * 3), m.spanning_col_scale[path.v[path.wrist_v]]
    return choose_pivots(samples, S.shape[1], rows, cols)


def wrist_jacobian(path: Path, chain: Chain) -> Expression:
    """Compute the Jacobian of a wrist's end over the wrist's rates, end frame, shape (6, wrist nv)."""
    columns = own_columns(chain, len(path.links))
    return np.stack([columns[k] for k in range(path.wrist_v.start, path.wrist_v.stop)], axis=1)
