"""Expand xacro files in a child process without access to files or network (see `xacro_child`).

The child computes from its request and the replies to its file requests alone. An expansion is therefore kept
with hashes of these replies, and used again where the same file requests get the same replies.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import json
import os
import signal
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from ...errors import ModelError, install_advice
from ..cache_folder import hashed
from ..kept_texts import keep, kept, state_of
from ..shipped import data_folder
from .robot_folders import RobotFolders
from .xacro_process import SECONDS, START, child_of, is_kept
from .xml_node import LARGEST_FILE

if TYPE_CHECKING:
    import subprocess

#: Memory that an expansion may use [bytes].
MEMORY = 2 * 2**30

#: Extras of hybridyn that install a package of robot files, by the name of the package.
EXTRAS = {"example-robot-data": "robots"}

#: Longest message of xacro that is passed on [characters].
LONGEST_MESSAGE = 400

#: Most file requests that one expansion may send; robots include a few dozen files.
MOST_QUESTIONS = 10_000

#: Longest line that the child may send [bytes].
LONGEST_LINE = 2**20
#: Bytes that are read from the child at once.
AT_ONCE = 2**16

#: Note on an expansion without restrictions by the kernel.
UNLOCKED = "xacro: this system's kernel restricts nothing; only hybridyn's own limits hold (README, Security)"

#: Packages that the child imports.
PACKAGES = ("xacro", "yaml")


def expand(
    file: str, arguments: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[bytes, list[str]]:
    """Expand a xacro file; return the XML, and xacro's warnings as notes.

    Raises:
        ModelError: xacro reports an error, or the expansion exceeds its limits; the message names the file
            and the macro.
    """
    again = is_kept()  # once: another thread may change it meanwhile
    request, folders = _request(file, [arguments], package_dirs, again)
    own = Path(__file__).parent / "xacro_child"
    codes = [own, *(Path(of, package) for of, package in zip(request["paths"], PACKAGES, strict=True))]
    name = hashed(START, sys.version, json.dumps(request, sort_keys=True), *map(state_of, codes))
    known = None if again else kept(name)
    if known is not None and _unchanged(folders(), known["replies"]):
        return known["text"].encode(errors="surrogateescape"), known["notes"]
    replies: list[list[str]] = []
    with child_of(file, kept=again) as child:
        (answer,) = _converse(child, file, request, folders(), replies)
    text, notes = _result(file, *answer)
    if not again:  # the many files of a sweep would replace those of the next commands
        keep(name, {"replies": replies, "text": text.decode(errors="surrogateescape"), "notes": notes})
    return text, notes


def expand_each(
    file: str, many: Sequence[Mapping[str, object]], package_dirs: Sequence[str | os.PathLike[str]]
) -> Iterator[tuple[bytes, list[str]] | ModelError]:
    """Expand a xacro file with each set of arguments, in one child; yield results or errors.

    The child reads each file once. A set that it refuses is expanded again in a child of its own, since
    limits are those of one set. So is every set if the child ends before the last one, for its time or its
    memory, or if the texts together are too large.
    """
    again = is_kept()
    request, folders = _request(file, many, package_dirs, again)
    try:
        with child_of(file, kept=again) as child:
            answers = _converse(child, file, request, folders(), [])
    except ModelError:
        answers = [({"error": ""}, b"")] * len(many)
    for arguments, answer in zip(many, answers, strict=True):
        try:
            refused = "error" in answer[0]
            yield expand(file, arguments, package_dirs) if refused else _result(file, *answer)
        except ModelError as error:
            yield error


def _request(
    file: str,
    many: Sequence[Mapping[str, object]],
    package_dirs: Sequence[str | os.PathLike[str]],
    again: bool,
) -> tuple[dict[str, Any], Callable[[], RobotFolders]]:
    """Return the request to the child, and a function that returns the folders which it may read."""
    path = os.path.abspath(file)
    request = {
        "file": path,
        "folder": os.getcwd(),
        "arguments": [{str(name): str(value) for name, value in one.items()} for one in many],
        "paths": [_folder_of(module) for module in PACKAGES],
        "memory": MEMORY,
        "seconds": SECONDS,
        "again": again,
    }
    named = [os.fspath(folder) for folder in package_dirs]
    return request, lambda: RobotFolders(path, named, _share_dirs(), LARGEST_FILE, _shipped_dirs())


def _result(file: str, header: Mapping[str, Any], text: bytes) -> tuple[bytes, list[str]]:
    """Return the XML and the notes of an answer of the child."""
    if "error" in header:
        inner = header["file"]
        where = file if inner in (None, os.path.abspath(file)) else os.path.relpath(inner)
        message = f"xacro: {header['error']}{_extra_for(header['error'])}"
        if len(message) > LONGEST_MESSAGE:
            message = message[:LONGEST_MESSAGE] + " ..."
        raise ModelError(message, file=where, line=header["line"])
    return text, list(header["notes"]) + ([] if header["locks"] else [UNLOCKED])


def _reply_hash(reply: tuple[dict[str, Any], bytes]) -> str:
    """Return a hash of a reply to a file request."""
    header, content = reply
    return hashlib.sha256(json.dumps(header, sort_keys=True).encode() + b"\n" + content).hexdigest()


def _unchanged(folders: RobotFolders, replies: list[list[str]]) -> bool:
    """Return whether file requests still get the same replies; each is what is asked, of what, and a hash."""
    return all(_reply_hash(_answer(folders, what, of)) == reply for what, of, reply in replies)


def _extra_for(error: str) -> str:
    """Return the advice to install a missing package by an extra of hybridyn, or an empty string."""
    for package, extra in EXTRAS.items():
        if f"package '{package}' is not found" in error:
            return f", or {install_advice(extra)}"
    return ""


def _converse(
    child: subprocess.Popen[bytes],
    file: str,
    request: Mapping[str, Any],
    folders: RobotFolders,
    replies: list[list[str]],
) -> list[tuple[dict[str, Any], bytes]]:
    """Answer the child's file requests until it has sent all results; return their headers and XML.

    `replies` receives each request and a hash of its reply.
    """
    assert child.stdin is not None
    assert child.stdout is not None
    results: list[tuple[dict[str, Any], bytes]] = []
    total = 0  # length of all texts, which this process holds together
    with contextlib.suppress(BrokenPipeError):  # the child has ended; `_reason` explains why
        _send(child.stdin, request)
        answers = _Reader(child.stdout)
        for _ in range(MOST_QUESTIONS):
            line = answers.line(LONGEST_LINE)
            if not line:
                break
            header = _header(line, file)
            if "ask" not in header:
                size = header.pop("size", 0)
                text = answers.block(min(int(size), LARGEST_FILE + 1))
                total += len(text)
                if total > LARGEST_FILE:
                    raise ModelError(f"xacro: expands to more than {LARGEST_FILE // 2**20} MiB", file=file)
                results.append((header, text))
                if len(results) == len(request["arguments"]):
                    return results
                continue
            asked = str(header["ask"]), str(header["of"])
            reply = _answer(folders, *asked)
            replies.append([*asked, _reply_hash(reply)])
            _send(child.stdin, *reply)
        else:
            raise ModelError(f"xacro: reads more than {MOST_QUESTIONS:,} files", file=file)
    raise ModelError(_reason(child.wait()), file=file)


def _header(line: bytes, file: str) -> dict[str, Any]:
    """Parse a line that the child sent."""
    try:
        header = json.loads(line)
    except ValueError:
        header = None
    if not isinstance(header, dict):
        raise ModelError("xacro: the child process sent an invalid reply", file=file)
    return header


def _send(pipe: IO[bytes], header: Mapping[str, Any], content: bytes = b"") -> None:
    """Write a header and content into a pipe without a buffer."""
    left = memoryview(json.dumps(header).encode() + b"\n" + content)
    while left:
        left = left[pipe.write(left) :]


class _Reader:
    """Reads lines and blocks from a pipe without a buffer."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self._pipe, self._rest = pipe, bytearray()

    def line(self, most: int) -> bytes:
        """Return the next line, cut after `most` bytes; empty at the end."""
        while b"\n" not in self._rest and len(self._rest) < most and self._more():
            pass
        return self._taken(min(self._rest.find(b"\n") + 1 or most, most))

    def block(self, size: int) -> bytes:
        """Return the next bytes, fewer at the end."""
        while len(self._rest) < size and self._more():
            pass
        return self._taken(size)

    def _more(self) -> bool:
        """Read what is there; return False at the end."""
        read = self._pipe.read(AT_ONCE)
        self._rest += read
        return bool(read)

    def _taken(self, size: int) -> bytes:
        """Return the first bytes that were read."""
        out = bytes(self._rest[:size])
        del self._rest[:size]
        return out


def _answer(folders: RobotFolders, what: str, of: str) -> tuple[dict[str, Any], bytes]:
    """Return the reply to a file request: its header and the content."""
    try:
        if what == "read":
            content = folders.read(of)
        elif what == "glob":
            content = json.dumps(folders.glob(of)).encode()
        else:
            content = folders.find(of).encode()
    except ModelError as error:
        return {"error": str(error)}, b""
    except OSError as error:
        return {"error": error.strerror or str(error), "errno": error.errno or 0}, b""
    except ValueError as error:  # a null character in a path
        return {"error": str(error)}, b""
    return {"size": len(content)}, content


def _reason(status: int) -> str:
    """Return the reason why a child ended without an answer."""
    if status in (-signal.SIGKILL, -getattr(signal, "SIGXCPU", 24)):
        return f"xacro: took more than {SECONDS} s of processor time and was ended"
    return f"xacro: ended without a result (status {status})"


def _folder_of(module: str) -> str:
    """Return the folder from which a module is imported, without importing it."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModelError(f"the Python package '{module}' is not installed; it is needed for xacro files")
    return str(Path(spec.origin).parent.parent)


def _shipped_dirs() -> list[str]:
    """Return the folder of the shipped robots' files; every robot may include modules from it."""
    folder = data_folder()
    return [] if folder is None else [str(folder / "urdf")]


def _share_dirs() -> list[str]:
    """Return the folders in which installed packages keep robot files: pip's and the system's."""
    pip = [Path(entry) / "cmeel.prefix" / "share" for entry in sys.path if entry]
    return [str(place) for place in (*pip, Path(sys.prefix) / "share") if place.is_dir()]
