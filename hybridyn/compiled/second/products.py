"""Programs of products weights^T f'' direction: a program f forwards along a direction, and back.

Forwards each number has its change along the direction. Back it has its weight, the derivative of
weights^T f over it, and the change of this weight. Those of inputs are the derivative and the product.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple, cast

import casadi as ca
import numpy as np

from ...spatial import Index
from ..program import (
    Add,
    Constants,
    Each,
    Own,
    Program,
    ResultPlace,
    Shared,
    SharedPlace,
    Source,
    Start,
    Target,
    stored,
)
from .activity import ActiveCall, Number, active_steps
from .mirrored import Mirrored
from .twice import Twice, twice

#: Places that a call may write weights to.
Place = Shared | Each | Own | Add
#: Heading of both halves in operation counts.
PART = "second derivatives"


def product_program(
    program: Program, name: str, of: str, over: Sequence[str], zero: Sequence[str] = ()
) -> Program:
    """Build the program of the products of one output.

    Its inputs are those of the program, but for `zero`; the direction, "v_dot" of the input "v"; and
    "weights". Its outputs are those of the program; of each input the derivative of weights^T f, "v_slope",
    and the product, "v_product".

    Args:
        program: The model.
        name: Name of the new program.
        of: The output f.
        over: The inputs that change.
        zero: Those among them that are zero.
    """
    sizes, rows = dict(program.inputs), dict(program.outputs)[of]
    found = [(f"{x}_{what}", sizes[x]) for what in ("slope", "product") for x in over]
    steps = active_steps(program, over, [of])
    read = _results_read(steps)
    w = Mirrored(program, name, 1, over, zero, [("weights", rows)], found, read)
    w.rest(1)
    halves = [half for step in steps if (half := _forwards(w, program, step, read))]
    back = _Back(w, program, of)
    for half in reversed(halves):
        back.add(half)
    back.collect(over)
    return w.program()


def _results_read(steps: Sequence[Start | ActiveCall]) -> set[int]:
    """Return the results that calls read where it matters."""
    calls = [step for step in steps if isinstance(step, ActiveCall)]
    pairs = [(x, c.call.copies) for c in calls for x, own in zip(c.call.sources, c.over, strict=True) if own]
    return {k for x, copies in pairs if isinstance(x, ResultPlace) for k in x.at(copies).ravel().tolist()}


def _is_read(end: Target, copies: int, read: set[int]) -> bool:
    """Return whether what a target writes is more than an output."""
    return not isinstance(end, ResultPlace) or not read.isdisjoint(end.at(copies).ravel().tolist())


class _Half(NamedTuple):
    """A call that has gone forwards.

    Attributes:
        step: The call.
        key: Equal keys mean equal halves.
        twice: Both halves.
        passed: Where what is passed on stands.
    """

    step: ActiveCall
    key: Any
    twice: Twice
    passed: Shared | Own


def _forwards(w: Mirrored, program: Program, step: Start | ActiveCall, read: set[int]) -> _Half | None:
    """Add a step with the changes of its numbers; return what goes back."""
    if isinstance(step, Start):
        w.steps.append(step)
        return None
    call, kernel = step.call, program.kernels[step.call.kernel]
    if not step.matters:
        w.as_it_is(call)
        return None
    pairs = zip(call.targets, step.needed, strict=True)
    used = tuple(own if _is_read(x, call.copies, read) else () for x, own in pairs)
    ends = [x for x, own in zip(call.targets, used, strict=True) if own]
    zero = w.zeros(call)
    key = call.kernel, step.over, step.needed, used, zero
    halves = w.once(("twice", key), twice, kernel.function, step.over, step.needed, used, zero)
    passed = w.shared(halves.passed) if call.copies == 1 else w.own(call.copies, halves.passed)
    sources: list[Source] = [*(w.at(x) for x in call.sources)]
    sources += [w.at(x, 1) for x, own in zip(call.sources, step.over, strict=True) if own]
    targets: list[Target] = [*(w.at(x) for x in call.targets), *(w.at(x, 1) for x in ends), passed]
    w.call(w.kernel(("forwards", key), halves.forwards, PART), call.copies, sources, targets)
    return _Half(step, key, halves, passed)


class _Back:
    """The way back.

    Weights of shared numbers stand in two blocks, themselves and their changes; those of inputs and results
    are sums of parts, which are shared numbers, too.
    """

    def __init__(self, w: Mirrored, program: Program, of: str) -> None:
        """Begin with the weights of an output."""
        self._w, self._program = w, program
        self._weights = [w.shared(program.shared).start for _ in range(2)]
        for at in self._weights:
            if program.shared:
                w.start(Shared(at, program.shared), np.zeros(program.shared))
        self._own = [w.own(1, program.own).start for _ in range(2)]
        self._written: set[Number] = set()
        self._parts: dict[Number, list[tuple[int, int]]] = {}
        starts = {name: (at, size) for name, size, at in stored(program.outputs)}
        self._seeded = range(starts[of][0], sum(starts[of]))

    def add(self, half: _Half) -> None:
        """Add a call's way back."""
        w, call, halves = self._w, half.step.call, half.twice
        n, copies = sum(map(bool, half.step.over)), call.copies
        pairs = [
            self._of_target(x, copies) for x, own in zip(call.targets, half.step.needed, strict=True) if own
        ]
        sources: list[Source] = [w.at(call.sources[i]) for i in halves.reads[0]]
        sources += [w.at(call.sources[i], 1) for i in halves.reads[1]]
        sources += [pair[0] for pair in pairs]
        sources += [pair[1] for pair, on in zip(pairs, halves.changing, strict=True) if on]
        ends = [
            self._of_source(x, copies) for x, own in zip(call.sources, half.step.over, strict=True) if own
        ]
        before = [i for i, (_, again) in enumerate(ends) if again]
        targets: list[Target] = [end[order] for order in range(2) for end, _ in ends]
        key, function = ("back", half.key, *before), halves.back
        if before:
            function = w.once(("more", *key), _more, halves.back, n, before)
        more = [cast("Source", ends[i][0][order]) for order in range(2) for i in before]
        w.call(w.kernel(key, function, PART), copies, [*sources, half.passed, *more], targets)

    def _of_target(self, end: Target, copies: int) -> tuple[Source, Source]:
        """Return the weights of what a call writes, and their changes."""
        if isinstance(end, ResultPlace):
            return self._of_results(end)
        if isinstance(end, Own):
            own = [Own(end.start + at, end.size) for at in self._own]
            return own[0], own[1]
        kind, block = (Each if isinstance(end, Each) else Shared), cast("Shared", end)
        found = [kind(block.start + at, block.size) for at in self._weights]
        return found[0], found[1]

    def _of_results(self, end: ResultPlace) -> tuple[Source, Source]:
        """Return the weights of outputs and their changes, summed over what reads them."""
        shape, flat = end.index.shape, end.index.ravel().tolist()
        if not any(("result", k) in self._parts for k in flat) and all(k in self._seeded for k in flat):
            given = self._w.from_given("weights", end.index - self._seeded.start)
            return given, Constants(np.zeros(shape))
        place = [self._w.shared(len(flat)) for _ in range(2)]
        self._sum([("result", k) for k in flat], place)
        index = np.arange(len(flat)).reshape(shape)
        return SharedPlace(index + place[0].start), SharedPlace(index + place[1].start)

    def _of_source(self, end: Source, copies: int) -> tuple[list[Place], bool]:
        """Return where weights of what a call reads and their changes go, and whether others stand there."""
        assert not isinstance(end, SharedPlace)  # its weights would be parts that nothing sums up
        at: Index = end.at(copies)
        if isinstance(end, Own):
            again = ("own", end.start) in self._written
            self._written.add(("own", end.start))
            return [Own(end.start + x, end.size) for x in self._own], again
        if isinstance(end, Shared | Each):
            numbers = {("shared", k) for k in at.ravel().tolist()}
            again = not self._written.isdisjoint(numbers)
            self._written |= numbers
            if isinstance(end, Shared) and (copies > 1 or again):  # others stand beside
                return [Add(end.start + x, end.size) for x in self._weights], False
            return [type(end)(end.start + x, end.size) for x in self._weights], again
        places = [self._w.each(copies, at.shape[1]) for _ in range(2)]
        first, second = (np.arange(at.size) + place.start for place in places)
        for k, x, y in zip(at.ravel().tolist(), first.tolist(), second.tolist(), strict=True):
            self._parts.setdefault((end.memory, k), []).append((x, y))
        return [Shared(x.start, x.size) if copies == 1 else x for x in places], False

    def collect(self, over: Sequence[str]) -> None:
        """Write the weights of inputs and their changes as outputs."""
        for name, size, at in stored(self._program.inputs):
            if name in over:
                index = np.arange(size)
                places = [self._w.result(f"{name}_{what}", index) for what in ("slope", "product")]
                self._sum([("given", at + k) for k in range(size)], places)

    def _sum(self, numbers: Sequence[Number], places: Sequence[Target]) -> None:
        """Add the call that sums up parts, of weights and of their changes."""
        parts = [self._parts.get(number, []) for number in numbers]
        seeds = [
            k - self._seeded.start if of == "result" and k in self._seeded else None for of, k in numbers
        ]
        counts, given = tuple(map(len, parts)), [k for k in seeds if k is not None]
        kernel = partial(_summed, counts, tuple(k is not None for k in seeds))
        w = self._w
        for order, place in enumerate(places):
            index = np.array([[pair[order] for own in parts for pair in own]], dtype=int)
            first = w.from_given("weights", np.array(given, dtype=int)) if order == 0 else None
            weights: Source = first if first is not None else Constants(np.zeros((1, len(given))))
            key = ("sum", counts, tuple(k is not None for k in seeds))
            w.call(w.kernel(key, kernel, PART), 1, [SharedPlace(index), weights], [place])


def _summed(counts: tuple[int, ...], seeded: tuple[bool, ...]) -> ca.Function:
    """Return the function that sums up parts, and a given number where there is one."""
    parts, given = ca.SX.sym("parts", sum(counts)), ca.SX.sym("given", sum(seeded))
    out, at, n = [], 0, 0
    for count, seed in zip(counts, seeded, strict=True):
        value = given[n] if seed else ca.SX(0.0)
        for k in range(at, at + count):
            value += parts[k]
        out.append(value)
        at, n = at + count, n + seed
    return ca.Function("sum", [parts, given], [ca.vertcat(*out) if out else ca.SX(0, 1)])


def _more(back: ca.Function, n: int, before: Sequence[int]) -> ca.Function:
    """Return a function whose results are added to what stands there: sources and changes, n each."""
    x = [ca.SX.sym(f"x{i}", back.nnz_in(i)) for i in range(back.n_in())]
    y = list(back.call(x))
    more = [ca.SX.sym(f"b{k}", back.nnz_out(k)) for k in (*before, *(n + i for i in before))]
    for k, column in zip((*before, *(n + i for i in before)), more, strict=True):
        y[k] = y[k] + column
    return ca.Function("more", [*x, *more], y)
