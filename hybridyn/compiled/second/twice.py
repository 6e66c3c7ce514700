"""One kernel differentiated twice: back, and then along a direction.

With outputs y(x), their weights y_bar and a direction x', the derivative of x_bar = y_x^T y_bar along it is

    x_bar' = (y_bar^T y_x)_x x' + y_x^T y_bar'

A program runs forwards first and back afterwards, so that the kernel is cut in two where weights enter: what
the second half reads of the first one is passed on, and nothing is computed twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca

from .activity import Entries
from .simplified import simplified

Columns = list[ca.SX]


class Twice(NamedTuple):
    """A kernel's two halves.

    Attributes:
        forwards: From its sources, and the changes of those that matter, to its targets, the changes of those
            that are needed, and what is passed on.
        passed: Number of numbers passed on.
        back: From some of these sources and changes, the weights of needed targets, their changes, and what
            is passed on, to the weights of sources that matter and to their changes.
        reads: Which of the sources the second half reads, and of which the change.
        changing: Of which needed targets the weights change along the direction.
    """

    forwards: ca.Function
    passed: int
    back: ca.Function
    reads: tuple[list[int], list[int]]
    changing: list[bool]


def twice(function: ca.Function, over: Entries, needed: Entries, used: Entries, zero: Sequence[int]) -> Twice:
    """Differentiate a kernel twice.

    Args:
        function: The kernel.
        over: Entries of each source that matter.
        needed: Entries of each target that are needed.
        used: Those that are more than outputs: their changes are needed, and their weights change.
        zero: Sources that are zero.
    """
    x = [ca.SX.sym(f"x{i}", function.nnz_in(i)) for i in range(function.n_in())]
    y = [ca.densify(value) for value in simplified(function).call(x)]
    moved = [ca.SX.sym(f"d{i}", column.numel()) for i, column in enumerate(x)]
    bar = [ca.SX.sym(f"w{i}", value.numel()) for i, value in enumerate(y)]
    bar_moved = [ca.SX.sym(f"v{i}", value.numel()) for i, value in enumerate(y)]
    X, X_moved, Y = chosen(x, over), chosen(moved, over), chosen(y, needed)
    W = chosen(bar, needed)
    W_moved = chosen(
        [b if own else ca.SX.zeros(*b.shape) for b, own in zip(bar_moved, used, strict=True)], needed
    )
    ahead = ca.jtimes(chosen(y, used), X, X_moved)
    weights = ca.gradient(ca.dot(W, Y), X)
    change = ca.jtimes(weights, ca.vertcat(X, W), ca.vertcat(X_moved, W_moved))
    early, late = [*y, *spread(ahead, used, y)], [*spread(weights, over, x), *spread(change, over, x)]
    whole = folded(x, zero, [*early, *late])
    early, late = whole[: len(early)], whole[len(early) :]
    known, given = [*x, *_some(moved, over)], [*_some(bar, needed), *_some(bar_moved, used)]
    first, second, passed, symbols = cut(known, given, early, late)
    found = {s.element_hash() for s in ca.symvar(ca.vertcat(*second))}
    read = [[i for i, c in enumerate(columns) if _reads(c, found)] for columns in (x, moved)]
    inputs = [*(x[i] for i in read[0]), *(moved[i] for i in read[1]), *given, symbols]
    return Twice(
        ca.Function("forwards", known, [*first, passed]),
        passed.numel(),
        ca.Function("back", inputs, second),
        (read[0], read[1]),
        [bool(own) for own, of in zip(used, needed, strict=True) if of],
    )


def chosen(columns: Sequence[ca.SX], entries: Entries) -> ca.SX:
    """Return the entries of columns as one column."""
    return ca.vertcat(*(c[list(own)] for c, own in zip(columns, entries, strict=True) if own))


def spread(column: ca.SX, entries: Entries, like: Sequence[ca.SX]) -> Columns:
    """Return a column's parts in columns of other sizes, zero elsewhere; those without parts are left out."""
    out, at = [], 0
    for own, other in zip(entries, like, strict=True):
        if own:
            whole = ca.SX.zeros(other.numel(), 1)
            whole[list(own)] = column[at : at + len(own)]
            out.append(ca.densify(whole))
            at += len(own)
    return out


def folded(columns: Columns, zero: Sequence[int], expressions: Columns) -> Columns:
    """Return expressions in which some columns of symbols are zero."""
    if not zero:
        return expressions
    zeros = [ca.SX.zeros(*columns[i].shape) for i in zero]
    return list(ca.substitute(expressions, [columns[i] for i in zero], zeros))


def _some(columns: Columns, entries: Entries) -> Columns:
    """Return the columns of which entries matter."""
    return [c for c, own in zip(columns, entries, strict=True) if own]


def _reads(column: ca.SX, used: set[int]) -> bool:
    """Return whether symbols of a column are among those used."""
    return any(s.element_hash() in used for s in ca.symvar(column))


class Halves(NamedTuple):
    """Expressions cut where later inputs enter, with common terms once.

    Attributes:
        early: Those of the earlier inputs alone.
        late: Those of all inputs, in which symbols stand for what is passed on.
        passed: What is passed on, expressions of the earlier inputs.
        symbols: The symbols.
    """

    early: Columns
    late: Columns
    passed: ca.SX
    symbols: ca.SX


class _Value(NamedTuple):
    """A number of a function.

    Attributes:
        value: Its expression.
        number: By which it can be passed on; None for inputs and constants.
        late: Whether it depends on later inputs.
    """

    value: ca.SX
    number: int | None
    late: bool


def cut(known: Columns, given: Columns, early: Columns, late: Columns) -> Halves:
    """Cut expressions where later inputs enter.

    Args:
        known: Symbols of the earlier inputs.
        given: Symbols of the later inputs.
        early: Expressions of the earlier inputs alone.
        late: Expressions of all.
    """
    columns = [*known, *given]
    whole = ca.Function("whole", columns, ca.cse([*early, *late]))
    outputs = [[ca.SX(0.0)] * whole.nnz_out(i) for i in range(whole.n_out())]
    work, passed = dict[int, _Value](), dict[int, tuple[ca.SX, ca.SX]]()

    def later(x: _Value) -> ca.SX:
        """Return a number as the second half reads it."""
        if x.late or x.number is None:
            return x.value
        return passed.setdefault(x.number, (x.value, ca.SX.sym(f"p{x.number}")))[1]

    for k in range(whole.n_instructions()):
        code, out = whole.instruction_id(k), whole.instruction_output(k)
        read: list[int] = whole.instruction_input(k)
        if code == ca.OP_OUTPUT:
            x = work[read[0]]
            outputs[out[0]][out[1]] = later(x) if out[0] >= len(early) else x.value
        elif code == ca.OP_INPUT:
            work[out[0]] = _Value(columns[read[0]][read[1]], None, read[0] >= len(known))
        elif code == ca.OP_CONST:
            work[out[0]] = _Value(ca.SX(whole.instruction_constant(k)), None, False)
        else:
            is_late = any(work[i].late for i in read)
            values: list[Any] = [later(work[i]) if is_late else work[i].value for i in read]
            apply = ca.SX.binary if len(values) == 2 else ca.SX.unary
            work[out[0]] = _Value(apply(code, *values), k, is_late)
    ends = [_column(entries) for entries in outputs]
    numbers, symbols = (_column([pair[i] for pair in passed.values()]) for i in (0, 1))
    return Halves(ends[: len(early)], ends[len(early) :], numbers, symbols)


def _column(entries: Columns) -> ca.SX:
    """Return scalars as one column."""
    return ca.vertcat(*entries) if entries else ca.SX(0, 1)
