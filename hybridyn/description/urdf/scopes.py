"""The names of a xacro file: scopes, which evaluate lazily, and what every file knows."""

from __future__ import annotations

import builtins
import keyword
import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from .expressions import FORBIDDEN, bounded_round

#: Functions of Python that a file has by their names, and those that it has by `python.NAME` alone.
_BUILTINS = "list dict map len str float int bool min max round range sorted"
_OF_PYTHON = (
    "abs all any complex divmod enumerate filter frozenset hash isinstance ord repr reversed slice set sum "
    "tuple zip"
)
#: Units that numbers of YAML may have.
UNITS = {
    "!radians": 1.0, "!degrees": math.pi / 180.0, "!meters": 1.0, "!millimeters": 0.001, "!foot": 0.3048,
    "!inches": 0.0254,
}  # fmt: skip


class Fields(dict[str, Any]):
    """A dictionary whose elements expressions may write like attributes."""


class Scope:
    """The names of a file, a macro or a name space; what it lacks is that of the scope around it.

    Args:
        around: The scope around it, or what every file knows.
        evaluate: Returns the value of a text in a scope.
        is_space: Whether it is a name space, of an included file.
    """

    def __init__(
        self,
        around: Scope | Mapping[str, Any],
        evaluate: Callable[[str, Scope], Any],
        *,
        is_space: bool = False,
    ) -> None:
        self.around, self.is_space, self._evaluate = around, is_space, evaluate
        self._own = dict[str, Any]()
        self._lazy, self._resolving = set[str](), list[str]()

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self.around

    def __getitem__(self, name: str) -> Any:
        if name not in self._own:
            return self.around[name]
        if name in self._lazy:
            if name in self._resolving:
                circle = " -> ".join([*self._resolving, name])
                raise ValueError(f'circular variable definition: {circle}; write lazy_eval="false"')
            self._resolving.append(name)
            self._own[name] = self._evaluate(self._own[name], self)
            self._resolving.pop()
            self._lazy.remove(name)
        return self._own[name]

    def put(self, name: str, value: Any, *, lazy: bool = False) -> None:
        """Set a name; a text may be evaluated where it is first used."""
        self._own[name] = value
        (self._lazy.add if lazy and isinstance(value, str) else self._lazy.discard)(name)

    def remove(self, name: str) -> None:
        """Remove a name, here and in all scopes around."""
        scope: Scope | Mapping[str, Any] = self
        while isinstance(scope, Scope):
            scope._own.pop(name, None)
            scope = scope.around

    def outermost(self) -> Scope:
        """Return the scope of the file."""
        scope = self
        while isinstance(scope.around, Scope):
            scope = scope.around
        return scope

    def caller(self) -> Scope | None:
        """Return the scope around it, that of a macro beyond all name spaces; None for that of the file."""
        scope = self.around
        while isinstance(scope, Scope) and scope.is_space and not self.is_space:
            scope = scope.around
        return scope if isinstance(scope, Scope) else None


def literal(value: Any) -> Any:
    """Return what a text says: a quoted text, a number, a truth value, or the text itself."""
    if not isinstance(value, str):
        return value
    if len(value) >= 2 and value[0] == value[-1] == "'":
        return value[1:-1]
    for read in (int, float, truth) if "_" not in value else ():
        try:
            return read(value)
        except ValueError:
            pass
    return value


def truth(value: Any, stated: str = "") -> bool:
    """Return whether a value is true; `stated` is the condition as it is written."""
    if value in ("true", "True", "false", "False"):
        return value in ("true", "True")
    try:
        return bool(int(value) if isinstance(value, str) else value)
    except ValueError:
        raise ValueError(
            f'Xacro conditional "{stated}" evaluated to "{value}", which is not a boolean expression.'
        ) from None


def is_name(text: str) -> bool:
    """Return whether a property may have a name."""
    return text.isidentifier() and not keyword.iskeyword(text) and not text.startswith("__")


def dotted(value: Any) -> Any:
    """Return dictionaries, also those in lists and dictionaries, as fields."""
    if isinstance(value, dict):
        return Fields({key: dotted(one) for key, one in value.items()})
    return [dotted(one) for one in value] if isinstance(value, list) else value


def yaml_of(content: bytes, evaluate: Callable[[str], Any]) -> Any:
    """Return what a YAML file says; numbers with units are expressions, which `evaluate` takes."""
    import yaml  # few xacro files load YAML

    class Loader(yaml.SafeLoader):
        """Makes fields, which share the parts that aliases name."""

    def fields(loader: Loader, node: Any) -> Any:
        made = Fields()
        yield made
        made.update({str(name): value for name, value in loader.construct_mapping(node).items()})

    def number(loader: Loader, node: Any, unit: float) -> float:
        return float(evaluate(loader.construct_scalar(node))) * unit

    Loader.add_constructor("tag:yaml.org,2002:map", fields)
    for tag, unit in UNITS.items():
        Loader.add_constructor(tag, partial(number, unit=unit))
    return yaml.load(content, Loader)


def tokens(text: str, sep: str = ",; ", skip_empty: bool = True) -> list[str]:
    """Return the parts of a text between the characters of `sep`."""
    parts = re.split(f"[{sep}]", text)
    return [part for part in parts if part] if skip_empty else parts


def known(
    files: Mapping[str, Callable[..., Any]], argument: Callable[[str], str], note: Callable[..., str]
) -> dict[str, Any]:
    """Return the names that every file knows: functions of Python and `math`, and xacro's own.

    Args:
        files: Functions that read files.
        argument: Returns an argument.
        note: Takes messages.
    """

    def failing(*words: Any) -> None:
        raise ValueError(" ".join(map(str, words)))

    python = {name: getattr(builtins, name) for name in f"{_BUILTINS} {_OF_PYTHON}".split()}
    python["round"] = bounded_round
    of_math = {name: value for name, value in vars(math).items() if name[0] != "_" and name not in FORBIDDEN}
    of_files = {**files, "dotify": dotted}
    of_xacro = {
        **of_files, "arg": argument, "message": note, "warning": note, "error": note, "fatal": failing,
        "tokenize": tokens, "print_location": lambda *_, **__: "",
    }  # fmt: skip
    spaces = {"python": Fields(python), "math": Fields(of_math), "xacro": Fields(of_xacro)}
    return {**of_files, **of_math, **{name: python[name] for name in _BUILTINS.split()}, **spaces}
