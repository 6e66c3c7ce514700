"""Evaluate the texts of one xacro file: `${...}`, `$(...)`, and what expressions know.

Values that depend on arguments are traced (`traced`), and expressions run no Python (`expressions`).
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

from ..shipped import shown
from .elements import Tag
from .expressions import Evaluator, size_of
from .robot_folders import RobotFolders
from .scopes import Fields, Scope, known, literal, truth, yaml_of
from .traced import OPEN, Names, Trace, TracedValue, UntracedError, plain

#: Truth values of arguments, and in every `$(eval ...)`.
TRUTHS = {"true": True, "false": False}
#: What count a text that is evaluated, a character of YAML, and a note [bytes]: they take time.
TEXT, YAML, NOTE = 75, 500, 10_000

#: What errors without a message mean.
IN_WORDS: dict[type[BaseException], str] = {
    MemoryError: "needs too much memory", RecursionError: "macros or includes call themselves without end",
}  # fmt: skip
#: A part of a text: an escaped bracket, an expression, `$(...)`, or any other text.
_PART = re.compile(
    r"(?P<escaped>\$\$+[{(])|(?P<expression>\$\{[^}]*\})|(?P<dollar>\$\([^)]*\))|[^$]+|\$[^{($]+|\$$"
)


class Texts:
    """Evaluates the texts of one robot.

    Args:
        folders: The robot's folders.
        given: Values of arguments by name.
        traced: Whether what depends on them is traced.

    Attributes:
        trace: What depends on the arguments.
        notes: What xacro warns of.
        symbols: What every file knows.
        asked: Arguments for which the files ask.
        at: The element that is evaluated.
        files: The file that is read, behind those that include it.
    """

    def __init__(self, folders: RobotFolders, given: Mapping[str, str], *, traced: bool) -> None:
        self.folders, self.trace, self._traced = folders, Trace(given), traced
        self._arguments = {name: self.trace.argument(name) for name in given} if traced else dict(given)
        self.notes, self.asked = list[str](), dict[str, None]()
        self.at: Tag | None = None
        self.files, self.budget = [folders.file], folders.budget
        own = {"load_yaml": self._yaml, "abs_filename": self.absolute}
        self.symbols, spaces = known(own, self._untraced, self.note), (Scope, Fields)
        self._expressions = Evaluator(self.symbols, spaces, self.budget)
        of_files = {"find": partial(folders.ask, "find"), "arg": self._converted}
        self._of_eval = Evaluator({**self.symbols, **of_files}, spaces, self.budget)

    def value(self, text: str, scope: Scope) -> Any:
        """Return what a text says: a number, a truth value, a text, or any value of an expression."""
        return self.trace.mapped(literal, self.text(text, scope))

    def put(self, scope: Scope, name: str, value: Any, *, lazy: bool = False) -> None:
        """Set a name of a scope; the arguments are those of `Scope.put`."""
        if name in self.symbols:
            self.note(f"redefining global symbol: {name}")
        scope.put(name, self.trace.mapped(literal, value), lazy=lazy)

    def holds(self, text: str, scope: Scope) -> bool:
        """Return whether a condition is true."""
        return bool(self.trace.chosen(lambda value: truth(value, text), self.text(text, scope)))

    def text(self, text: str, scope: Scope) -> Any:
        """Return the value of a text with expressions, which is a text unless it is one expression alone."""
        self.budget.spend("made", TEXT + len(text))
        if "$" not in text:
            return self.trace.unmarked(text)
        found, at = list[Any](), 0
        while at < len(text):
            part = _PART.match(text, at)
            if part is None:
                raise ValueError(f"invalid expression: {text[at:]}")
            at = part.end()
            found.append(self._part(part[0], part.lastgroup, scope))
            self.budget.spend("made", size_of(plain(found[-1])))
        return found[0] if len(found) == 1 else self.trace.joined(found)

    def _part(self, text: str, kind: str | None, scope: Scope) -> Any:
        """Return the value of a part of a text."""
        if kind == "expression":
            try:
                return self._evaluated(self.text(text[2:-1], scope), scope)
            except Exception as error:
                error.__dict__.setdefault("evaluated", text[2:-1])
                raise
        if kind == "dollar":
            return self.trace.unmarked(self._dollar(str(self.text(text[2:-1], scope))))
        return text[1:] if kind == "escaped" else self.trace.unmarked(text)

    def _evaluated(self, text: Any, scope: Scope) -> Any:
        """Return the value of an expression; if it is traced, it has had no effects."""
        before = len(self.notes), len(self.folders.replies)
        value = self.trace.evaluated(self._expressions, text, Names(scope.__getitem__))
        effects = self._expressions.has_effects or before != (len(self.notes), len(self.folders.replies))
        if isinstance(value, TracedValue) and effects:
            raise UntracedError
        return value

    def _dollar(self, inner: str) -> str:
        """Return the value of `$(...)`."""
        if inner.startswith("eval "):
            return self._of_dollar(inner.removeprefix("eval "))
        command, *words = inner.split() or [""]
        if command == "find" and len(words) == 1:
            return str(self.folders.ask("find", words[0]))
        if command == "arg" and len(words) == 1:
            if words[0] not in self._arguments:
                raise ValueError(f"undefined argument '{words[0]}'")
            value = self._argument(words[0])
            return re.sub(r"\$\(find ([^)]*)\)", lambda part: str(self.folders.ask("find", part[1])), value)
        if command == "optenv" and words:
            return " ".join(words[1:])
        if command == "env" and len(words) == 1:
            raise ValueError(f"environment variable '{words[0]}' is not set; a robot file has no environment")
        if inner == "cwd":
            return os.getcwd()
        raise ValueError(f"$({inner}) is not read; known: $(find PACKAGE), $(arg NAME), $(eval ...), $(cwd)")

    def _of_dollar(self, expression: str) -> str:
        """Return the value of `$(eval ...)`: it knows the arguments and the names of `math`."""
        if OPEN in expression:
            raise UntracedError
        constants = {name: x for name, x in self.symbols["math"].items() if not callable(x)} | TRUTHS
        names = Names(lambda name: constants[name] if name in constants else self._converted(name))
        return str(self._of_eval(expression, names))

    def declare(self, name: str, default: str, scope: Scope) -> None:
        """Declare an argument."""
        self.asked[name] = None
        if name not in self._arguments:
            self._arguments[name] = str(self.text(default, scope))

    def _argument(self, name: str) -> str:
        """Return an argument as text."""
        self.asked[name] = None
        return self._arguments[name]

    def _untraced(self, name: str) -> str:
        """Return an argument in an expression."""
        value = self._argument(name)
        if OPEN in value:
            raise UntracedError
        return value

    def _converted(self, name: str) -> Any:
        """Return an argument in `$(eval ...)`: a number, a truth value, or a text."""
        value = self._untraced(name)
        for read in (float if "." in value else int, TRUTHS.__getitem__):
            try:
                return read(value.lower())
            except (ValueError, KeyError):
                pass
        return value

    def note(self, *words: Any, **_: Any) -> str:
        """Keep a message as a note."""
        if self.folders.closed:
            raise UntracedError
        file, line = self.at.place if self.at else ("", 0)
        where = f"{file or shown(Path(self.folders.file))}:{line}: " if line else ""
        self.budget.spend("made", NOTE)
        self.notes.append(f"{where}xacro: " + " ".join(" ".join(map(str, words)).split()))
        return ""

    def absolute(self, path: str) -> str:
        """Return a path from the folder of the present file."""
        return os.path.join(os.path.dirname(self.files[-1]), path)

    def content(self, path: str) -> bytes:
        """Return the content of a file."""
        content: bytes = self.folders.ask("read", path)
        if self._traced and OPEN.encode() in content:
            raise UntracedError
        return content

    def _yaml(self, name: str) -> Any:
        """Return what a YAML file says."""
        path = self.absolute(name)
        content = self.content(path)
        counts = f"of {len(content) / 1e6:.2f} MB counts {YAML} times its size, each time it is read"
        mend = f"the YAML file {shown(Path(path))} {counts}: take out what the robot does not need"
        self.budget.spend("made", YAML * len(content), mend=mend)
        return yaml_of(content, lambda text: self._expressions(text, self.symbols))


def described(error: BaseException) -> str:
    """Return the message of a Python error in words for the author of a robot file."""
    if isinstance(error, OSError) and error.filename:
        return f"{error.strerror}: {error.filename}"
    own = getattr(error, "message", None) or getattr(error, "msg", None)  # of ModelError and SyntaxError
    return IN_WORDS.get(type(error)) or own or str(error) or type(error).__name__
