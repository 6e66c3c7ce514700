"""How tests compare numbers and refusals, and the tolerances that more than one of them uses."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from hybridyn.errors import HybridynError

ROUNDING = 1e-13  # a few hundred operations on numbers of one size
SOLVED = 1e-11  # the same after solving with matrices of condition up to some hundreds


def arrays(result: Any) -> Iterator[np.ndarray]:
    """Yield the arrays and numbers of a result, whatever tuples, dictionaries and records hold them."""
    if isinstance(result, Mapping):
        result = tuple(result[name] for name in sorted(result))
    if hasattr(result, "__dataclass_fields__"):
        result = tuple(getattr(result, name) for name in result.__dataclass_fields__)
    if isinstance(result, tuple):
        for part in result:
            yield from arrays(part)
    elif not isinstance(result, str | type(None)):
        yield np.asarray(result)


def close_to(actual: Any, expected: Any, tolerance: float, least: float = 1e-300) -> None:
    """Compare each array of a result relative to its largest entry, or to `least` where that is smaller."""
    for one, other in zip(arrays(actual), arrays(expected), strict=True):
        scale = max(np.abs(other).max(initial=0.0), least)
        assert np.abs(np.asarray(one, float) - other).max(initial=0.0) <= tolerance * scale


def same_bits(actual: Any, expected: Any) -> None:
    """Compare two results bit by bit."""
    for one, other in zip(arrays(actual), arrays(expected), strict=True):
        np.testing.assert_array_equal(one, other)


def refused(call: Callable[[], Any], error: type[Exception], words: str, **data: Any) -> Any:
    """Check that a call raises an error with these words (a pattern) and attributes; return the error.

    An error of the package is one line.
    """
    with pytest.raises(error, match=words or None) as caught:
        call()
    assert {name: getattr(caught.value, name) for name in data} == data
    assert "\n" not in str(caught.value) or not isinstance(caught.value, HybridynError)
    return caught.value


def same_words(call: Callable[[], Any], wanted: Callable[[], Any]) -> str:
    """Check that two calls are refused by the same error in the same words; return them."""
    errors = []
    for one in (wanted, call):
        with pytest.raises(HybridynError) as caught:
            one()
        errors.append(f"{type(caught.value).__name__}: {caught.value}")
    assert errors[1] == errors[0]
    return errors[0]
