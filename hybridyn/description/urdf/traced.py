"""Trace which values of an expansion depend on its arguments, so that other arguments need no expansion.

While xacro expands a file, a value that depends on an argument is a `Traced` value, which is computed from
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
_TOKEN = re.compile(f"<!--.*?-->|[<>]|{OPEN}[0-9]+{CLOSE}", re.DOTALL)
#: What is not written as it is, in an attribute, and between elements, where blank texts are left out.
_IN_TAG, _BETWEEN = re.compile(r'[&<>"\r\n\t]'), re.compile(r'[&<>"\r]|\A\s*\Z')


class UntracedError(Exception):
    """The file has to be expanded as a whole."""


class Traced:
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
    return value.value if isinstance(value, Traced) else value


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
        self._values, self._steps = list[Traced](), list[Callable[[], None]]()
        self._parts = list[tuple[str, Traced | None, bool]]()

    def argument(self, name: str) -> str:
        """Return the mark of an argument."""
        return str(self.value(lambda: self._given[name]))

    def value(self, compute: Callable[[], Any]) -> Traced:
        """Return a value that is computed from others."""
        made = Traced(compute, f"{OPEN}{len(self._values)}{CLOSE}")
        self._values.append(made)
        self._steps.append(made.update)
        return made

    def mapped(self, function: Callable[[Any], Any], of: Any) -> Any:
        """Return a function of what may be traced."""
        return self.value(lambda: function(of.value)) if isinstance(of, Traced) else function(of)

    def chosen(self, function: Callable[[Any], Any], of: Any) -> Any:
        """Return a function of what may be traced, by which xacro chooses: a condition says what it is."""
        choice = function(plain(of))

        def check() -> None:
            if function(of.value) != choice:
                raise UntracedError

        if isinstance(of, Traced):
            self._steps.append(check)
        return choice

    def evaluated(self, evaluate: Callable[[str, Names], Any], text: Any, names: Names) -> Any:
        """Return the value of an expression, whose text may be traced, too."""
        value = evaluate(plain(text), names)
        if not any(isinstance(one, Traced) for one in (text, *names.known.values())):
            return value
        names.find = _find_no_more
        return self.value(lambda: evaluate(plain(text), names))

    def joined(self, parts: list[Any]) -> Any:
        """Return the texts of values, one after the other."""
        if not any(isinstance(part, Traced) for part in parts):
            return "".join(map(str, parts))
        return self.value(lambda: "".join(str(plain(part)) for part in parts))

    def unmarked(self, text: str) -> Any:
        """Return a text with values in the place of their marks."""
        if OPEN not in text:
            return text
        split = enumerate(_MARK.split(text))
        return self.joined([self._values[int(word)] if i % 2 else word for i, word in split])

    def finish(self, text: str) -> None:
        """Keep the text of the whole expansion.

        Raises:
            UntracedError: There is a mark in a comment.
        """
        end, in_tag = 0, False
        for token in _TOKEN.finditer(text):
            found = token[0]
            if found[0] == OPEN:
                self._parts.append((text[end : token.start()], self._values[int(found[1:-1])], in_tag))
                end = token.end()
            elif OPEN in found:
                raise UntracedError
            else:
                in_tag = found == "<"
        self._parts.append((text[end:], None, False))

    def text(self) -> str:
        """Return the text of the expansion with the present arguments.

        Raises:
            UntracedError: A value is not written as it is.
        """
        written = list[str]()
        for before, value, in_tag in self._parts:
            after = "" if value is None else str(value.value)
            if value is not None and (_IN_TAG if in_tag else _BETWEEN).search(after):
                raise UntracedError
            written += [before, after]
        return "".join(written)

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
