"""Derivatives of one node over its own sources, as a kernel of the numbers that are not always zero."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import pack
from .nodes import Entry, Node


@dataclass(frozen=True)
class Local:
    """Derivatives of a node.

    Attributes:
        key: Equal keys mean equal functions.
        function: Function of the node's sources; its outputs are the numbers of `summed` and of `own`.
        summed: Derivatives of what all copies add up over what all copies read: added up over the copies.
        own: Derivatives of each copy.
    """

    key: Any
    function: ca.Function
    summed: tuple[Entry, ...]
    own: tuple[Entry, ...]


def local_jacobian(
    node: Node,
    ins: list[int],
    outs: list[int],
    common_in: list[bool],
    common_out: list[bool],
    ends: list[tuple[int, int]] | None = None,
) -> Local:
    """Differentiate a node.

    Args:
        ins: Sources over which to differentiate.
        outs: Targets to differentiate.
        common_in: Whether all copies read the same numbers, for each of `ins`.
        common_out: Whether the copies add up their numbers, for each of `outs`.
        ends: Target entries to differentiate, by target; default all of `outs`.
    """
    f = node.function
    columns = [ca.SX.sym(f"x{n}", f.nnz_in(n)) for n in range(f.n_in())]
    values = f.call(columns)
    out_of = [(n, k) for n in outs for k in range(f.nnz_out(n))] if ends is None else ends
    x, dense = ca.vertcat(*(columns[n] for n in ins)), [ca.densify(value) for value in values]
    y = ca.vertcat(*(dense[n][k] for n, k in out_of))
    J = _jacobian(y, x)
    rows, cols = J.sparsity().get_triplet()
    numbers = J.nonzeros()
    in_of = [(n, k) for n in ins for k in range(f.nnz_in(n))]
    common = dict(zip([*ins, *(-1 - n for n in outs)], [*common_in, *common_out], strict=True))
    lists: tuple[list[Entry], list[Entry]] = ([], [])
    terms: tuple[list[Any], list[Any]] = ([], [])
    for row, col, value in zip(rows, cols, numbers, strict=True):
        (n, r), (s, c) = out_of[row], in_of[col]
        which = 0 if common[s] and common[-1 - n] else 1
        lists[which].append((n, r, s, c))
        terms[which].append(value)
    key = (node.key, tuple(ins), tuple(out_of), tuple(common_in), tuple(common_out))
    outputs = [pack(np.array(part, dtype=object)) if part else ca.SX(0, 1) for part in terms]
    return Local(key, ca.Function("local", columns, outputs), tuple(lists[0]), tuple(lists[1]))


def _jacobian(y: ca.SX, x: ca.SX) -> ca.SX:
    """Return dy/dx from the sweeps, forward or back, that leave fewer operations."""
    forward = ca.jacobian(y, x, {"helper_options": {"ad_weight": 0.0}})
    if y.numel() >= x.numel():
        return forward
    back = ca.jacobian(y, x, {"helper_options": {"ad_weight": 1.0}})
    return min(forward, back, key=ca.n_nodes)
