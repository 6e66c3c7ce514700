"""Expressions over the columns of a table, "peak_effort / 2 < 10 and reach > 0.2", by simpleeval."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from simpleeval import SimpleEval

from ...description.names import did_you_mean, listed
from ...errors import HybridynError

#: What is true counts 1 and what is false 0, as in Python.
_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.true_divide,
    ast.Pow: np.float_power, ast.USub: operator.neg, ast.UAdd: operator.pos,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Not: lambda x: 1.0 * np.logical_not(x),
    ast.And: np.logical_and.reduce, ast.Or: np.logical_or.reduce,
}  # fmt: skip
_FUNCTIONS = {"abs": np.abs, "sqrt": np.sqrt, "log": np.log}


class Expression(SimpleEval):  # type: ignore[misc]
    """An expression of the columns of a table.

    Attributes:
        text: The expression as the user wrote it.
        used: The columns that it needs.
    """

    nodes: dict[type[ast.AST], Callable[..., Any]]
    names: Mapping[str, Any]

    def __init__(self, text: str, columns: Sequence[str], what: str) -> None:
        """Parse an expression, and try it on a row.

        Args:
            what: Name of the expression in messages.

        Raises:
            HybridynError: It is no expression, or there is no such column.
        """
        super().__init__(_OPERATORS, _FUNCTIONS)
        self.text, self._what, self.used = text.strip(), what, set[str]()
        self.nodes = {kind: self.nodes[kind] for kind in (ast.UnaryOp, ast.BinOp, ast.Call)} | {
            ast.Name: self._column, ast.Attribute: self._column, ast.BoolOp: self._joined,
            ast.Compare: self._chained, ast.Constant: lambda node: float(node.value),
        }  # fmt: skip
        try:
            self._tree = ast.parse(self.text, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise HybridynError(f"{what}: '{text}' is no expression like 'peak_effort < 10'") from None
        try:
            self(dict.fromkeys(columns, np.ones(1)))
        except HybridynError:
            raise
        except Exception as error:  # whatever operators and functions raise for what is no number
            raise HybridynError(
                f"{what}: '{self.text}' is not understood ({error}): use columns, numbers, + - * / **, "
                "comparisons, and, or, not, abs(), sqrt(), log()"
            ) from None

    def __call__(self, columns: Mapping[str, Any]) -> Any:
        """Evaluate the expression. `columns`: columns by name, shape (rows,) each."""
        self.names = columns
        with np.errstate(all="ignore"):
            return self._eval(self._tree)

    def _column(self, node: ast.AST) -> Any:
        """Return a column; one of several tasks has a dot in its name."""
        name = ast.unparse(node)
        if name not in self.names:
            raise HybridynError(
                f"{self._what}: there is no column '{name}'{did_you_mean(name, self.names)}; "
                f"the columns are {listed(self.names)}"
            )
        self.used.add(name)
        return self.names[name]

    def _joined(self, node: ast.BoolOp) -> Any:
        """Join conditions row by row."""
        return 1.0 * self.operators[type(node.op)](np.broadcast_arrays(*map(self._eval, node.values)))

    def _chained(self, node: ast.Compare) -> Any:
        """Compare neighbours in a chain row by row."""
        sides = pairwise(map(self._eval, (node.left, *node.comparators)))
        found = [self.operators[type(one)](*both) for one, both in zip(node.ops, sides, strict=True)]
        return 1.0 * np.logical_and.reduce(np.broadcast_arrays(*found))
