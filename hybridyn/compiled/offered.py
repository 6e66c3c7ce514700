"""Methods of the parts of an object, offered as its own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, overload

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


class Offered(Generic[Arguments, Result]):
    """A method of a part; each object looks it up once."""

    def __init__(self, part: str, method: Callable[Concatenate[Any, Arguments], Result]) -> None:
        """Offer a method of the part that is the attribute `part`; help and pages show the method itself."""
        self._part, self._method = part, method

    @overload
    def __get__(self, whole: None, kind: type[Any]) -> Callable[Concatenate[Any, Arguments], Result]: ...
    @overload
    def __get__(self, whole: object, kind: type[Any]) -> Callable[Arguments, Result]: ...
    def __get__(self, whole: object | None, kind: type[Any]) -> Callable[..., Result]:
        if whole is None:
            return self._method
        name = self._method.__name__
        found: Callable[..., Result] = getattr(getattr(whole, self._part), name)
        vars(whole)[name] = found  # every tenth of a microsecond counts
        return found
