"""Evaluate the expressions of xacro files by simpleeval, which walks their syntax trees and runs no Python.

An attribute is an element of one of xacro's own dictionaries (`math.pi`, `limits.upper`) or a harmless method
of a text, list, tuple or dictionary, never a Python attribute. So classes, frames and modules cannot be
reached. What could grow without limit is bounded before it is computed.
"""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Callable, Mapping
from typing import Any

from simpleeval import DEFAULT_OPERATORS, EvalWithCompoundTypes

#: Most characters or elements of a text or list, bits of an integer (the largest float has 1024), digits of a
#: rounded number, and characters of an expression.
LARGEST = 10_000
#: Most steps of the expressions of one robot; a stack of 1,000 six-legged modules takes some 2 million.
MOST_STEPS = 50_000_000

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
FORBIDDEN = ("type", "vars", "issubclass", "factorial", "comb", "perm", "prod")


class RefusedError(Exception):
    """The xacro file uses something that is not allowed."""


def refuse_large(size: float) -> None:
    """Raise RefusedError for a value that is too large."""
    if size > LARGEST:
        raise RefusedError(f"too large: more than {LARGEST:,} characters, elements, bits or digits")


def raised(a: Any, b: Any) -> Any:
    """Return a ** b."""
    if isinstance(a, int) and isinstance(b, int):
        refuse_large(a.bit_length() * b)
    return a**b


def remainder(a: Any, b: Any) -> Any:
    """Return a % b, of a text only with fields of moderate width."""
    if isinstance(a, str) and _WIDE_FIELD.search(a):
        raise RefusedError("a field of '%' is too wide")
    return a % b


def bounded_range(*arguments: Any) -> range:
    """Return a range of moderate length."""
    numbers = range(*arguments)
    refuse_large(len(numbers))
    return numbers


def bounded_round(number: Any, ndigits: Any = None) -> Any:
    """Round a number to a moderate number of digits."""
    refuse_large(abs(ndigits or 0))
    return round(number, ndigits)


#: simpleeval's own refuse texts and lists that grow too long, and shifts by too much.
_OPERATORS = {**DEFAULT_OPERATORS, ast.Pow: raised, ast.Mod: remainder}


@functools.lru_cache(maxsize=4096)
def parsed(expression: str) -> ast.expr:
    """Return the syntax tree of an expression; cached, because macros repeat their expressions."""
    refuse_large(len(expression))
    return ast.parse(expression, "<expression>", "eval").body


class Evaluator(EvalWithCompoundTypes):  # type: ignore[misc]
    """Evaluate expressions; an instance is called with an expression and the values of names.

    Args:
        symbols: Names; the functions among them may be called.
        spaces: Types of dictionaries whose elements may be written like attributes.

    Attributes:
        steps: Number of steps so far.
        has_effects: Whether an expression changed a list, or used a namespace that may change.
    """

    nodes: dict[type, Callable[..., Any]]
    names: Any
    _max_count: int

    def __init__(self, symbols: Mapping[str, Any], spaces: tuple[type[dict[str, Any]], ...]) -> None:
        super().__init__(_OPERATORS, {}, {})
        self.functions = {name: value for name, value in symbols.items() if callable(value)}
        self.spaces, self.steps, self.has_effects = spaces, 0, False
        del self.nodes[ast.JoinedStr]  # of any width
        self._plain = self.nodes

    def __call__(self, expression: str, names: Any) -> Any:
        """Return the value of an expression.

        Raises:
            RefusedError: The expression uses something that is not allowed, or exceeds a bound.
            Exception: Any error of its operators and functions.
        """
        outer = self.names, self.nodes, self._max_count  # a name may stand for another expression
        self.names, self.nodes = names, dict(self._plain)
        try:
            return self.eval(expression, parsed(expression.strip()))
        finally:
            self.names, self.nodes, self._max_count = outer

    def _eval(self, node: ast.AST) -> Any:
        """Return the value of a node; count it."""
        self.steps += 1
        if self.steps > MOST_STEPS:
            raise RefusedError(f"the expressions take more than {MOST_STEPS:,} steps")
        if type(node) not in self.nodes:
            raise RefusedError(f"{type(node).__name__} is not allowed in an expression")
        value = self.nodes[type(node)](node)
        if isinstance(value, int | str | list | tuple):
            refuse_large(value.bit_length() if isinstance(value, int) else len(value))
        return value

    def _eval_attribute(self, node: ast.Attribute) -> Any:
        """Return a harmless method, or an element of one of xacro's dictionaries."""
        value, name = self._eval(node.value), node.attr
        self.has_effects |= name == "pop" or type(getattr(value, "parent", {})) is not dict
        if any(isinstance(value, kind) and name in methods for kind, methods in _METHODS.items()):
            return getattr(value, name)
        if name.startswith("__") or not isinstance(value, self.spaces):
            raise RefusedError(f"attribute '{name}' is not allowed in an expression")
        if name not in value:
            raise NameError(f"name '{name}' is not defined")
        return value[name]
