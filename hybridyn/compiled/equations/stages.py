"""Cut one graph of expressions into stages that run at different times, and write the symbols of modules.

A model is written as one graph, but some of its inputs are known only at a later stage. Each stage passes
the intermediate results to later stages that need them, so that nothing is computed twice.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import casadi as ca
import numpy as np

from ...spatial import Index
from .core import Plan
from .expressions import Expression, pack, plain, symbols, zeros

Node = int


@dataclass(frozen=True)
class Stage:
    """One stage of a cut graph.

    Attributes:
        inputs: Names of its inputs in order; ("from", s) holds the intermediate results of stage s.
        outputs: Names of its outputs in order; ("to", t) holds the intermediate results for stage t.
        function: The CasADi function.
    """

    inputs: tuple[Any, ...]
    outputs: tuple[Any, ...]
    function: ca.Function


@dataclass
class _Graph:
    """The instructions of a function in single-assignment form.

    Attributes:
        code: Operation and operands of each node, and the value of a constant or the indices of an input.
        stage: First stage at which each node can be computed.
        results: Nodes of each output.
    """

    code: list[tuple[int, tuple[Node, ...], Any]] = field(default_factory=list)
    stage: list[int] = field(default_factory=list)
    results: list[list[Node]] = field(default_factory=list)


def cut(
    name: str,
    inputs: list[dict[str, ca.SX]],
    outputs: list[dict[str, ca.SX]],
) -> list[Stage]:
    """Cut a graph into stages.

    A stage computes whatever its inputs suffice for, also what only a later stage asks for.

    Args:
        name: Prefix of the functions' names; stage s is `name`_s.
        inputs: For each stage the columns of symbols that are first known at it, by name.
        outputs: For each stage the columns that it must compute, by name.

    Returns:
        The stages. The inputs of a stage are those it uses, also those of earlier stages.
    """
    given = [(s, n, column) for s, columns in enumerate(inputs) for n, column in columns.items()]
    wanted = [(s, n, column) for s, columns in enumerate(outputs) for n, column in columns.items()]
    whole = ca.Function("whole", [c for *_, c in given], ca.cse([ca.densify(c) for *_, c in wanted]))
    graph = _read(whole, [s for s, *_ in given])
    stages = [s for s, *_ in wanted]
    asked = _asked(graph, stages)
    handed = _handed(graph, stages, asked)
    return [_stage(f"{name}_{s}", s, graph, handed, given, wanted, asked) for s in range(len(inputs))]


def _asked(graph: _Graph, stage_of_output: list[int]) -> dict[Node, int]:
    """Return for each node that an output needs the first stage that asks for it."""
    asked: dict[Node, int] = {}
    for nodes, stage in zip(graph.results, stage_of_output, strict=True):
        for node in nodes:
            asked[node] = min(asked.get(node, stage), stage)
    for node in range(len(graph.code) - 1, -1, -1):  # operands come before what is made of them
        if node in asked:
            for operand in graph.code[node][1]:
                asked[operand] = min(asked.get(operand, asked[node]), asked[node])
    return dict(sorted(asked.items()))


def _read(whole: ca.Function, stage_of_input: list[int]) -> _Graph:
    """Read a function's instructions."""
    graph = _Graph(results=[[-1] * whole.numel_out(i) for i in range(whole.n_out())])
    at: dict[int, Node] = {}
    for k in range(whole.n_instructions()):
        op, ins, outs = whole.instruction_id(k), whole.instruction_input(k), whole.instruction_output(k)
        if op == ca.OP_OUTPUT:
            graph.results[outs[0]][outs[1]] = at[ins[0]]
            continue
        operands: tuple[Node, ...] = ()
        stage = 0
        extra: Any = None
        if op == ca.OP_CONST:
            extra = whole.instruction_constant(k)
        elif op == ca.OP_INPUT:
            stage, extra = stage_of_input[ins[0]], (ins[0], ins[1])
        else:
            operands = tuple(at[i] for i in ins)
            stage = max(graph.stage[i] for i in operands)
        at[outs[0]] = len(graph.code)
        graph.code.append((op, operands, extra))
        graph.stage.append(stage)
    return graph


def _handed(
    graph: _Graph, stage_of_output: list[int], nodes: Iterable[Node]
) -> dict[tuple[int, int], list[Node]]:
    """Return those of some nodes that each stage (first key) passes to each later one (second key)."""
    needed: dict[tuple[int, int], dict[Node, None]] = {}

    def ask(node: Node, by: int) -> None:
        """Note that a stage needs a node of an earlier one."""
        if graph.stage[node] < by and graph.code[node][0] not in (ca.OP_CONST, ca.OP_INPUT):
            needed.setdefault((graph.stage[node], by), {})[node] = None

    for node in nodes:
        for operand in graph.code[node][1]:
            ask(operand, graph.stage[node])
    for column, stage in zip(graph.results, stage_of_output, strict=True):
        for node in column:
            ask(node, stage)
    return {key: list(found) for key, found in needed.items()}


def _value(
    graph: _Graph, given: list[tuple[int, Any, ca.SX]], values: dict[Node, Any], used: set[int], node: Node
) -> Any:
    """Return the CasADi expression of a node from those of its operands; record it, and an input it uses."""
    op, operands, extra = graph.code[node]
    if node in values:
        return values[node]
    if op == ca.OP_CONST:
        out = ca.SX(extra)
    elif op == ca.OP_INPUT:
        used.add(extra[0])
        out = given[extra[0]][2][extra[1]]
    elif len(operands) == 1:
        out = ca.SX.unary(op, values[operands[0]])
    else:
        out = ca.SX.binary(op, values[operands[0]], values[operands[1]])
    values[node] = out
    return out


def _stage(
    name: str,
    s: int,
    graph: _Graph,
    handed: dict[tuple[int, int], list[Node]],
    given: list[tuple[int, Any, ca.SX]],
    wanted: list[tuple[int, Any, ca.SX]],
    asked: dict[Node, int],
) -> Stage:
    """Build the function of one stage."""
    values: dict[Node, Any] = {}
    taken = {t: ca.SX.sym(f"from_{t}", len(nodes)) for (t, by), nodes in sorted(handed.items()) if by == s}
    for t, column in taken.items():
        values |= {node: column[i] for i, node in enumerate(handed[t, s])}
    used: set[int] = set()
    value = partial(_value, graph, given, values, used)
    for node in asked:
        op, operands, _ = graph.code[node]
        if graph.stage[node] == s and op not in (ca.OP_CONST, ca.OP_INPUT):
            for operand in operands:
                value(operand)
            value(node)
    results = [
        (n, pack([value(node) for node in graph.results[i]])) for i, (t, n, _) in enumerate(wanted) if t == s
    ]
    given_on = [
        (("to", by), pack([value(n) for n in nodes])) for (t, by), nodes in sorted(handed.items()) if t == s
    ]
    ins = [(n, column) for i, (_, n, column) in enumerate(given) if i in used]
    ins += [(("from", t), column) for t, column in taken.items()]
    outs = [*results, *given_on]
    symbols = [c for _, c in ins]
    function = ca.Function(name, symbols, [x for _, x in outs])
    return Stage(tuple(n for n, _ in ins), tuple(n for n, _ in outs), function)


@dataclass(frozen=True, eq=False)
class WrittenModule:
    """The stages of one module's model, and the coordinates that they read.

    Attributes:
        q, v: Coordinates and freedoms of the spanning tree in the inputs "q" and "v" (and "a").
        platforms: Links of the core that are platforms, in the order of the outputs "platform i".
    """

    stages: list[Stage]
    q: Index
    v: Index
    platforms: tuple[int, ...]


@dataclass(frozen=True)
class BaseMotion:
    """Motion of the base of a module, as symbols, or as constants for a base at rest.

    Attributes:
        V: Twist, shape (6,), own frame.
        A: Acceleration less gravity, shape (6,), own frame.
        V_column, A_column: Their symbols by name, "V_base" and "A_base"; empty for a base at rest.
    """

    V: Expression
    A: Expression
    V_column: dict[str, ca.SX]
    A_column: dict[str, ca.SX]


def base_motion(at_rest: tuple[float, ...] | None, velocity: bool) -> BaseMotion:
    """Return the motion of a module's base.

    Every module is written relative to an observer who moves with its base's origin. So only the base's
    angular velocity matters, and no digits are lost to a common velocity. Without velocity terms the model is
    not the same for all observers, and the whole twist is used.

    Args:
        at_rest: Acceleration (less gravity) of a base at rest, else None.
        velocity: Whether velocity terms are on.
    """
    if at_rest is not None:
        return BaseMotion(zeros(6), plain(at_rest), {}, {})
    V_column, twist = symbols("V_base", twist_width(velocity))
    A_column, A = symbols("A_base", 6)
    V = np.concatenate([zeros(6 - len(twist)), twist])
    return BaseMotion(V, A, {"V_base": V_column}, {"A_base": A_column})


def twist_width(velocity: bool) -> int:
    """Return the size of a base's twist: 3 for its angular part, or 6 (`base_motion`)."""
    return 3 if velocity else 6


def read_by_core(plan: Plan) -> tuple[Index, Index]:
    """Return the coordinates and freedoms of the spanning tree that a core reads."""
    parts = plan.parts
    out = []
    for own, paths in ((parts.q, [p.q for p in plan.paths]), (parts.v, [p.v for p in plan.paths])):
        out.append(np.unique(np.concatenate([own[own >= 0], *paths]).astype(int)))
    return out[0], out[1]


def parameters_of(plan: Plan) -> dict[str, ca.SX]:
    """Return the symbols of a module's arguments, or nothing."""
    return {} if plan.column is None else {"parameters": plan.column}


def scattered(name: str, index: Index, width: int) -> tuple[ca.SX, Expression]:
    """Return symbols for some entries of a vector, and the vector with zeros in its other entries."""
    column, entries = symbols(name, len(index))
    out = zeros(width)
    out[index] = entries
    return column, out
