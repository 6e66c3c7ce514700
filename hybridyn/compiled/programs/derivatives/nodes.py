"""The calls of a program as nodes of a graph, and their Jacobians."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import pack
from ...program import Add, Call, Constants, GivenPlace, ResultPlace, Shared, Source, Target, Worst
from ..writer import Writer

#: A number of a program: the place it is stored in, and its index there.
Number = tuple[str, int]

#: Place of a derivative: the target and its entry, the source and its entry.
Entry = tuple[int, int, int, int]

#: Passed numbers over results, above which stages are joined: their derivatives are then fewer.
INLINED = 2.0


@dataclass(frozen=True)
class StageNode:
    """A call whose function has the earlier stages of its module inlined.

    Attributes:
        key: Equal keys mean equal functions.
        function: Function of the sources, one output for each target.
        copies: Number of copies.
        sources: Sources of its inputs, each once.
        targets: Targets of its outputs; guards and what is passed to later stages are left out.
    """

    key: Any
    function: ca.Function
    copies: int
    sources: tuple[Source, ...]
    targets: tuple[Target, ...]

    def numbers(self, end: Source | Target) -> list[Number]:
        """Return the numbers that its copies read from a source or write to a target."""
        return [number for copy in range(self.copies) for number in end.numbers(copy)]

    def ends(self, entries: Iterable[Entry], copy: int) -> list[tuple[Number, Number]]:
        """Return the numbers of source and target of derivatives of one copy."""
        sources, targets = ([end.numbers(copy) for end in ends] for ends in (self.sources, self.targets))
        return [(sources[s][col], targets[n][row]) for n, row, s, col in entries]


def nodes_of(w: Writer, calls: Iterable[Call], limit: float = INLINED) -> list[StageNode]:
    """Return the nodes of calls in their order; each producer of passed numbers is among the calls.

    Args:
        w: The program under construction.
        calls: The calls.
        limit: Passed numbers over results, above which stages are joined; 0 joins all, for calls that are
            not made and leave no numbers behind.
    """
    calls = list(calls)
    inlined = _inlined(w, calls, limit)
    producers: dict[Any, tuple[Call, int]] = {}
    out = []
    for call in calls:
        out.append(_node(w, call, producers, inlined))
        producers |= {target: (call, n) for n, target in enumerate(call.targets) if target in inlined}
    return out


def _inlined(w: Writer, calls: list[Call], limit: float) -> set[Any]:
    """Return the places of passed numbers of which there are more than results that need them."""
    needed: dict[Any, int] = dict.fromkeys(w.handed, 0)
    for call in calls:
        kept = [n for n, x in enumerate(call.targets) if not isinstance(x, Worst) and x not in needed]
        results = sum(w.kernels[call.kernel].function.nnz_out(n) for n in kept)
        for source in call.sources:
            if source in needed:
                needed[source] += results
    return {place for place, count in needed.items() if place.size > limit * count}


def _node(w: Writer, call: Call, producers: dict[Any, tuple[Call, int]], inlined: set[Any]) -> StageNode:
    """Return the node of one call."""
    sources: dict[Any, Source] = {}

    def tree(call: Call) -> tuple[Any, ...]:
        """Return the kernel and its arguments: numbers of sources, or outputs of other trees."""
        arguments: list[Any] = [call.kernel]
        for source in call.sources:
            if source in producers:
                producer, n = producers[source]
                arguments.append((n, tree(producer)))
            else:
                sources.setdefault(identity(source), source)
                arguments.append([*sources].index(identity(source)))
        return tuple(arguments)

    whole = tree(call)
    kept = [n for n, x in enumerate(call.targets) if not isinstance(x, Worst) and x not in inlined]
    key = ("joined", whole, tuple(kept))
    function = w.once(key, _joined, w, whole, len(sources), kept)
    return StageNode(
        key, function, call.copies, tuple(sources.values()), tuple(call.targets[n] for n in kept)
    )


def _joined(w: Writer, whole: tuple[Any, ...], count: int, kept: list[int]) -> ca.Function:
    """Return the function of a tree of kernels."""
    columns: dict[int, ca.SX] = {}

    @cache
    def outputs(tree: tuple[Any, ...]) -> list[ca.SX]:
        """Return the outputs of a tree's kernel."""
        function = w.kernels[tree[0]].function
        arguments = []
        for i, x in enumerate(tree[1:]):
            if not isinstance(x, tuple):
                arguments.append(columns.setdefault(x, ca.SX.sym(f"x{x}", function.nnz_in(i))))
            else:
                arguments.append(outputs(x[1])[x[0]])
        return list(function.call(arguments))

    out = outputs(whole)
    return ca.Function("joined", [columns[i] for i in range(count)], [out[n] for n in kept])


def identity(source: Source) -> Any:
    """Return what equal sources have in common."""
    match source:
        case GivenPlace(index) | ResultPlace(index):
            return type(source), index.shape, index.tobytes()
        case Constants(values):
            return Constants, values.shape, values.tobytes()
    return source


@dataclass(frozen=True)
class Local:
    """Derivatives of a node.

    Attributes:
        key: Equal keys mean equal functions.
        function: Function of some sources of the node; its outputs are the numbers of `summed` and of `own`.
        read: These sources, by their numbers.
        summed: Derivatives of what all copies add up over what all copies read: added up over the copies.
        own: Derivatives of each copy.
    """

    key: Any
    function: ca.Function
    read: tuple[int, ...]
    summed: tuple[Entry, ...]
    own: tuple[Entry, ...]


def local_jacobian(node: StageNode, ins: list[int], out_of: list[tuple[int, int]]) -> Local:
    """Differentiate a node.

    Args:
        ins: Sources over which to differentiate.
        out_of: Targets and their entries to differentiate.
    """
    f, alone = node.function, node.copies == 1
    columns = [ca.SX.sym(f"x{n}", f.nnz_in(n)) for n in range(f.n_in())]
    dense = [ca.densify(value) for value in f.call(columns)]
    in_of = [(n, k) for n in ins for k in range(f.nnz_in(n))]
    J = _jacobian(ca.vertcat(*(dense[n][k] for n, k in out_of)), ca.vertcat(*(columns[n] for n in ins)))
    common = [isinstance(x, Shared) for x in node.sources], [isinstance(x, Add) for x in node.targets]
    lists: tuple[list[Entry], list[Entry]] = ([], [])
    terms: tuple[list[Any], list[Any]] = ([], [])
    for row, col, value in zip(*J.sparsity().get_triplet(), J.nonzeros(), strict=True):
        (n, r), (s, c) = out_of[row], in_of[col]
        which = 0 if alone or (common[0][s] and common[1][n]) else 1
        lists[which].append((n, r, s, c))
        terms[which].append(value)
    key = (node.key, tuple(ins), tuple(out_of), alone or (*map(tuple, common),))
    outputs = [pack(np.array(part, dtype=object)) if part else ca.SX(0, 1) for part in terms]
    used = {x.element_hash() for x in ca.symvar(ca.vertcat(*outputs))}
    read = tuple(n for n, x in enumerate(columns) if any(y.element_hash() in used for y in ca.symvar(x)))
    function = ca.Function("local", [columns[n] for n in read], outputs)
    return Local(key, function, read, tuple(lists[0]), tuple(lists[1]))


def _jacobian(y: ca.SX, x: ca.SX) -> ca.SX:
    """Return dy/dx from the sweeps, forward or back, that leave fewer operations."""
    forward = ca.jacobian(y, x, {"helper_options": {"ad_weight": 0.0}})
    if y.numel() >= x.numel():
        return forward
    back = ca.jacobian(y, x, {"helper_options": {"ad_weight": 1.0}})
    return min(forward, back, key=ca.n_nodes)
