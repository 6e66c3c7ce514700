"""Expand xacro files: they run no code, write nothing, and read no file outside the robot's folders.

The package xacro expands, in a copy of our own, since it keeps its state in its modules. Two things are
replaced in it: how it evaluates expressions (`expressions`) and how it reads files (`robot_folders`).
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import io
import itertools
import os
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from ...errors import ModelError, install_advice
from ..cache_folder import hashed
from ..kept_texts import keep, kept, state_of
from ..shipped import data_folder, shown
from .robot_folders import RobotFolders
from .xml_node import LARGEST_FILE, refuse_dangerous

#: Extras of hybridyn that install a package of robot files, by the name of the package.
EXTRAS = {"example-robot-data": "robots"}
#: Longest message of xacro that is passed on [characters].
LONGEST_MESSAGE = 400
#: Most nodes that macros, blocks and includes may insert; a stack of 1,000 modules inserts some 5 million.
MOST_NODES = 20_000_000
#: Most files, packages and patterns that one expansion may ask for; robots include a few dozen files.
MOST_ASKED = 10_000

#: Our copy of xacro expands one file at a time.
_lock = threading.Lock()


def expand(
    file: str, arguments: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[bytes, list[str]]:
    """Expand a xacro file; return the XML, whose elements have a `PLACE`, and xacro's warnings as notes.

    An expansion without arguments is kept, and used again while all that it asked of the robot's folders gets
    the same replies. Those with arguments, of which a sweep makes many, are not kept.

    Raises:
        ModelError: xacro reports an error, or the expansion exceeds its limits; the message names the file
            and the macro.
    """
    path = os.path.abspath(file)
    named = [os.fspath(folder) for folder in package_dirs]
    folders = partial(RobotFolders, path, named, _share_dirs(), LARGEST_FILE, _shipped_dirs())
    if arguments:
        return _expanded(file, arguments, _Asked(folders()))
    codes = map(state_of, (Path(__file__).parent, Path(_spec().origin or "").parent))
    name = hashed(sys.version, path, os.getcwd(), *named, *codes)
    known = kept(name)
    if known is None or not _unchanged(_Asked(folders()), known["replies"]):
        asked = _Asked(folders())
        text, notes = _expanded(file, {}, asked)
        known = {"replies": asked.replies, "text": text.decode(), "notes": notes}
        keep(name, known)
    return known["text"].encode(), known["notes"]


def _expanded(file: str, arguments: Mapping[str, object], asked: _Asked) -> tuple[bytes, list[str]]:
    """Expand a xacro file, see `expand`."""
    given = _Arguments({str(name): str(value) for name, value in arguments.items()})
    notes: list[str] = []
    with _lock:
        xacro = _own_xacro()
        _connect(xacro, asked, given, notes)
        try:
            document = xacro.process_file(os.path.abspath(file), mappings=given, verbosity=0)
            given.refuse_unused()
            text: bytes = document.toprettyxml(indent="", encoding="utf-8")  # each element on its own line
        except Exception as error:
            raise _failure(xacro, error, file) from None
    if len(text) > LARGEST_FILE:
        raise ModelError(f"xacro: expands to more than {LARGEST_FILE // 2**20} MiB", file=file)
    return text, notes


class _Asked:
    """A robot's folders, and a hash of each of their replies."""

    def __init__(self, folders: RobotFolders) -> None:
        self.folders, self.replies = folders, list[list[str]]()

    def __call__(self, what: str, of: str) -> Any:
        """Read a file, find a package or search a pattern ("read", "find", "glob").

        Raises:
            OSError: The system cannot open or read the file.
            ModelError: The folders refuse it, or too much was asked.
        """
        if len(self.replies) >= MOST_ASKED:
            raise ModelError(f"reads more than {MOST_ASKED:,} files")
        reply: Any = None
        try:
            reply = getattr(self.folders, what)(of)
        except (OSError, ModelError) as error:
            reply = str(error)
            raise
        finally:
            self.replies.append([what, of, hashlib.sha256(repr(reply).encode()).hexdigest()])
        return reply


def _unchanged(asked: _Asked, replies: list[list[str]]) -> bool:
    """Return whether a robot's folders still give the same replies."""
    for what, of, _ in replies:
        with contextlib.suppress(OSError, ModelError):
            asked(what, of)
    return asked.replies == replies


class _Arguments(dict[str, str]):
    """Arguments of the file; `asked` records the names that the file asks for."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.given, self.asked = list(given), list[str]()

    def __contains__(self, name: object) -> bool:
        self.asked.append(str(name))
        return super().__contains__(name)

    def refuse_unused(self) -> None:
        """Raise ModelError for arguments that the file does not declare; xacro itself would ignore them."""
        for name in self.given:
            if name not in self.asked:
                declared = ", ".join(f"'{known}'" for known in dict.fromkeys(self.asked)) or "none"
                raise ModelError(f"there is no argument '{name}'; the file's arguments: {declared}")


def _spec() -> ModuleSpec:
    """Return how a copy of the package xacro is imported, under a name of our own."""
    found = importlib.util.find_spec("xacro")
    assert found is not None
    assert found.origin is not None
    spec = importlib.util.spec_from_file_location(f"{__name__}_own", found.origin)
    assert spec is not None
    return spec


@cache
def _own_xacro() -> Any:
    """Return a copy of the package xacro, without the names that no robot file needs."""
    from .expressions import FORBIDDEN, bounded_range, bounded_round

    spec = _spec()
    assert spec.loader is not None
    xacro: Any = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = xacro
    spec.loader.exec_module(xacro)
    xacro.substitution_args = importlib.import_module(f"{spec.name}.substitution_args")
    xacro.substitution_args.os = SimpleNamespace(environ={}, path=os.path)  # no environment
    xacro.evaluate_text, xacro.absolute = xacro.eval_text, xacro.abs_filename_spec
    symbols = xacro._global_symbols
    for table in (symbols, symbols["math"], symbols["python"]):
        for name in FORBIDDEN:
            dict.pop(table, name, None)
        dict.update(table, range=bounded_range, round=bounded_round)
    return xacro


def _connect(xacro: Any, asked: _Asked, given: _Arguments, notes: list[str]) -> None:
    """Connect xacro with an expansion's folders, arguments and notes, and with our evaluation."""
    from .expressions import Evaluator  # an expansion that is kept needs neither
    from .placing import Placing

    nodes, read, find = 0, partial(asked, "read"), partial(asked, "find")
    dollar, symbols = xacro.substitution_args, xacro._global_symbols

    def note(*words: Any, **_: Any) -> str:
        """Keep a message of xacro as a note."""
        notes.append("xacro: " + " ".join(" ".join(map(str, words)).split()))
        return ""

    def parse(_: None, filename: str) -> Any:
        """Parse a file."""
        try:
            content = read(filename)
        except OSError as error:
            xacro.filestack.pop()
            raise xacro.XacroException(f"{error.strerror}: {filename}", exc=error) from None
        refuse_dangerous(content, filename)
        return Placing("" if filename == asked.folders.file else shown(Path(filename))).parseString(content)

    def locate(name: str) -> str:
        """Return the path of an included file."""
        package, _, rest = name.removeprefix("package://").partition("/")
        is_uri = name.startswith("package://")
        return str(os.path.join(find(package), rest) if is_uri else xacro.absolute(name))

    def insert(node: Any, by: Any, content_only: bool = False) -> None:
        """Replace a node by others, which are counted."""
        nonlocal nodes
        nodes += 1 + _replace(node, by, content_only)
        if nodes > MOST_NODES:
            raise ModelError(f"macros, blocks and includes insert more than {MOST_NODES:,} nodes")

    def argument(name: str) -> Any:
        """Return the value of an argument, as a number where it is one."""
        return dollar.convert_value(given[name], "auto")

    def evaluate_dollar(expression: str, _: object) -> str:
        """Evaluate the expression of `$(eval ...)`."""
        return str(of_dollar(expression, {**known, **{name: argument(name) for name in given}}))

    dict.update(
        symbols["xacro"], message=note, warning=note, error=note, print_location=lambda *_, **__: "",
        arg=lambda name: given[name],
    )  # fmt: skip
    own = {"find": find, "arg": argument, "env": dollar._eval_env, "optenv": dollar._eval_optenv}
    known = {**symbols["python"], **symbols["math"], **own, "true": True, "false": False}
    spaces = (xacro.NameSpace, xacro.YamlDictWrapper)
    evaluate, of_dollar = (Evaluator(_functions(table), spaces) for table in (symbols, known))
    xacro.safe_eval = lambda expression, names, _=None: evaluate(expression, names)
    xacro.eval_text = lambda text, names: xacro.evaluate_text(text, names) if "$" in text else text
    xacro.parse, xacro.abs_filename_spec, xacro.replace_node = parse, locate, insert
    xacro.open = lambda path: io.TextIOWrapper(io.BytesIO(read(path)), encoding="utf-8")
    xacro.glob, xacro.root_dir = SimpleNamespace(glob=partial(asked, "glob")), os.getcwd()
    xacro.warning, xacro.print_location = note, lambda: None
    dollar._eval, dollar._eval_find = evaluate_dollar, find


def _functions(names: Mapping[str, Any]) -> dict[str, Callable[..., Any]]:
    """Return the functions of a table of names."""
    return {name: value for name, value in names.items() if callable(value)}


def _replace(node: Any, by: Any, content_only: bool) -> int:
    """Replace a node by other nodes, or by their children, in time linear in their number; return it.

    xacro's own function inserts them one by one and searches the parent's list each time, which is quadratic:
    with it, a stack of 100 modules takes 25 s.
    """
    sources = [] if by is None else by if isinstance(by, list) else [by]
    new = [child for source in sources for child in source.childNodes] if content_only else sources
    parent = node.parentNode
    siblings = parent.childNodes
    index = next(i for i, sibling in enumerate(siblings) if sibling is node)
    chain = [node.previousSibling, *new, node.nextSibling]
    siblings[index : index + 1] = new
    for left, right in itertools.pairwise(chain):
        if left is not None:
            left.nextSibling = right
        if right is not None:
            right.previousSibling = left
    for child in new:
        child.parentNode = parent
    node.parentNode = node.previousSibling = node.nextSibling = None
    return len(new)


def _failure(xacro: Any, error: Exception, file: str) -> ModelError:
    """Return an error as one line of text with its macros, and the file and line where it occurred."""
    from .placing import place_of

    own, inner, suffix = "", error, ""
    if isinstance(error, xacro.XacroException) and error.exc is not None:
        own, inner, suffix = str(error.args[0] or ""), error.exc, str(error.suffix or "")
        if own.startswith("<class") or isinstance(inner, OSError):
            own = ""
    message = "xacro: " + " ".join(" ".join([own, _described(inner), suffix]).split())
    macros = [macro.body.getAttribute("name") for macro in reversed(xacro.macrostack)]
    if macros:
        message += f" (in macro {' < '.join(macros[:4])})"
    for package, extra in EXTRAS.items():
        if f"package '{package}' is not found" in message:
            message += f", or {install_advice(extra)}"
    if len(message) > LONGEST_MESSAGE:
        message = message[:LONGEST_MESSAGE] + " ..."
    stack = [name for name in xacro.filestack if name]
    where = os.path.relpath(stack[-1]) if stack and stack[-1] != os.path.abspath(file) else file
    line = getattr(error, "lineno", None)
    if (place := place_of(error)) is not None:
        where, line = place[0] or file, place[1]
    return ModelError(message, file=where, line=line)


def _described(error: BaseException) -> str:
    """Return the message of a Python error in words for the author of a robot file."""
    if isinstance(error, MemoryError):
        return "needs too much memory"
    if isinstance(error, RecursionError):
        return "macros or includes call themselves without end"
    if isinstance(error, OSError) and error.filename:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, ModelError | SyntaxError):
        return error.message if isinstance(error, ModelError) else error.msg
    return str(error) or type(error).__name__


def _shipped_dirs() -> list[str]:
    """Return the folder of the shipped robots' files; every robot may include modules from it."""
    folder = data_folder()
    return [] if folder is None else [str(folder / "urdf")]


def _share_dirs() -> list[str]:
    """Return the folders in which installed packages keep robot files: pip's and the system's."""
    pip = [Path(entry) / "cmeel.prefix" / "share" for entry in sys.path if entry]
    return [str(place) for place in (*pip, Path(sys.prefix) / "share") if place.is_dir()]
