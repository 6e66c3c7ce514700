"""The functions that expressions of xacro files may call: xacro's own, the growing ones with a bound."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from .expressions import LARGEST, MOST_BITS, RefusedError

#: Functions of xacro's namespace `python` that look into objects; nobody describes a robot with them.
_INSPECTING = ("type", "vars", "issubclass")

#: Largest argument of the functions of combinatorics: 1000! has 8530 bits.
_MOST_FACTORS = 1000

#: Functions of mathematics whose results grow faster than their arguments are written.
_GROWING = ("factorial", "comb", "perm")

#: Most digits to which a number is rounded.
_MOST_DIGITS = 400


def bounded_range(*arguments: Any) -> range:
    """Return a range that has an end within reach."""
    numbers = range(*arguments)
    if numbers and abs(numbers[-1] - numbers[0]) // abs(numbers.step) >= LARGEST:
        raise RefusedError(f"a range has more than {LARGEST:,} numbers")
    return numbers


def bounded_round(number: Any, ndigits: Any = None) -> Any:
    """Round a number to some digits, as `round` does."""
    if isinstance(ndigits, int) and abs(ndigits) > _MOST_DIGITS:
        raise RefusedError(f"a number is rounded to more than {_MOST_DIGITS} digits")
    return round(number, ndigits)


def bounded_product(values: Any, *, start: Any = 1) -> Any:
    """Multiply numbers, as `math.prod` does."""
    for value in values:
        if not isinstance(value, int | float | complex):
            raise TypeError(f"'{type(value).__name__}' is no number")
        start = start * value
        if isinstance(start, int) and start.bit_length() > MOST_BITS:
            raise RefusedError(f"a whole number is too large: it has more than {MOST_BITS:,} bits")
    return start


def _few(function: Callable[..., Any]) -> Callable[..., Any]:
    """Bound the arguments of a function of combinatorics."""

    def bounded(*numbers: Any) -> Any:
        if any(number > _MOST_FACTORS for number in numbers):
            raise RefusedError(f"an argument of {function.__name__} is larger than {_MOST_FACTORS}")
        return function(*numbers)

    return bounded


def bound_functions(symbols: dict[str, Any], warn: Callable[[str], object]) -> None:
    """Put bounded functions in the place of those in xacro's table of names.

    Args:
        symbols: xacro's table: functions, and the namespaces `python`, `math`, `xacro`.
        warn: Called with xacro's own words on a name that is out of date.
    """

    def old_range(*arguments: Any) -> range:
        warn("Using range() directly is deprecated. Use python.range() instead.")
        return bounded_range(*arguments)

    for name in _INSPECTING:
        dict.pop(symbols["python"], name, None)
    dict.update(symbols["python"], range=bounded_range, round=bounded_round)
    replaced = {"prod": bounded_product, **{name: _few(getattr(math, name)) for name in _GROWING}}
    dict.update(symbols["math"], replaced)
    symbols.update(replaced, range=old_range, round=bounded_round)


def functions_in(*tables: Mapping[str, Any]) -> list[Callable[..., Any]]:
    """Return all functions in tables of names, and in the tables in them."""
    found: list[Callable[..., Any]] = []
    for table in tables:
        for value in dict(table).values():
            if isinstance(value, Mapping):
                found += functions_in(value)
            elif callable(value):
                found.append(value)
    return found
