"""Linear steps of one node: its tangents operation by operation, for a node with one copy.

A node with one copy has the same coefficients for all columns. Where its function is long and has many
results, the columns take fewer operations step by step than through a matrix of all its derivatives.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from ...equations.expressions import pack
from .nodes import Node

#: A source and its entry, or a target and its entry.
Entry = tuple[int, int]

#: Factors that cost no product.
FREE = ("1.0", "-1.0")


@dataclass(frozen=True)
class Linear:
    """Tangents of a node as a list of sums of products.

    Attributes:
        key: Equal keys mean equal steps.
        coefficients: Function of the node's sources; its output are the coefficients.
        size: Number of coefficients.
        inputs: Number of each source entry's tangent.
        outputs: Number of each target entry's tangent; entries that do not change are left out.
        steps: Number of a tangent, and its terms: a factor (a number, or the index of a coefficient) and the
            number of an earlier tangent.
    """

    key: Any
    coefficients: ca.Function
    size: int
    inputs: dict[Entry, int]
    outputs: dict[Entry, int]
    steps: list[tuple[int, list[tuple[float | int, int]]]]

    def used(self, changed: Collection[Entry]) -> tuple[list[Entry], list[Entry]]:
        """Return which of the changed source entries matter, and which target entries they change."""
        active = {self.inputs[x] for x in changed if x in self.inputs}
        for out, terms in self.steps:
            if any(k in active for _, k in terms):
                active.add(out)
        rows = sorted(x for x, k in self.outputs.items() if k in active)
        needed = self.needed(self.outputs[x] for x in rows)
        return sorted(x for x in changed if self.inputs.get(x) in needed), rows

    def needed(self, wanted: Iterable[int]) -> set[int]:
        """Return the tangents from which some tangents are computed, those themselves among them."""
        needed = set(wanted)
        for out, terms in reversed(self.steps):
            if out in needed:
                needed.update(k for _, k in terms)
        return needed

    def operations(self, changed: Collection[Entry]) -> int:
        """Count the operations of the steps for one column in which some source entries change."""
        active, needed, count = set(map(self.inputs.get, changed)), self.needed(self.outputs.values()), 0
        for out, terms in self.steps:
            factors = [factor for factor, k in terms if k in active]
            if factors and out in needed:
                active.add(out)
                count += sum(2 - (str(factor) in FREE) for factor in factors) - 1
        return count

    def tangents(self, numbers: ca.SX, known: dict[Entry, Any], rows: list[Entry]) -> list[Any]:
        """Return the tangents of target entries, from those of the source entries that change."""
        of = {self.inputs[x]: value for x, value in known.items()}
        for out, terms in self.steps:
            for factor, k in terms:
                if k in of:
                    term = of[k] * (numbers[factor] if isinstance(factor, int) else factor)
                    of[out] = of[out] + term if out in of else term
        return [of[self.outputs[x]] for x in rows]


def linearized(node: Node, ins: list[int], ends: list[Entry]) -> Linear:
    """Write the tangents of a node.

    Args:
        ins: Sources that change.
        ends: Target entries whose tangents are wanted.
    """
    f = node.function
    columns = [ca.SX.sym(f"x{n}", f.nnz_in(n)) for n in range(f.n_in())]
    values = [ca.densify(x) for x in f.call(columns)]
    common = ca.vertsplit(ca.cse(ca.vertcat(*(values[n][k] for n, k in ends))))
    whole = ca.Function("whole", columns, [ca.vertcat(*common)])
    slots: dict[int, tuple[ca.SX, int | None]] = {}
    inputs: dict[Entry, int] = {}
    outputs: dict[Entry, int] = {}
    steps: list[tuple[int, list[tuple[float | int, int]]]] = []
    factors: dict[int, int] = {}
    kept: list[ca.SX] = []
    count = 0
    for k in range(whole.n_instructions()):
        op, read, out = whole.instruction_id(k), whole.instruction_input(k), whole.instruction_output(k)
        if op == ca.OP_INPUT:
            if read[0] in ins:
                inputs[read[0], read[1]] = count
            slots[out[0]] = columns[read[0]][read[1]], count if read[0] in ins else None
            count += 1
        elif op == ca.OP_CONST:
            slots[out[0]] = ca.SX(whole.instruction_constant(k)), None
        elif op == ca.OP_OUTPUT:
            if (changed := slots[read[0]][1]) is not None:
                outputs[ends[out[1]]] = changed
        else:
            given = [slots[i] for i in read]
            value = _value(op, [x for x, _ in given])
            terms: list[tuple[float | int, int]] = []
            for n, (_, source) in enumerate(given):
                factor = _partial(op, [x for x, _ in given], n) if source is not None else ca.SX(0.0)
                if source is None or factor.is_zero():
                    continue
                if factor.is_constant():
                    terms.append((float(factor), source))
                    continue
                if (same := factor.element_hash()) not in factors:
                    factors[same] = len(kept)
                    kept.append(factor)
                terms.append((factors[same], source))
            if terms:
                steps.append((count, terms))
            slots[out[0]] = value, count if terms else None
            count += 1
    output = pack(np.array(kept, dtype=object)) if kept else ca.SX(0, 1)
    key = ("linear", node.key, tuple(ins), tuple(ends))
    return Linear(key, ca.Function("linear", columns, [output]), len(kept), inputs, outputs, steps)


def _value(op: int, x: list[ca.SX]) -> ca.SX:
    """Return the result of an operation."""
    return ca.SX.unary(op, *x) if len(x) == 1 else ca.SX.binary(op, *x)


def _partial(op: int, x: list[ca.SX], n: int) -> ca.SX:
    """Return the derivative of an operation over one of its arguments."""
    if op == ca.OP_MUL:
        return x[1 - n]
    symbols = [ca.SX.sym("x") for _ in x]
    return ca.substitute([ca.jacobian(_value(op, symbols), symbols[n])], symbols, x)[0]
