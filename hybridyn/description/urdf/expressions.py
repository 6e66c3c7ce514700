"""Evaluate the expressions of xacro files by simpleeval, which walks their syntax trees and runs no Python.

An attribute is an element of one of xacro's own dictionaries (`math.pi`, `limits.upper`) or a harmless method
of a text, list, tuple or dictionary, never a Python attribute. So classes, frames and modules cannot be
reached. What could grow without limit is bounded before it is computed, and what is computed is counted.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sized
from functools import cache, partial
from typing import Any

from simpleeval import DEFAULT_OPERATORS, EvalWithCompoundTypes

from ..bounds import Budget, refuse_above

#: What a step of an expression, an element of a value that it may read, and a character of a syntax tree
#: count [bytes]: they take time, or memory.
STEP, READ, SYNTAX = 100, 4, 250

_WIDE_FIELD = re.compile(r"%[^a-zA-Z%]*(\d{5}|\*)")

_TEXT = (
    "capitalize casefold count endswith find index isalnum isalpha isdecimal isdigit islower isnumeric "
    "isspace isupper join lower lstrip partition removeprefix removesuffix replace rfind rindex rpartition "
    "rsplit rstrip split splitlines startswith strip swapcase title upper"
)
#: Methods that may be called, by type: none accesses attributes (`format`) or pads to an arbitrary width.
_METHODS: dict[type, frozenset[str]] = {
    str: frozenset(_TEXT.split()),
    list: frozenset({"copy", "count", "index", "pop"}),
    tuple: frozenset({"count", "index"}),
    dict: frozenset({"copy", "get", "items", "keys", "values"}),
    float: frozenset({"is_integer"}),
}

#: Names of xacro that inspect objects, or compute huge numbers of short arguments; no robot file needs them.
FORBIDDEN = ("type", "vars", "issubclass", "factorial", "comb", "perm", "prod", "lcm")


class RefusedError(Exception):
    """The xacro file uses something that is not allowed."""


def refuse_large(size: float, what: str = "length") -> None:
    """Raise RefusedError for a value that is too large; its bound is in `bounds`."""
    refuse_above(what, size, RefusedError)


def size_of(value: Any) -> int:
    """Return the size of a value and of all that it holds [bytes]; raise RefusedError if it is too large."""
    size, left = 0, [value]
    while left:
        one = left.pop()
        size += 36 * len(one) if isinstance(one, range) else sys.getsizeof(one)
        refuse_large(size, "value")
        if isinstance(one, dict):
            left += [part for pair in dict.items(one) for part in pair]
        elif isinstance(one, list | tuple | set | frozenset):
            left += one
    return size


def raised(a: Any, b: Any) -> Any:
    """Return a ** b."""
    if isinstance(a, int) and isinstance(b, int):
        refuse_large(a.bit_length() * b)
    return a**b


def remainder(a: Any, b: Any) -> Any:
    """Return a % b, of a text only with fields of moderate width."""
    if isinstance(a, str):
        if _WIDE_FIELD.search(a):
            raise RefusedError("a field of '%' is too wide")
        refuse_large(a.count("%") * size_of(b), "value")
    return a % b


def repeating(text: str, method: str, *arguments: Any) -> str:
    """Return what `join` or `replace`, which repeat a text, make of it."""
    sizes = (len(one) for one in arguments if not isinstance(one, int))  # an integer counts replacements
    refuse_large(len(text) * sum(sizes), "value")
    return str(getattr(text, method)(*arguments))


def bounded_round(number: Any, ndigits: Any = None) -> Any:
    """Round a number to a moderate number of digits."""
    refuse_large(abs(ndigits or 0))
    return round(number, ndigits)


#: simpleeval's own refuse texts and lists that grow too long, and shifts by too much.
_OPERATORS = {**DEFAULT_OPERATORS, ast.Pow: raised, ast.Mod: remainder}


class Evaluator(EvalWithCompoundTypes):  # type: ignore[misc]
    """Evaluate expressions; an instance is called with an expression and the values of names.

    Args:
        symbols: Names; the functions among them may be called.
        spaces: Types of dictionaries whose elements may be written like attributes.
        budget: Counts the steps, and the sizes of values.

    Attributes:
        has_effects: Whether an expression changed a list, or used a namespace that may change.
    """

    nodes: dict[type, Callable[..., Any]]
    names: Any
    _max_count: int

    def __init__(self, symbols: Mapping[str, Any], spaces: tuple[Any, ...], budget: Budget) -> None:
        super().__init__(_OPERATORS, {}, {})
        self.functions = {name: value for name, value in symbols.items() if callable(value)}
        self.spaces, self.budget, self.has_effects = spaces, budget, False
        self._parsed = cache(self._syntax)  # macros repeat their expressions
        del self.nodes[ast.JoinedStr]  # of any width
        self._plain = self.nodes

    def __call__(self, expression: str, names: Any) -> Any:
        """Return the value of an expression.

        Raises:
            RefusedError: The expression uses something that is not allowed, or exceeds a bound.
            RunawayError: The expansion makes too much.
            Exception: Any error of its operators and functions.
        """
        outer = self.names, self.nodes, self._max_count  # a name may stand for another expression
        self.names, self.nodes = names, dict(self._plain)
        try:
            return self.eval(expression, self._parsed(expression.strip()))
        finally:
            self.names, self.nodes, self._max_count = outer

    def _syntax(self, expression: str) -> ast.expr:
        """Return the syntax tree of an expression."""
        refuse_large(len(expression))
        self.budget.spend("made", SYNTAX * len(expression))
        return ast.parse(expression, "<expression>", "eval").body

    def _eval(self, node: ast.AST) -> Any:
        """Return the value of a node; count it, and all that it holds where it is new."""
        if type(node) not in self.nodes:
            raise RefusedError(f"{type(node).__name__} is not allowed in an expression")
        value = self.nodes[type(node)](node)
        self.budget.spend("made", STEP + READ * (len(value) if isinstance(value, Sized) else 0))
        if isinstance(value, int | str | list | tuple):
            refuse_large(value.bit_length() if isinstance(value, int) else len(value))
        # these are counted already
        return (
            value
            if isinstance(node, ast.Constant | ast.Name | ast.Attribute | ast.Subscript)
            else self._counted(value)
        )

    def _counted(self, value: Any) -> Any:
        """Return a new value, what makes its elements one by one as their list; count its size."""
        if isinstance(value, Iterator):
            value = [self._counted(one) for one in value]
        self.budget.spend("made", size_of(value))
        return value

    def _eval_attribute(self, node: ast.Attribute) -> Any:
        """Return a harmless method, or an element of one of xacro's dictionaries."""
        value, name = self._eval(node.value), node.attr
        self.has_effects |= name == "pop" or hasattr(value, "put")
        if isinstance(value, str) and name in ("join", "replace"):
            return partial(repeating, value, name)
        if any(isinstance(value, kind) and name in methods for kind, methods in _METHODS.items()):
            return getattr(value, name)
        if name.startswith("__") or not isinstance(value, self.spaces):
            raise RefusedError(f"attribute '{name}' is not allowed in an expression")
        if name not in value:
            raise NameError(f"name '{name}' is not defined")
        return value[name]
