"""Wrists removed by the cuts: paths to their ends, platform motion, and the wrists' accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...linkage.joints import NQ, NV
from ...spatial import Array, Index
from ...structure.mechanism import Mechanism
from ...structure.module_spec import ModuleSpec
from ...structure.wrists import Wrist
from .chains import Chain, sweep
from .expressions import Expression, dot, pack, symbols, zeros
from .rigid import Link, links_of, to_child
from .static_elimination import Pivots, Trust, choose_pivots, solve


@dataclass(frozen=True, eq=False)
class Path:
    """The joints from the base to the end of a wrist, innermost first.

    Attributes:
        wrist: The wrist.
        joints: Indices of its joints in the spanning tree.
        links: Its joints as a chain of links.
        wrist_from: Index of the wrist's first joint in the path.
        q, v: Coordinates in the module's spanning tree.
    """

    wrist: Wrist
    joints: tuple[int, ...]
    links: tuple[Link, ...]
    wrist_from: int
    q: Index
    v: Index

    @property
    def wrist_v(self) -> slice:
        """Freedoms of the wrist in the path."""
        return slice(sum(link.nv for link in self.links[: self.wrist_from]), len(self.v))


def path_of(mechanism: Mechanism, spec: ModuleSpec, wrist: Wrist) -> Path:
    """Return the path to the end of a wrist; `spec` has the module's numbers, which may be arguments."""
    joints = [wrist.joints[-1]]
    while (parent := spec.spanning[joints[-1]].parent) != 0:
        joints.append(parent - 1)
    joints = joints[::-1]
    chain = links_of(tuple(spec.spanning[j] for j in joints), [np.zeros(10)] * len(joints))
    links = tuple(Link(link.kind, i, link.R, link.p, link.axis, link.inertia) for i, link in enumerate(chain))
    q, v = (
        np.concatenate([np.arange(slices[j].start, slices[j].stop) for j in joints])
        for slices in (mechanism.spanning.q_slices, mechanism.spanning.v_slices)
    )
    return Path(wrist, tuple(joints), links, joints.index(wrist.joints[0]), q, v)


def wrist_pivots(path: Path, positions: Array, length: float) -> Pivots:
    """Choose the pivots of a wrist's Jacobian at generic positions of the path, shape (samples, nq)."""
    column, q = symbols("q", sum(NQ[link.kind] for link in path.links))
    chain = sweep(list(path.links), q, zeros(sum(NV[link.kind] for link in path.links)), zeros(6))
    S = wrist_jacobian(path, chain)
    function = ca.Function("S", [column], [pack(S)])
    samples = np.array([np.array(function(x)).reshape(S.shape) for x in positions])
    rows = np.array([1 / length] * 3 + [1.0] * 3)
    turns = [any(not (isinstance(x, float) and x == 0.0) for x in column[3:]) for column in S.T]
    cols = np.array([1.0 if t else length for t in turns])
    return choose_pivots(samples, S.shape[1], rows, cols)


def wrist_jacobian(path: Path, chain: Chain) -> Expression:
    """Compute the Jacobian of a wrist's end over the wrist's rates, end frame, shape (6, wrist nv)."""
    columns: list[Expression] = []
    for i in range(path.wrist_from, len(path.links)):
        columns = [to_child(chain.R[i], chain.p[i], column) for column in columns]
        columns += [chain.S[i][:, k] for k in range(path.links[i].nv)]
    return np.stack(columns, axis=1)


def wrist_accelerations(
    path: Path, chain: Chain, target: Expression, pivots: Pivots
) -> tuple[Expression, Trust]:
    """Solve for the wrist's accelerations that give its end a required acceleration.

    Args:
        chain: Its motion, with the accelerations of the joints before the wrist and zeros for the wrist.
        target: Required acceleration of the end, end frame, shape (6,).
        pivots: Pivots of the wrist's Jacobian.

    Returns:
        Accelerations, shape (wrist nv,), and the trust in the pivots.
    """
    miss = target - chain.c[-1]
    X, trust = solve(wrist_jacobian(path, chain), miss[:, None], pivots)
    return dot(X, np.ones(1).astype(object)), trust
