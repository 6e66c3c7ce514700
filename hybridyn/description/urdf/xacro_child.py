"""The child process that expands one xacro file; run as a script by `xacro_files.py`, with no site-packages.

xacro files are programs. Here they run with limits on memory, time, files and processes, without environment,
with a short list of what an expression may hold. That is defence in depth, not a sandbox.

Protocol: a request in JSON on standard input; on standard output one line of JSON (`notes`, or `error` with
`file` and `line`), then, without an error, the expanded XML.
"""

from __future__ import annotations

import ast
import functools
import itertools
import json
import os
import stat
import sys
import xml.dom.minidom
from types import CodeType
from typing import Any

ALLOWED_NODES = (
    ast.Expression, ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Compare, ast.Call, ast.keyword,
    ast.Starred, ast.Name, ast.Attribute, ast.Subscript, ast.Slice, ast.Constant, ast.List, ast.Tuple,
    ast.Dict, ast.Set, ast.boolop, ast.operator, ast.unaryop, ast.cmpop, ast.expr_context,
)  # fmt: skip
"""What an expression may be made of: no lambda, no comprehension, no assignment, no formatted string."""

FORBIDDEN_NAMES = {"vars", "type", "mro", "format", "format_map"}
FORBIDDEN_EVENTS = (
    "socket.",
    "subprocess.",
    "os.system",
    "os.exec",
    "os.fork",
    "os.posix_spawn",
    "ctypes.",
    "shutil.",
)
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class RefusedError(Exception):
    """The xacro file asks for something that is not given to it."""


class Arguments(dict[str, str]):
    """Arguments of the file; remembers which names the file asked for."""

    def __init__(self, given: dict[str, str]) -> None:
        super().__init__(given)
        self.given = list(given)
        self.asked: list[str] = []

    def __contains__(self, name: object) -> bool:
        self.asked.append(str(name))
        return super().__contains__(name)


def main() -> None:
    """Expand the file that the request names and answer on standard output."""
    request = json.load(sys.stdin)
    sys.path[:] = [*sys.path[1:], *request["paths"]]
    import xacro

    limit_resources(request["memory"], request["seconds"])
    notes: list[str] = []
    prepare(xacro, request, notes)
    sys.addaudithook(Guard(request["largest"]))
    arguments = Arguments(request["arguments"])
    try:
        document = xacro.process_file(request["file"], mappings=arguments, verbosity=0)
        refuse_unused(arguments)
        text = document.toxml(encoding="utf-8")
    except Exception as error:
        answer(failure(xacro, error), b"")
    else:
        answer({"notes": notes}, text)


def answer(header: dict[str, Any], text: bytes) -> None:
    """Write one line of JSON and the expanded text."""
    sys.stdout.buffer.write(json.dumps(header).encode() + b"\n" + text)
    sys.stdout.buffer.flush()


def limit_resources(memory: int, seconds: int) -> None:
    """Limit memory [bytes], processor time [s], files and processes, where the system can."""
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


class Guard:
    """Audit hook: no network, no process, no writing, and only regular files of sane size are opened."""

    def __init__(self, largest: int) -> None:
        self.largest = largest

    def __call__(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Refuse an event by raising."""
        if event.startswith(FORBIDDEN_EVENTS):
            raise RefusedError(f"a xacro file may not use {event}")
        if event != "open" or not isinstance(arguments[0], str | bytes):
            return
        path, flags = arguments[0], arguments[2]
        if flags & WRITING:
            raise RefusedError(f"a xacro file may not write ('{os.fsdecode(path)}')")
        try:
            status = os.stat(path)
        except OSError:
            return
        if not stat.S_ISREG(status.st_mode):
            raise RefusedError(f"'{os.fsdecode(path)}' is not a regular file")
        if status.st_size > self.largest:
            raise RefusedError(f"'{os.fsdecode(path)}' is larger than {self.largest // 2**20} MiB")


def prepare(xacro: Any, request: dict[str, Any], notes: list[str]) -> None:
    """Put our own reading of files, expressions and packages in the place of xacro's."""
    from xacro import substitution_args

    evaluate_dollar, expand = substitution_args._eval, xacro.parse

    def safe_eval(expression: str, names: dict[str, Any], local_names: Any = None) -> Any:
        names.update(__builtins__={})
        return eval(check_expression(expression), names, local_names)

    def safe_dollar(expression: str, context: Any) -> Any:
        check_expression(expression)
        return evaluate_dollar(expression, context)

    def parse(text: Any, filename: str | None = None) -> Any:
        if text is not None or filename is None:
            return expand(text, filename)
        return xml.dom.minidom.parseString(read_xml(xacro, filename))

    def warning(*words: Any) -> None:
        notes.append("xacro: " + " ".join(" ".join(map(str, words)).split()))

    def find(package: str) -> str:
        return find_package(package, request["package_dirs"], request["file"], request["share_dirs"])

    def locate(name: str) -> str:
        package, _, rest = name.removeprefix("package://").partition("/")
        return os.path.join(find(package), rest) if name.startswith("package://") else absolute(name)

    absolute, xacro.abs_filename_spec = xacro.abs_filename_spec, locate
    xacro.safe_eval, xacro.parse, xacro.warning = safe_eval, parse, warning
    xacro.print_location, xacro.replace_node = lambda: None, replace_node
    substitution_args._eval = safe_dollar
    substitution_args._eval_find = substitution_args._eval_dict["find"] = find


def replace_node(node: Any, by: Any, content_only: bool = False) -> None:
    """Put nodes (or what they contain) in the place of a node, in time that grows with their number.

    xacro's own inserts them one by one and searches the parent's list each time, which is quadratic: a stack
    of 100 modules takes 25 s with it.
    """
    sources = [] if by is None else by if isinstance(by, list) else [by]
    new = [child for source in sources for child in source.childNodes] if content_only else sources
    parent = node.parentNode
    siblings = parent.childNodes
    index = next(i for i, sibling in enumerate(siblings) if sibling is node)
    before, after = node.previousSibling, node.nextSibling
    siblings[index : index + 1] = new
    chain = [before, *new, after]
    for left, right in itertools.pairwise(chain):
        if left is not None:
            left.nextSibling = right
        if right is not None:
            right.previousSibling = left
    for child in new:
        child.parentNode = parent
    node.parentNode = node.previousSibling = node.nextSibling = None


@functools.lru_cache(maxsize=4096)
def check_expression(expression: str) -> CodeType:
    """Compile an expression, refusing what none has need of; a macro's expressions come again and again."""
    tree = ast.parse(expression.strip(), mode="eval")
    for node in ast.walk(tree):
        if not isinstance(node, ALLOWED_NODES):
            raise RefusedError(f"{type(node).__name__} is not allowed in an expression")
        name = node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
        if name.startswith("_") or name in FORBIDDEN_NAMES:
            raise RefusedError(f"name '{name}' is not allowed in an expression")
    return compile(tree, "<expression>", "eval")


def read_xml(xacro: Any, filename: str) -> bytes:
    """Read a xacro file or an included one; document types and entities are refused."""
    try:
        with open(filename, "rb") as file:
            text = file.read()
    except OSError as error:
        xacro.filestack.pop()
        raise xacro.XacroException(f"{error.strerror}: {filename}", exc=error) from None
    if b"<!DOCTYPE" in text.upper() or b"<!ENTITY" in text.upper() or b"\0" in text:
        raise RefusedError("DOCTYPE, ENTITY and other encodings than UTF-8 are not allowed in a robot file")
    return text


def find_package(package: str, folders: list[str], file: str, shares: list[str]) -> str:
    """Find a package: in the given folders, above and beside the folders that hold the file, or installed."""
    above = os.path.dirname(os.path.abspath(file))
    places = list(folders)
    while above != os.path.dirname(above):
        places.append(above)
        above = os.path.dirname(above)
    for place in places + shares:
        if os.path.basename(os.path.normpath(place)) == package:
            return os.path.abspath(place)
        if os.path.isdir(os.path.join(place, package)):
            return os.path.abspath(os.path.join(place, package))
    raise RefusedError(f"package '{package}' is not found; name the folder that holds it with package_dirs")


def refuse_unused(arguments: Arguments) -> None:
    """Refuse arguments that the file does not declare; xacro itself would lose them without a word."""
    for name in arguments.given:
        if name not in arguments.asked:
            declared = ", ".join(f"'{known}'" for known in dict.fromkeys(arguments.asked)) or "none"
            raise RefusedError(f"there is no argument '{name}'; the file's arguments: {declared}")


def failure(xacro: Any, error: Exception) -> dict[str, Any]:
    """Describe an error in one line: what, in which file and macro."""
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
    """Describe what Python raised in words for the author of a robot file."""
    if isinstance(error, MemoryError):
        return "needs too much memory"
    if isinstance(error, RecursionError):
        return "macros or includes call themselves without end"
    if isinstance(error, OSError) and error.filename:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, SyntaxError):
        return error.msg
    return str(error) or type(error).__name__


if __name__ == "__main__":
    main()
