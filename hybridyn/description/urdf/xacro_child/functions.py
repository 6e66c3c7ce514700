"""Define the functions that xacro expressions may call: xacro's own, with bounds on growing results."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from .bounds import LARGEST, MOST_BITS, RefusedError

#: Functions of xacro's namespace `python` that inspect objects; a robot file does not need them.
_INSPECTING = ("type", "vars", "issubclass")

#: Largest argument of combinatorial functions: 1000! has 8530 bits.
_MOST_FACTORS = 1000

#: Mathematical functions with short arguments and very large results.
_GROWING = ("factorial", "comb", "perm")

#: Most digits to which a number is rounded.
_MOST_DIGITS = 400


def bounded_range(*arguments: Any) -> range:
    """Return a range, as `range` does; raise RefusedError if it is too long."""
    numbers = range(*arguments)
    if numbers and abs(numbers[-1] - numbers[0]) // abs(numbers.step) >= LARGEST:
        raise RefusedError(f"a range has more than {LARGEST:,} numbers")
    return numbers


def bounded_round(number: Any, ndigits: Any = None) -> Any:
    """Round a number, as `round` does; raise RefusedError for too many digits."""
    if isinstance(ndigits, int) and abs(ndigits) > _MOST_DIGITS:
        raise RefusedError(f"a number is rounded to more than {_MOST_DIGITS} digits")
    return round(number, ndigits)


def bounded_product(values: Any, *, start: Any = 1) -> Any:
    """Multiply numbers, as `math.prod` does; raise RefusedError if an integer grows too large."""
    for value in values:
        if not isinstance(value, int | float | complex):
            raise TypeError(f"'{type(value).__name__}' is not a number")
        start = start * value
        if isinstance(start, int) and start.bit_length() > MOST_BITS:
            raise RefusedError(f"a whole number is too large: it has more than {MOST_BITS:,} bits")
    return start


def _few(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a combinatorial function that raises RefusedError for too large arguments."""

    def bounded(*numbers: Any) -> Any:
        """Call the function, unless an argument is too large."""
        if any(number > _MOST_FACTORS for number in numbers):
            raise RefusedError(f"an argument of {function.__name__} is larger than {_MOST_FACTORS}")
        return function(*numbers)

    return bounded


def bound_functions(symbols: dict[str, Any], warn: Callable[[str], object]) -> None:
    """Replace the functions in xacro's table of names by bounded ones.

    Args:
        symbols: xacro's table: functions, and the namespaces `python`, `math`, `xacro`.
        warn: Called with xacro's message about a deprecated name.
    """

    def old_range(*arguments: Any) -> range:
        """Warn of the deprecated name."""
        warn("Using range() directly is deprecated. Use python.range() instead.")
        return bounded_range(*arguments)

    for name in _INSPECTING:
        dict.pop(symbols["python"], name, None)
    dict.update(symbols["python"], range=bounded_range, round=bounded_round)
    replaced = {"prod": bounded_product, **{name: _few(getattr(math, name)) for name in _GROWING}}
    dict.update(symbols["math"], replaced)
    symbols.update(replaced, range=old_range, round=bounded_round)


def functions_in(*tables: Mapping[str, Any]) -> list[Callable[..., Any]]:
    """Return all functions in tables of names and in their nested tables."""
    found: list[Callable[..., Any]] = []
    for table in tables:
        for value in dict(table).values():
            if isinstance(value, Mapping):
                found += functions_in(value)
            elif callable(value):
                found.append(value)
    return found
