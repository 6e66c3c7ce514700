"""Evaluate the expressions of xacro files on their syntax tree.

Supported are numbers, texts, lists, tuples, sets, dictionaries, names, operators, conditions, comprehensions,
elements and slices, calls of the given functions, and a list of harmless methods. An attribute is an element
of one of xacro's own dictionaries (`math.pi`, `limits.upper`), never a Python attribute, so classes, frames
and modules cannot be reached. Operations whose results could grow without limit are bounded.
"""

from __future__ import annotations

import ast
import functools
import operator
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Protocol

from .bounds import RefusedError, bounded, refuse_dunder, refuse_growth

#: Longest expression [characters].
LONGEST = 20_000

#: Most elements over which the comprehensions of one robot may iterate.
MOST_STEPS = 10_000_000

_OPERATORS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod, ast.Pow: operator.pow,
    ast.LShift: operator.lshift, ast.RShift: operator.rshift,
    ast.BitOr: operator.or_, ast.BitXor: operator.xor, ast.BitAnd: operator.and_,
    ast.UAdd: operator.pos, ast.USub: operator.neg, ast.Invert: operator.invert, ast.Not: operator.not_,
    ast.Eq: operator.eq, ast.NotEq: operator.ne, ast.Lt: operator.lt, ast.LtE: operator.le,
    ast.Gt: operator.gt, ast.GtE: operator.ge, ast.Is: operator.is_, ast.IsNot: operator.is_not,
    ast.In: lambda a, b: a in b, ast.NotIn: lambda a, b: a not in b,
}  # fmt: skip

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


class Names(Protocol):
    """A mapping from names to values, which raises KeyError for an unknown name."""

    def __getitem__(self, name: str, /) -> Any: ...


class _Inner:
    """The scope of a comprehension: the names of its targets, then those of the enclosing scope."""

    def __init__(self, outer: Names) -> None:
        self.outer, self.own = outer, dict[str, Any]()

    def __getitem__(self, name: str, /) -> Any:
        return self.own[name] if name in self.own else self.outer[name]


class Evaluator:
    """Evaluate expressions; an instance is called with an expression and the values of names.

    Args:
        functions: The functions that may be called; no other object is ever called.
        spaces: Types of dictionaries whose elements may be written like attributes.
    """

    def __init__(self, functions: Iterable[Callable[..., Any]], spaces: tuple[type, ...]) -> None:
        self.functions = {id(function): function for function in functions}
        self.spaces = spaces
        self.steps = 0

    def __call__(self, expression: str, names: Names) -> Any:
        """Return the value of an expression.

        Raises:
            RefusedError: The expression uses something that is not allowed, or exceeds a bound.
            Exception: Any error of its operators and functions.
        """
        return self._value(parsed(expression.strip()), names)

    def _value(self, node: ast.AST, names: Names) -> Any:
        rule = _RULES.get(type(node))
        if rule is None:
            raise RefusedError(f"{type(node).__name__} is not allowed in an expression")
        return rule(self, node, names)

    def _constant(self, node: ast.Constant, names: Names) -> Any:
        if node.value is None or isinstance(node.value, str | bool | int | float | complex):
            return node.value
        raise RefusedError(f"{node.value!r} is not allowed in an expression")

    def _name(self, node: ast.Name, names: Names) -> Any:
        refuse_dunder(node.id)
        try:
            return names[node.id]
        except KeyError:
            raise NameError(f"name '{node.id}' is not defined") from None

    def _unary(self, node: ast.UnaryOp, names: Names) -> Any:
        return _OPERATORS[type(node.op)](self._value(node.operand, names))

    def _binary(self, node: ast.BinOp, names: Names) -> Any:
        left, right = self._value(node.left, names), self._value(node.right, names)
        if type(node.op) not in _OPERATORS:
            raise RefusedError(f"{type(node.op).__name__} is not allowed in an expression")
        refuse_growth(node.op, left, right)
        return bounded(_OPERATORS[type(node.op)](left, right))

    def _boolean(self, node: ast.BoolOp, names: Names) -> Any:
        wanted = isinstance(node.op, ast.Or)
        for part in node.values[:-1]:
            value = self._value(part, names)
            if bool(value) is wanted:
                return value
        return self._value(node.values[-1], names)

    def _compare(self, node: ast.Compare, names: Names) -> Any:
        left = self._value(node.left, names)
        holds: Any = True
        for relation, part in zip(node.ops, node.comparators, strict=True):
            right = self._value(part, names)
            holds = _OPERATORS[type(relation)](left, right)
            if not holds:
                return holds
            left = right
        return holds

    def _choice(self, node: ast.IfExp, names: Names) -> Any:
        return self._value(node.body if self._value(node.test, names) else node.orelse, names)

    def _elements(self, nodes: list[ast.expr], names: Names) -> list[Any]:
        out: list[Any] = []
        for node in nodes:
            if isinstance(node, ast.Starred):
                out += self._value(node.value, names)
            else:
                out.append(self._value(node, names))
        return out

    def _list(self, node: ast.List, names: Names) -> Any:
        return bounded(self._elements(node.elts, names))

    def _tuple(self, node: ast.Tuple, names: Names) -> Any:
        return tuple(bounded(self._elements(node.elts, names)))

    def _set(self, node: ast.Set, names: Names) -> Any:
        return set(self._elements(node.elts, names))

    def _dict(self, node: ast.Dict, names: Names) -> Any:
        out: dict[Any, Any] = {}
        for key, value in zip(node.keys, node.values, strict=True):
            if key is None:
                out.update(self._value(value, names))
            else:
                out[self._value(key, names)] = self._value(value, names)
        return out

    def _subscript(self, node: ast.Subscript, names: Names) -> Any:
        value, index = self._value(node.value, names), self._value(node.slice, names)
        if not isinstance(value, str | list | tuple | dict | range):
            raise TypeError(f"'{type(value).__name__}' has no elements")
        return value[index]

    def _slice(self, node: ast.Slice, names: Names) -> Any:
        ends = (node.lower, node.upper, node.step)
        return slice(*(None if end is None else self._value(end, names) for end in ends))

    def _attribute(self, node: ast.Attribute, names: Names) -> Any:
        value = self._value(node.value, names)
        return self._element(value, node.attr)

    def _element(self, value: Any, name: str) -> Any:
        """Return an element of a dictionary, written like an attribute."""
        refuse_dunder(name)
        if not isinstance(value, self.spaces):
            raise RefusedError(f"attribute '{name}' is not allowed in an expression")
        elements: Any = value
        try:
            return elements[name]
        except KeyError:
            raise NameError(f"name '{name}' is not defined") from None

    def _call(self, node: ast.Call, names: Names) -> Any:
        function = self._called(node.func, names)
        arguments = self._elements(node.args, names)
        named: dict[str, Any] = {}
        for keyword in node.keywords:
            value = self._value(keyword.value, names)
            named.update(value if keyword.arg is None else {keyword.arg: value})
        return bounded(function(*arguments, **named))

    def _called(self, node: ast.expr, names: Names) -> Callable[..., Any]:
        """Return the function or method that is called."""
        if isinstance(node, ast.Attribute):
            value = self._value(node.value, names)
            for kind, methods in _METHODS.items():
                if isinstance(value, kind) and node.attr in methods:
                    return functools.partial(getattr(kind, node.attr), value)
            function = self._element(value, node.attr)
        else:
            function = self._value(node, names)
        allowed = self.functions.get(id(function))
        if allowed is None:
            raise RefusedError(f"'{ast.unparse(node)[:80]}' is not a function that an expression may call")
        return allowed

    def _comprehension(self, node: ast.ListComp | ast.SetComp | ast.GeneratorExp, names: Names) -> Any:
        values = [self._value(node.elt, inner) for inner in self._scopes(node.generators, names)]
        return set(values) if isinstance(node, ast.SetComp) else bounded(values)

    def _dict_comprehension(self, node: ast.DictComp, names: Names) -> Any:
        scopes = self._scopes(node.generators, names)
        return {self._value(node.key, inner): self._value(node.value, inner) for inner in scopes}

    def _scopes(self, generators: list[ast.comprehension], names: Names) -> Iterator[Names]:
        """Yield the scope of each iteration of a comprehension."""
        if not generators:
            yield names
            return
        first, *rest = generators
        for value in self._value(first.iter, names):
            self.steps += 1
            if self.steps > MOST_STEPS:
                raise RefusedError(f"comprehensions run through more than {MOST_STEPS:,} elements")
            inner = _Inner(names)
            _assign(first.target, value, inner.own)
            if all(self._value(condition, inner) for condition in first.ifs):
                yield from self._scopes(rest, inner)


_RULES: dict[type[ast.AST], Callable[[Evaluator, Any, Names], Any]] = {
    ast.Constant: Evaluator._constant, ast.Name: Evaluator._name,
    ast.UnaryOp: Evaluator._unary, ast.BinOp: Evaluator._binary, ast.BoolOp: Evaluator._boolean,
    ast.Compare: Evaluator._compare, ast.IfExp: Evaluator._choice,
    ast.List: Evaluator._list, ast.Tuple: Evaluator._tuple, ast.Set: Evaluator._set,
    ast.Dict: Evaluator._dict,
    ast.Subscript: Evaluator._subscript, ast.Slice: Evaluator._slice, ast.Attribute: Evaluator._attribute,
    ast.Call: Evaluator._call,
    ast.ListComp: Evaluator._comprehension, ast.SetComp: Evaluator._comprehension,
    ast.GeneratorExp: Evaluator._comprehension, ast.DictComp: Evaluator._dict_comprehension,
}  # fmt: skip


@functools.lru_cache(maxsize=4096)
def parsed(expression: str) -> ast.expr:
    """Return the syntax tree of an expression; cached, because macros repeat their expressions."""
    if len(expression) > LONGEST:
        raise RefusedError(f"an expression is longer than {LONGEST:,} characters")
    return ast.parse(expression, "<expression>", "eval").body


def _assign(target: ast.expr, value: Any, names: dict[str, Any]) -> None:
    """Assign a value to the name, or its elements to the names, of a comprehension's target."""
    if isinstance(target, ast.Name):
        refuse_dunder(target.id)
        names[target.id] = value
    elif isinstance(target, ast.Tuple | ast.List):
        values = list(value)
        if len(values) != len(target.elts):
            raise ValueError(f"{len(values)} values for {len(target.elts)} names")
        for inner, one in zip(target.elts, values, strict=True):
            _assign(inner, one, names)
    else:
        raise RefusedError(f"{type(target).__name__} is not allowed in an expression")
