"""Check that the arguments of effects and payloads from Python have the form of their annotations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from ..errors import ModelError


def check_form(effect: Any) -> None:
    """Check the arguments of an effect of this package.

    Raises:
        ModelError: One has another form; the message names effect, argument and form.
    """
    kind: Any = type(effect)
    hints = _hints(kind)
    for name in (field.name for field in fields(effect) if field.init) if is_dataclass(effect) else ():
        value, hint = getattr(effect, name), hints[name]
        if not _fits(value, hint):
            form = "be a number" if hint is float else f"have the form {_example(hint)}"
            raise ModelError(f"{effect.name}: {name} must {form}, not {value!r:.80}", element=name)


@cache
def _hints(kind: type) -> dict[str, Any]:
    """Return the annotations of a class."""
    return get_type_hints(kind)


def _fits(value: Any, hint: Any) -> bool:
    """Return whether a value has a form."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return any(_fits(value, one) for one in inner)
    if hint is float:
        return np.ndim(value) == 0 and _is_array(value) and not isinstance(value, bool)
    if origin is np.ndarray:
        return _is_array(value)
    if origin is Mapping:
        return isinstance(value, Mapping) and all(
            _fits(k, inner[0]) and _fits(x, inner[1]) for k, x in value.items()
        )
    if origin in (Sequence, tuple):
        listed = isinstance(value, Sequence | np.ndarray) and not isinstance(value, str)
        return listed and all(_fits(x, inner[0]) for x in value)
    return isinstance(value, hint)


def _is_array(value: Any) -> bool:
    """Return whether NumPy makes an array of numbers of a value."""
    try:
        return np.asarray(value).dtype.kind in "fiu"
    except ValueError:
        return False


def _example(hint: Any) -> str:
    """Return an example of a form, as Python writes it."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        return _example(inner[0])
    if origin is Mapping:
        return f"{{'name': {_example(inner[1])}}}"
    if origin in (Sequence, tuple):
        return f"[{_example(inner[0])}, ...]"
    if origin is np.ndarray:
        return "[1.0, ...]"
    return "1.0" if hint is float else "'name'"
