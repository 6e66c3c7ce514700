"""Expand one xacro file with one or many sets of arguments, as restricted as the package's docstring says.

Protocol: standard input receives the request, one line of JSON, and then the replies to file requests.
Standard output carries the file requests (`asking`) and, for each set of arguments, one line of JSON (`notes`
and `locks`, or `error` with `file` and `line`), and, if there was no error, the XML.
"""

from __future__ import annotations

import encodings.cp1252
import encodings.latin_1
import gc
import os
import sys
import xml.dom.expatbuilder
import xml.dom.minidom
from types import SimpleNamespace
from typing import Any

from .asking import Parent
from .bounds import RefusedError
from .expressions import Evaluator
from .functions import bound_functions, functions_in
from .kernel_lock import lock
from .replacing import replace_node

#: Audit events that Python itself refuses; they also protect systems whose kernel has no lock.
FORBIDDEN_EVENTS = (
    "open", "socket.", "subprocess.", "os.", "ctypes.", "shutil.", "glob.", "tempfile.", "pty.", "fcntl.",
)  # fmt: skip

#: Modules that are imported before files are locked, for XML files in these encodings.
ENCODINGS = (encodings.cp1252, encodings.latin_1, xml.dom.expatbuilder)


class Arguments(dict[str, str]):
    """Arguments of the file; `asked` records the names that the file asks for."""

    def __init__(self) -> None:
        super().__init__()
        self.given: list[str] = []
        self.asked: list[str] = []

    def renew(self, given: dict[str, str]) -> None:
        """Replace all arguments, for the next expansion."""
        self.clear()
        self.update(given)
        self.given, self.asked = list(given), []

    def __contains__(self, name: object) -> bool:
        self.asked.append(str(name))
        return super().__contains__(name)


def main() -> None:
    """Expand the file that the request names and answer; where many follow, fork for each."""
    parent = Parent(sys.stdin.buffer, sys.stdout.buffer)
    sys.stdout = sys.stderr  # prints of xacro must not mix with the answer
    request = parent.request()
    if request is None:
        return
    sys.path += request["paths"]
    import xacro
    from xacro import substitution_args  # and with it yaml, once for all forks

    gc.freeze()
    while request is not None:
        if not request["again"]:
            expand(xacro, substitution_args, parent, request)
            return
        fork = os.fork()
        if fork == 0:
            expand(xacro, substitution_args, parent, request)
            os._exit(0)  # without the end of the interpreter, which takes a third of the time
        end_as(os.waitpid(fork, 0)[1])
        request = parent.request()


def end_as(status: int) -> None:
    """End this process as one of its forks has ended, unless that was without an error."""
    if os.WIFSIGNALED(status):
        os.kill(os.getpid(), os.WTERMSIG(status))
    if status:
        sys.exit(1)


def expand(xacro: Any, substitution_args: Any, parent: Parent, request: dict[str, Any]) -> None:
    """Expand the file that a request names with each set of arguments, and answer.

    Afterwards this process can do nothing else.
    """
    notes: list[str] = []
    arguments = Arguments()
    prepare(xacro, substitution_args, parent, arguments, request["folder"], notes)
    limit_resources(request["memory"], request["seconds"])
    locks = lock()
    sys.path.clear()
    sys.addaudithook(refuse_events)
    for given in request["arguments"]:
        arguments.renew(given)
        notes.clear()
        try:
            document = xacro.process_file(request["file"], mappings=arguments, verbosity=0)
            refuse_unused(arguments)
            text = document.toxml(encoding="utf-8")
        except Exception as error:
            parent.answer(failure(xacro, error), b"")
        else:
            parent.answer({"notes": notes, "locks": locks, "size": len(text)}, text)


def limit_resources(memory: int, seconds: int) -> None:
    """Limit memory [bytes], processor time [s] and open files, and forbid writing to files, if possible."""
    try:
        import resource
    except ImportError:
        return
    limits = [
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, 0),
        (resource.RLIMIT_NOFILE, 64),
        (resource.RLIMIT_CORE, 0),
    ]
    for which, value in limits:
        try:
            resource.setrlimit(which, (value, value))
        except (ValueError, OSError):
            continue


def refuse_events(event: str, arguments: tuple[Any, ...]) -> None:
    """Raise RefusedError for events of files, network and processes; an audit hook cannot be removed."""
    if event.startswith(FORBIDDEN_EVENTS):
        raise RefusedError(f"a xacro file may not use {event}")


def prepare(
    xacro: Any, substitution_args: Any, parent: Parent, arguments: Arguments, folder: str, notes: list[str]
) -> None:
    """Replace xacro's functions that read files, evaluate expressions and find packages by our own."""
    expand, absolute, evaluate_text = xacro.parse, xacro.abs_filename_spec, xacro.eval_text

    def note(*words: Any, **options: Any) -> str:
        """Keep a message of xacro as a note."""
        notes.append("xacro: " + " ".join(" ".join(map(str, words)).split()))
        return ""

    def parse(text: Any, filename: str | None = None) -> Any:
        """Parse a text, or a file that the parent reads."""
        if text is not None or filename is None:
            return expand(text, filename)
        return xml.dom.minidom.parseString(read_xml(xacro, parent, filename))

    def eval_text(text: str, symbols: Any) -> Any:
        """Evaluate a text; one without expressions is itself, for which xacro searches four times."""
        return text if text and "$" not in text else evaluate_text(text, symbols)

    def locate(name: str) -> str:
        """Return the path of an included file."""
        package, _, rest = name.removeprefix("package://").partition("/")
        where = os.path.join(parent.find(package), rest) if name.startswith("package://") else absolute(name)
        return str(where)

    symbols = xacro._global_symbols
    bound_functions(symbols, note)
    dict.update(
        symbols["xacro"], message=note, warning=note, error=note, print_location=lambda *_, **__: "",
        arg=lambda name: arguments[name],
    )  # fmt: skip
    dollar = dollar_names(substitution_args, parent, symbols["math"], arguments)
    evaluate = Evaluator(functions_in(symbols, dollar), (xacro.NameSpace, xacro.YamlDictWrapper))

    def dollar_eval(expression: str, context: Any) -> str:
        """Evaluate the expression of `$(eval ...)`."""
        given = {name: substitution_args.convert_value(value, "auto") for name, value in arguments.items()}
        return str(evaluate(expression, {**symbols["python"], **given, **dollar}))

    xacro.safe_eval = lambda expression, names, local_names=None: evaluate(expression, names)
    xacro.parse, xacro.warning, xacro.abs_filename_spec = parse, note, locate
    xacro.print_location, xacro.replace_node, xacro.eval_text = lambda: None, replace_node, eval_text
    xacro.open, xacro.glob = parent.open, SimpleNamespace(glob=parent.glob)
    xacro.root_dir = folder
    substitution_args._eval, substitution_args._eval_find = dollar_eval, parent.find


def dollar_names(
    substitution_args: Any, parent: Parent, mathematics: dict[str, Any], arguments: Arguments
) -> dict[str, Any]:
    """Return the names that `$(eval ...)` provides besides the file's arguments: mathematics and its own."""
    return {
        **mathematics,
        "true": True,
        "false": False,
        "env": substitution_args._eval_env,
        "optenv": substitution_args._eval_optenv,
        "find": parent.find,
        "arg": lambda name: substitution_args.convert_value(arguments[name], "auto"),
    }


def read_xml(xacro: Any, parent: Parent, filename: str) -> bytes:
    """Read a xacro file or an included one; raise RefusedError for document types and entities."""
    try:
        text = parent.ask("read", filename)
    except OSError as error:
        xacro.filestack.pop()
        raise xacro.XacroException(f"{error.strerror}: {filename}", exc=error) from None
    if b"<!DOCTYPE" in text.upper() or b"<!ENTITY" in text.upper() or b"\0" in text:
        raise RefusedError("DOCTYPE, ENTITY and other encodings than UTF-8 are not allowed in a robot file")
    return text


def refuse_unused(arguments: Arguments) -> None:
    """Raise RefusedError for arguments that the file does not declare; xacro itself would ignore them."""
    for name in arguments.given:
        if name not in arguments.asked:
            declared = ", ".join(f"'{known}'" for known in dict.fromkeys(arguments.asked)) or "none"
            raise RefusedError(f"there is no argument '{name}'; the file's arguments: {declared}")


def failure(xacro: Any, error: Exception) -> dict[str, Any]:
    """Return an error as one line of text with its macros, and the file and line where it occurred."""
    own, inner, suffix = "", error, ""
    if isinstance(error, xacro.XacroException) and error.exc is not None:
        own, inner, suffix = str(error.args[0] or ""), error.exc, str(error.suffix or "")
        if own.startswith("<class") or isinstance(inner, OSError):
            own = ""
    message = " ".join(" ".join([own, describe(inner), suffix]).split())
    macros = [macro.body.getAttribute("name") for macro in reversed(xacro.macrostack or [])]
    if macros:
        message += f" (in macro {' < '.join(macros[:4])})"
    stack = [name for name in xacro.filestack or [] if name]
    return {"error": message, "file": stack[-1] if stack else None, "line": getattr(error, "lineno", None)}


def describe(error: BaseException) -> str:
    """Return the message of a Python error in words for the author of a robot file."""
    if isinstance(error, MemoryError):
        return "needs too much memory"
    if isinstance(error, RecursionError):
        return "macros or includes call themselves without end"
    if isinstance(error, OSError) and error.filename:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, SyntaxError):
        return error.msg
    return str(error) or type(error).__name__
