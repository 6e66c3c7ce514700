"""One kernel differentiated twice: back, and then along a direction.

With outputs y(x), their weights y_bar and a direction x', the derivative of x_bar = y_x^T y_bar along it is

    x_bar' = (y_bar^T y_x)_x x' + y_x^T y_bar'

A program runs forwards first and back afterwards, so that the kernel is cut in two where weights enter: what
the second half reads of the first one is passed on, and nothing is computed twice.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

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
    first, second, passed, symbols = cut(known, early, late)
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


def cut(known: Columns, early: Columns, late: Columns) -> tuple[Columns, Columns, ca.SX, ca.SX]:
    """Cut expressions where later inputs enter, with common terms once.

    Args:
        known: Symbols of the earlier inputs.
        early: Expressions of these alone.
        late: Expressions of all inputs.

    Returns:
        Both, the later ones with symbols for what is passed on; what is passed on, expressions of the
        earlier inputs; and these symbols.
    """
    whole = ca.cse([*early, *late])
    late, symbols, passed = ca.extract_parametric(whole[len(early) :], known, {})
    none = ca.SX(0, 1)
    return whole[: len(early)], late, ca.vertcat(none, *passed), ca.vertcat(none, *symbols)
