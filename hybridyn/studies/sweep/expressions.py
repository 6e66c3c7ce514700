"""Expressions over the columns of a table, "peak_effort / 2 < 10 and reach > 0.2": parsed, never executed."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ...description.names import did_you_mean, listed
from ...errors import HybridynError

_BINARY: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: np.true_divide,
    ast.Pow: np.float_power,
}  # fmt: skip
_COMPARE: dict[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip
_FUNCTIONS: dict[str, Callable[[Any], Any]] = {"abs": np.abs, "sqrt": np.sqrt, "log": np.log}
#: Longest expression [characters].
LONGEST = 1000
#: Largest number; a whole number may be larger than any that arrays hold.
LARGEST = float(np.finfo(float).max)


class Expression:
    """An expression of the columns of a table.

    Attributes:
        text: The expression as the user wrote it.
        names: The columns that it needs.
    """

    def __init__(self, text: str, columns: Sequence[str], what: str, *, several: bool = False) -> None:
        """Parse an expression.

        Args:
            what: Name of the expression in messages.
            several: Whether it may be several with commas between, which have no value together.

        Raises:
            HybridynError: It is no expression, or there is no such column.
        """
        self.text, self._what, self._columns, self._several = text.strip(), what, columns, several
        self.names: list[str] = []
        try:
            if len(text) > LONGEST:
                raise ValueError("too long")
            self._tree = ast.parse(self.text, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise HybridynError(f"{what}: '{text}' is no expression like 'peak_effort < 10'") from None
        self._check(self._tree)

    def __call__(self, columns: Mapping[str, Any]) -> Any:
        """Evaluate the expression. `columns`: columns by name, shape (rows,) each."""
        with np.errstate(all="ignore"):
            return self._value(self._tree, columns)

    def parts(self) -> list[str]:
        """Return the texts of the expressions between commas."""
        parts = self._tree.elts if isinstance(self._tree, ast.Tuple) else [self._tree]
        return [ast.unparse(part) for part in parts]

    def _check(self, node: ast.AST) -> None:
        """Check that every part is known, and collect the columns."""
        if isinstance(node, ast.Name | ast.Attribute):
            name = ast.unparse(node)
            if name not in self._columns:
                raise HybridynError(
                    f"{self._what}: there is no column '{name}'{did_you_mean(name, self._columns)}; "
                    f"the columns are {listed(self._columns)}"
                )
            self.names.append(name)
            return
        if isinstance(node, ast.Constant):
            number = isinstance(node.value, int | float) and not isinstance(node.value, bool)
            known = number and node.value <= LARGEST  # type: ignore[operator]
        elif isinstance(node, ast.BinOp):
            known = type(node.op) in _BINARY
        elif isinstance(node, ast.UnaryOp):
            known = isinstance(node.op, ast.USub | ast.UAdd | ast.Not)
        elif isinstance(node, ast.Compare):
            known = all(type(one) in _COMPARE for one in node.ops)
        elif isinstance(node, ast.Call):
            named = isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS
            known = named and len(node.args) == 1 and not node.keywords
        else:
            whole = self._several and node is self._tree
            known = isinstance(node, ast.BoolOp) or (
                whole and isinstance(node, ast.Tuple) and node.elts != []
            )
        if not known:
            raise HybridynError(
                f"{self._what}: '{ast.unparse(node)}' is not understood: use columns, numbers, + - * / **, "
                "comparisons, and, or, not, abs(), sqrt(), log()"
            )
        for child in node.args if isinstance(node, ast.Call) else ast.iter_child_nodes(node):
            if isinstance(child, ast.expr):
                self._check(child)

    def _value(self, node: ast.AST, columns: Mapping[str, Any]) -> Any:
        if isinstance(node, ast.Name | ast.Attribute):
            return columns[ast.unparse(node)]
        if isinstance(node, ast.Constant):
            return float(node.value)  # type: ignore[arg-type]
        if isinstance(node, ast.BinOp):
            left, right = self._number(node.left, columns), self._number(node.right, columns)
            return _BINARY[type(node.op)](left, right)
        if isinstance(node, ast.UnaryOp):
            if isinstance(node.op, ast.Not):
                return np.logical_not(self._value(node.operand, columns))
            value = self._number(node.operand, columns)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.Compare):
            sides = [self._value(side, columns) for side in (node.left, *node.comparators)]
            found = [
                _COMPARE[type(one)](left, right)
                for one, left, right in zip(node.ops, sides[:-1], sides[1:], strict=True)
            ]
            return np.logical_and.reduce(np.broadcast_arrays(*found))
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            return _FUNCTIONS[node.func.id](self._number(node.args[0], columns))
        assert isinstance(node, ast.BoolOp)
        every = [self._value(part, columns) for part in node.values]
        reduce = np.logical_and.reduce if isinstance(node.op, ast.And) else np.logical_or.reduce
        return reduce(np.broadcast_arrays(*every))

    def _number(self, node: ast.AST, columns: Mapping[str, Any]) -> Any:
        """Evaluate a part as numbers: what is true counts 1 and what is false 0, as in Python."""
        return 1.0 * self._value(node, columns)
