"""Join the stages of a program to functions of what is not passed from stage to stage; differentiate them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import pack
from ...program import Add, Call, Constants, Given, Kernel, Own, Result, Shared, Source, Target, Worst

#: A number of a program: the place it is stored in, and its index there.
Number = tuple[str, int]

#: Place of a derivative: the target and its entry, the source and its entry.
Entry = tuple[int, int, int, int]

#: Passed numbers over results, above which stages are joined: their derivatives are then fewer.
INLINED = 2.0


@dataclass(frozen=True)
class Node:
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

    def common(self, ins: list[int], outs: list[int]) -> tuple[list[bool], list[bool]]:
        """Return which sources all copies read alike, and which targets the copies add up."""
        alone = self.copies == 1
        common_in = [alone or isinstance(self.sources[n], Shared) for n in ins]
        return common_in, [alone or isinstance(self.targets[n], Add) for n in outs]


@dataclass
class Joiner:
    """Turn the calls of a program into nodes.

    Attributes:
        kernels: The program's kernels.
        handed: Places of the numbers that stages pass on.
        limit: Passed numbers over results, above which stages are joined; 0 joins all, for calls that are
            not made and leave no numbers behind.
    """

    kernels: list[Kernel]
    handed: Collection[Shared | Own]
    limit: float = INLINED
    _functions: dict[Any, ca.Function] = field(default_factory=dict)

    def nodes(self, calls: Iterable[Call]) -> list[Node]:
        """Return the nodes of calls in their order; each producer of passed numbers is among the calls."""
        calls = list(calls)
        inlined = self._inlined(calls)
        producers: dict[Shared | Own | None, tuple[Call, int]] = {}
        out = []
        for call in calls:
            out.append(self._node(call, producers, inlined))
            for n, target in enumerate(call.targets):
                if _place(target) in inlined:
                    producers[_place(target)] = call, n
        return out

    def _inlined(self, calls: list[Call]) -> set[Shared | Own]:
        """Return the places of passed numbers of which there are more than results that need them."""
        needed: dict[Shared | Own | None, int] = dict.fromkeys(self.handed, 0)
        for call in calls:
            results = sum(
                self.kernels[call.kernel].function.nnz_out(n)
                for n, target in enumerate(call.targets)
                if not isinstance(target, Worst) and _place(target) not in needed
            )
            for source in call.sources:
                if (place := _place(source)) in needed:
                    needed[place] += results
        return {place for place, count in needed.items() if place and place.size > self.limit * count}

    def _node(
        self, call: Call, producers: dict[Shared | Own | None, tuple[Call, int]], inlined: set[Shared | Own]
    ) -> Node:
        """Return the node of one call."""
        sources: list[Source] = []
        known: dict[Any, int] = {}

        def tree(call: Call) -> tuple[Any, ...]:
            """Return the kernel and its arguments: numbers of sources, or outputs of other trees."""
            arguments: list[Any] = []
            for source in call.sources:
                if (place := _place(source)) in producers:
                    producer, n = producers[place]
                    arguments.append((n, tree(producer)))
                    continue
                same = identity(source)
                if same not in known:
                    known[same] = len(sources)
                    sources.append(source)
                arguments.append(known[same])
            return (call.kernel, *arguments)

        whole = tree(call)
        kept = tuple(
            n
            for n, target in enumerate(call.targets)
            if not isinstance(target, Worst) and _place(target) not in inlined
        )
        key = (whole, kept)
        if key not in self._functions:
            self._functions[key] = self._joined(whole, len(sources), kept)
        targets = tuple(call.targets[n] for n in kept)
        return Node(key, self._functions[key], call.copies, tuple(sources), targets)

    def _joined(self, whole: tuple[Any, ...], count: int, kept: tuple[int, ...]) -> ca.Function:
        """Return the function of a tree of kernels."""
        columns: list[Any] = [None] * count
        done: dict[Any, list[ca.SX]] = {}

        def outputs(tree: tuple[Any, ...]) -> list[ca.SX]:
            """Return the outputs of a tree's kernel."""
            if tree not in done:
                function = self.kernels[tree[0]].function
                arguments = []
                for i, argument in enumerate(tree[1:]):
                    if isinstance(argument, tuple):
                        arguments.append(outputs(argument[1])[argument[0]])
                        continue
                    if columns[argument] is None:
                        columns[argument] = ca.SX.sym(f"x{argument}", function.nnz_in(i))
                    arguments.append(columns[argument])
                done[tree] = function.call(arguments)
            return done[tree]

        out = outputs(whole)
        return ca.Function("joined", columns, [out[n] for n in kept])


def _place(end: Source | Target) -> Shared | Own | None:
    """Return a source or target that may hold passed numbers, else None."""
    return end if isinstance(end, Shared | Own) else None


def identity(source: Source) -> Any:
    """Return what equal sources have in common."""
    match source:
        case Given(index) | Result(index):
            return type(source), index.shape, index.tobytes()
        case Constants(values):
            return Constants, values.shape, values.tobytes()
    return source


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
