"""Expand one file by the package xacro, in a copy of our own, since it keeps its state in its modules.

Replaced in it are how it evaluates texts, whose values are traced (`traced`), and expressions
(`expressions`), and how it reads files (`robot_folders`), whose elements get a `PLACE`.
"""

from __future__ import annotations

import importlib.util
import io
import itertools
import os
import sys
from collections.abc import Iterable, Mapping
from functools import cache, partial
from pathlib import Path
from traceback import walk_stack, walk_tb
from types import FrameType, SimpleNamespace
from typing import Any, NoReturn, cast
from xml.dom.expatbuilder import ExpatBuilderNS
from xml.dom.minidom import Element

from ...errors import ModelError
from ..bounds import Budget, RunawayError
from ..shipped import shown
from .expressions import FORBIDDEN, Evaluator, bounded_round, size_of
from .robot_folders import RobotFolders
from .traced import OPEN, Names, Trace, TracedValue, UntracedError, plain
from .xml_node import DOCTYPE, PLACE

#: What errors without a message mean.
IN_WORDS: dict[type[BaseException], str] = {
    MemoryError: "needs too much memory", RecursionError: "macros or includes call themselves without end",
}  # fmt: skip
#: Names of every `$(eval ...)`.
CONSTANTS = {"true": True, "false": False}
#: What an element, text or comment, and an attribute take in xacro's document [bytes].
NODE, ATTRIBUTE = 400, 500
#: What count a macro or block that is replaced, a node that is moved, or passed in a search, a text that is
#: evaluated, a character of YAML, and a note [bytes]: they take time.
REPLACED, MOVED, PASSED, TEXT, YAML, NOTE = 1000, 8, 2, 75, 500, 10_000


class Expansion:
    """One expansion, with which the functions of our copy of xacro are connected.

    Attributes:
        text: The text of the expansion.
        trace: What depends on the arguments, if the expansion is traced.
        notes: xacro's warnings.
        folders: The robot's folders, which know what was asked of them.
        evaluator: Evaluates expressions.
    """

    def __init__(self, file: str, folders: RobotFolders, given: Mapping[str, str], *, traced: bool) -> None:
        """Expand a file.

        Raises:
            UntracedError: It cannot be traced.
            ModelError: xacro reports an error.
            RunawayError: The expansion makes too much.
        """
        self.folders, self.notes, self.trace, self._traced = folders, list[str](), Trace(given), traced
        self._given = _Arguments({name: self.trace.argument(name) for name in given} if traced else given)
        self._budget, self._lexed = folders.budget, cache(_lexed)
        xacro = self._xacro = _own_xacro()
        dollar, symbols, find = xacro.substitution_args, xacro._global_symbols, partial(folders.ask, "find")
        dict.update(
            symbols["xacro"], message=self._note, warning=self._note, error=self._note,
            print_location=lambda *_, **__: "", arg=self._argument,
        )  # fmt: skip
        spaces = xacro.NameSpace, xacro.YamlDictWrapper
        self.evaluator = Evaluator(symbols, spaces, self._budget)
        self._of_arguments = Evaluator({**symbols, "find": find}, spaces, self._budget)
        xacro.eval_text, xacro.safe_eval = self._text, lambda text, names: self.evaluator(text, names)
        xacro.Table._eval_literal = staticmethod(partial(self.trace.mapped, xacro.literal))
        xacro.get_boolean_value = lambda value, stated: self.trace.chosen(
            lambda one: xacro.boolean(one, stated), value
        )
        xacro.parse, xacro.abs_filename_spec, xacro.replace_node = self._parsed, self._located, self._insert
        xacro.open = self._opened
        xacro.glob, xacro.root_dir = SimpleNamespace(glob=_refuse_pattern), os.getcwd()
        xacro.warning, xacro.print_location = self._note, lambda: None
        dollar._eval, dollar._eval_find = self._of_dollar, find

        try:
            document = xacro.process_file(folders.file, mappings=self._given, verbosity=0)
            for name in given:
                if name not in self._given.asked:  # xacro itself would ignore it
                    declared = ", ".join(f"'{known}'" for known in self._given.asked) or "none"
                    raise ModelError(f"there is no argument '{name}'; the file's arguments: {declared}")
            # each element on its own line
            text: str = document.toprettyxml(indent="", encoding="utf-8").decode()
        except Exception as error:
            raise _failure(xacro, error, file) from None
        finally:
            folders.closed = True
        self.text = self.trace.text(text) if traced else text

    def again(self, given: Mapping[str, str]) -> str:
        """Return the text of the expansion with other arguments of the same names.

        Raises:
            UntracedError: xacro has to expand the file.
            Exception: Any error of an expression.
        """
        self._budget.restart("made")
        return self.trace.again(given)

    def _note(self, *words: Any, **_: Any) -> str:
        """Keep a message of xacro as a note."""
        if self.folders.closed:
            raise UntracedError
        file, line = _place_in(walk_stack(None)) or ("", 0)
        where = f"{file or shown(Path(self.folders.file))}:{line}: " if line else ""
        self._budget.spend("made", NOTE)
        self.notes.append(f"{where}xacro: " + " ".join(" ".join(map(str, words)).split()))
        return ""

    def _parsed(self, _: None, filename: str) -> Any:
        """Parse a file."""
        try:
            content = self.folders.ask("read", filename)
        except OSError as error:
            self._xacro.filestack.pop()
            raise self._xacro.XacroException(exc=error) from None
        if self._traced and OPEN.encode() in content:
            raise UntracedError
        self._budget.spend("made", len(content) + NODE * content.count(b"<"))  # tags, comments and texts
        file = "" if filename == self.folders.file else shown(Path(filename))
        return _Placing(file, self._budget).parseString(content)

    def _opened(self, path: str) -> io.TextIOBase:
        """Open a file of YAML."""
        content = self.folders.ask("read", path)
        counts = f"of {len(content) / 1e6:.2f} MB counts {YAML} times its size, each time it is read"
        mend = f"the YAML file {shown(Path(path))} {counts}: take out what the robot does not need"
        self._budget.spend("made", YAML * len(content), mend=mend)
        return io.TextIOWrapper(io.BytesIO(content), encoding="utf-8")

    def _located(self, stated: Any) -> str:
        """Return the path of an included file."""
        name = self.trace.chosen(str, stated)
        package, _, rest = name.removeprefix("package://").partition("/")
        is_uri = name.startswith("package://")
        return str(
            os.path.join(self.folders.ask("find", package), rest) if is_uri else self._xacro.absolute(name)
        )

    def _insert(self, node: Any, by: Any, content_only: bool = False) -> None:
        """Replace a node by other nodes, or by their children, in time linear in their number.

        xacro's own function inserts them one by one and searches the parent's list each time, which is
        quadratic: with it, a stack of 100 modules takes 25 s.
        """
        sources = [] if by is None else by if isinstance(by, list) else [by]
        new = [child for source in sources for child in source.childNodes] if content_only else sources
        siblings = node.parentNode.childNodes
        self._budget.spend("made", REPLACED + PASSED * len(siblings) + MOVED * len(new))
        index = siblings.index(node)
        siblings[index : index + 1] = new
        for left, right in itertools.pairwise([node.previousSibling, *new, node.nextSibling]):
            if left is not None:
                left.nextSibling = right
            if right is not None:
                right.previousSibling = left
        for child in new:
            child.parentNode = node.parentNode
        node.parentNode = node.previousSibling = node.nextSibling = None

    def _argument(self, name: str) -> str:
        """Return the value of an argument in an expression."""
        if OPEN in self._given[name]:
            raise UntracedError
        return self._given[name]

    def _of_dollar(self, expression: str, context: Mapping[str, Mapping[str, str]]) -> str:
        """Return the value of `$(eval ...)` as text: it knows the arguments and the names of `math`."""
        stated, convert = context.get("arg", {}), self._xacro.substitution_args.convert_value

        def argument(name: str) -> Any:
            if OPEN in stated[name]:
                raise UntracedError
            return convert(stated[name], "auto")

        if OPEN in expression:
            raise UntracedError
        self._of_arguments.functions["arg"] = argument
        math = self._xacro._global_symbols["math"]
        known = {**CONSTANTS, **{name: math[name] for name in dict.keys(math) if not callable(math[name])}}
        names = Names(lambda name: known[name] if name in known else argument(name))
        return str(self._of_arguments(expression, names))

    def _text(self, text: str, symbols: Any) -> Any:
        """Return the value of a text with expressions, which is a text unless it is one expression alone."""
        cuts = 1 + text.count("$") // 100  # of the lexer, which copies what follows
        self._budget.spend("made", TEXT + len(text) * cuts)
        if "$" not in text:
            return self.trace.unmarked(text)
        found = list[Any]()
        for kind, token in self._lexed(text):
            found.append(self._token(kind, token, symbols))
            self._budget.spend("made", size_of(plain(found[-1])))
        return found[0] if len(found) == 1 else self.trace.joined(found)

    def _token(self, kind: int, token: str, symbols: Any) -> Any:
        """Return the value of a part of a text."""
        xacro, inner = self._xacro, token[2:-1]
        if kind == xacro.LEXER.EXPR:
            try:
                text = self._text(inner, symbols)
                return self._evaluated(text, symbols)
            except Exception as error:
                suffix = f"{os.linesep}when evaluating expression '{inner}'"
                raise xacro.XacroException(exc=error, suffix=suffix) from error
        if kind == xacro.LEXER.EXTENSION:
            return self.trace.unmarked(xacro.eval_extension(f"$({self._text(inner, symbols)})"))
        return token[1:] if kind == xacro.LEXER.DOLLAR_DOLLAR_BRACE else self.trace.unmarked(token)

    def _evaluated(self, text: Any, symbols: Any) -> Any:
        """Return the value of an expression; if it is traced, it has had no effects."""
        before = len(self.notes), len(self.folders.replies)
        value = self.trace.evaluated(self.evaluator, text, Names(symbols.__getitem__))
        effects = self.evaluator.has_effects or before != (len(self.notes), len(self.folders.replies))
        if isinstance(value, TracedValue) and effects:
            raise UntracedError
        return value


class _Arguments(dict[str, str]):
    """Arguments of the file; `asked` are the names that the file asks for."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.asked = dict[object, None]()

    def __contains__(self, name: object) -> bool:
        self.asked[name] = None
        return super().__contains__(name)


class _Counted(Element):
    """An element, whose copies count."""

    def cloneNode(self, deep: bool) -> Any:
        """Return a copy."""
        budget: Budget = cast("Any", self.ownerDocument).budget
        budget.spend("made", NODE + ATTRIBUTE * self.attributes.length)
        clone: Any = super().cloneNode(False)
        clone.__class__ = type(self)
        for child in self.childNodes:
            budget.spend("made", 0 if isinstance(child, Element) else NODE + len(child.data))
            clone.appendChild(child.cloneNode(True))
        return clone


class _Placing(ExpatBuilderNS):
    """Builds the document of one file.

    Elements have a place; that of xacro's own, which check their attributes, is lost where they are cloned.
    """

    def __init__(self, file: str, budget: Budget) -> None:
        """Prepare for a file, whose name stands in its elements' places."""
        super().__init__()
        self._file, self._budget = file, budget
        cast("Any", self.document).budget = budget

    def start_doctype_decl_handler(self, *_: object) -> NoReturn:
        """Refuse a DOCTYPE."""
        raise ModelError(DOCTYPE, line=self.getParser().CurrentLineNumber)

    def start_element_handler(self, name: str, attributes: Any) -> None:
        """Begin an element; expat gives its name as "URI name prefix"."""
        place = f"{self._file}:{self.getParser().CurrentLineNumber}"
        if not name.endswith(" xacro"):
            attributes = [*attributes, PLACE, place]
        super().start_element_handler(name, attributes)
        begun: Any = self.curNode
        begun.__class__, begun.place = _Counted, place
        self._budget.spend("made", NODE + ATTRIBUTE * len(attributes) // 2)  # with their places


@cache
def _own_xacro() -> Any:
    """Return a copy of the package xacro under a name of our own, without what no robot file needs."""
    found: Any = importlib.util.find_spec("xacro")
    own: Any = importlib.util.spec_from_file_location(f"{__name__}_own", found.origin)
    xacro: Any = importlib.util.module_from_spec(own)
    sys.modules[own.name] = xacro
    own.loader.exec_module(xacro)
    xacro.substitution_args = importlib.import_module(f"{own.name}.substitution_args")
    xacro.substitution_args.os = SimpleNamespace(environ={}, path=os.path)  # no environment
    xacro.absolute, xacro.boolean = xacro.abs_filename_spec, xacro.get_boolean_value
    xacro.literal = xacro.Table._eval_literal
    # what a default holds is never divided in another way, for which there are exponentially many
    xacro.re_macro_arg = xacro.re.compile(xacro.re_macro_arg.pattern.replace("+)+|", "+)++|"))
    symbols = xacro._global_symbols
    for table in (symbols, symbols["math"], symbols["python"]):
        for name in FORBIDDEN:
            dict.pop(table, name, None)
        dict.update(table, range=range, round=bounded_round)
    return xacro


def _lexed(text: str) -> list[tuple[int, str]]:
    """Return the parts of a text and their kinds, by xacro's lexer."""
    xacro, found = _own_xacro(), []
    lexer = xacro.QuickLexer(xacro.LEXER)
    lexer.lex(text)
    while lexer.peek():
        found.append(lexer.next())
    return found


def _refuse_pattern(pattern: str) -> NoReturn:
    """Refuse a pattern of names in `<xacro:include>`, which no robot file uses."""
    raise ModelError(f"the pattern '{pattern}' names no file; include each file by its name")


def _failure(xacro: Any, error: Exception, file: str) -> ModelError:
    """Return an error as one line of text with its macros, and the file and line where it occurred."""
    own, inner, suffix = "", error, ""
    while isinstance(inner, xacro.XacroException) and inner.exc is not None:
        own += str(inner.args[0] or "").partition("<class")[0] + " "
        inner, suffix = inner.exc, str(inner.suffix or suffix)
    message = "xacro: " + " ".join(" ".join([own, _described(inner), suffix]).split())
    macros = [macro.body.getAttribute("name") for macro in reversed(xacro.macrostack)]
    if macros:
        message += f" (in macro {' < '.join(macros[:4])})"
    stack = [name for name in xacro.filestack if name]
    where = os.path.relpath(stack[-1]) if stack and stack[-1] != os.path.abspath(file) else file
    line = getattr(error, "lineno", None) or getattr(error, "line", None)  # of expat, and of a DOCTYPE
    if line is None and (place := _place_in(reversed([*walk_tb(error.__traceback__)]))):
        where, line = place[0] or file, place[1]
    kind = RunawayError if isinstance(inner, RunawayError) else ModelError
    return kind(message, file=where, line=line)


def _described(error: BaseException) -> str:
    """Return the message of a Python error in words for the author of a robot file."""
    if isinstance(error, OSError) and error.filename:
        return f"{error.strerror}: {error.filename}"
    own = getattr(error, "message", None) or getattr(error, "msg", None)  # of ModelError and SyntaxError
    return IN_WORDS.get(type(error)) or own or str(error) or type(error).__name__


def _place_in(frames: Iterable[tuple[FrameType, int]]) -> tuple[str, int] | None:
    """Return the place of the element that xacro evaluates in the first of some frames, or None."""
    for frame, _ in frames:
        node = frame.f_locals.get("node") if frame.f_code.co_name == "eval_all" else None
        place = getattr(node, "place", "")
        if node is not None and node.nodeType == node.ELEMENT_NODE and (place or node.hasAttribute(PLACE)):
            file, _, line = (place or node.getAttribute(PLACE)).rpartition(":")
            return file, int(line)
    return None
