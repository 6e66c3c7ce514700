"""Trace which values of an expansion depend on its arguments, so that other arguments need no expansion.

While xacro expands a file, a value that depends on an argument is a `TracedValue`, which is computed from
others; xacro writes its mark in its place. What xacro chooses by such a value is a condition. With other
arguments the values are computed again in the same order, and replace their marks in the text. Where a
condition changes, or a value is used in a way that is not foreseen here, `UntracedError` says that the file
has to be expanded as a whole.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

#: Characters around the number of a value in its mark; they are for private use, and robot files have none.
OPEN, CLOSE = "\ue000", "\ue001"

_MARK = re.compile(f"{OPEN}([0-9]+){CLOSE}")
#: A mark in a comment, and a value that is written as it is, wherever it stands.
_IN_COMMENT = re.compile(f"<!--[^>]*{OPEN}")
_PLAIN = re.compile(r"""[^&<>"\r\n\t]*[^&<>"\s][^&<>"\r\n\t]*""")


class UntracedError(Exception):
    """The file has to be expanded as a whole."""


class TracedValue:
    """A value that depends on the arguments.

    Attributes:
        value: The value with the present arguments.
    """

    def __init__(self, compute: Callable[[], Any], mark: str) -> None:
        self._compute, self._mark = compute, mark
        self.update()

    def update(self) -> None:
        """Compute the value with the present arguments.

        Raises:
            UntracedError: xacro would evaluate it once more.
        """
        self.value = self._compute()
        if isinstance(self.value, str) and ("$" in self.value or OPEN in self.value):
            raise UntracedError

    def __str__(self) -> str:
        return self._mark

    def __bool__(self) -> NoReturn:
        raise UntracedError

    def __eq__(self, _: object) -> NoReturn:
        raise UntracedError

    __hash__ = None  # type: ignore[assignment]


def plain(value: Any) -> Any:
    """Return the present value of what may be traced."""
    return value.value if isinstance(value, TracedValue) else value


class Names:
    """The values of the names in an expression, as they are when it is evaluated first."""

    def __init__(self, find: Callable[[str], Any]) -> None:
        self.find, self.known = find, dict[str, Any]()

    def __getitem__(self, name: str) -> Any:
        if name not in self.known:
            self.known[name] = self.find(name)
        return plain(self.known[name])


class Trace:
    """The values and conditions of an expansion that depend on its arguments, in their order."""

    def __init__(self, given: Mapping[str, str]) -> None:
        self._given = given
        self._values, self._steps = list[TracedValue](), list[Callable[[], None]]()
        self._parts = list[str]()

    def argument(self, name: str) -> str:
        """Return the mark of an argument."""
        return str(self.value(lambda: self._given[name]))

    def value(self, compute: Callable[[], Any]) -> TracedValue:
        """Return a value that is computed from others."""
        made = TracedValue(compute, f"{OPEN}{len(self._values)}{CLOSE}")
        self._values.append(made)
        self._steps.append(made.update)
        return made

    def mapped(self, function: Callable[[Any], Any], of: Any) -> Any:
        """Return a function of what may be traced."""
        return self.value(lambda: function(of.value)) if isinstance(of, TracedValue) else function(of)

    def chosen(self, function: Callable[[Any], Any], of: Any) -> Any:
        """Return a function of what may be traced, by which xacro chooses: a condition says what it is."""
        choice = function(plain(of))

        def check() -> None:
            if function(of.value) != choice:
                raise UntracedError

        if isinstance(of, TracedValue):
            self._steps.append(check)
        return choice

    def evaluated(self, evaluate: Callable[[str, Names], Any], text: Any, names: Names) -> Any:
        """Return the value of an expression, whose text may be traced, too."""
        value = evaluate(plain(text), names)
        if not any(isinstance(one, TracedValue) for one in (text, *names.known.values())):
            return value
        names.find = _find_no_more
        return self.value(lambda: evaluate(plain(text), names))

    def joined(self, parts: list[Any]) -> Any:
        """Return the texts of values, one after the other."""
        if not any(isinstance(part, TracedValue) for part in parts):
            return "".join(map(str, parts))
        return self.value(lambda: "".join(str(plain(part)) for part in parts))

    def unmarked(self, text: str) -> Any:
        """Return a text with values in the place of their marks."""
        if OPEN not in text:
            return text
        split = enumerate(_MARK.split(text))
        return self.joined([self._values[int(word)] if i % 2 else word for i, word in split])

    def text(self, whole: str = "") -> str:
        """Return the text of the expansion with the present arguments.

        Args:
            whole: The text of the whole expansion, with marks, where it is new.

        Raises:
            UntracedError: A value is not written as it is, or there is a mark in a comment.
        """
        if _IN_COMMENT.search(whole):
            raise UntracedError
        self._parts = _MARK.split(whole) if whole else self._parts
        return "".join([self._written(word) if i % 2 else word for i, word in enumerate(self._parts)])

    def _written(self, number: str) -> str:
        """Return the value of a mark as text."""
        text = str(self._values[int(number)].value)
        if not _PLAIN.fullmatch(text):
            raise UntracedError
        return text

    def again(self, given: Mapping[str, str]) -> str:
        """Return the text of the expansion with other arguments.

        Raises:
            UntracedError: It is another one.
            Exception: Any error of an expression.
        """
        self._given = given
        for step in self._steps:
            step()
        return self.text()


def _find_no_more(_: str) -> NoReturn:
    raise UntracedError
