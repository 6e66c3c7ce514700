"""Request files from the parent process; this process opens none.

A request is one line of JSON, `{"ask": "read", "of": path}` (or "glob" with a pattern, "find" with a
package). The reply is one line of JSON: `size`, followed by that many bytes, or `error`, with `errno` if the
system reported the error.
"""

from __future__ import annotations

import io
import json
from typing import Any, BinaryIO

from .bounds import RefusedError


class Parent:
    """The parent process, which reads files for this one.

    Args:
        answers: Stream of its request and its replies.
        questions: Stream of file requests and of the result.
    """

    def __init__(self, answers: BinaryIO, questions: BinaryIO) -> None:
        self.answers, self.questions = answers, questions
        self.known: dict[tuple[str, str], bytes] = {}

    def request(self) -> dict[str, Any] | None:
        """Read a request of the parent, one line; None at the end."""
        line = self.answers.readline()
        return json.loads(line) if line else None

    def answer(self, header: dict[str, Any], text: bytes) -> None:
        """Send a line of JSON and a text to the parent."""
        self.questions.write(json.dumps(header).encode() + b"\n" + text)
        self.questions.flush()

    def ask(self, what: str, of: str) -> bytes:
        """Send a file request and return the content of the reply, which is kept.

        Raises:
            OSError: The system cannot open or read the file.
            RefusedError: The parent rejects the request.
        """
        if (what, of) in self.known:
            return self.known[what, of]
        self.answer({"ask": what, "of": of}, b"")
        header = json.loads(self.answers.readline())
        if "errno" in header:
            raise OSError(header["errno"], header["error"], of)
        if "error" in header:
            raise RefusedError(header["error"])
        content = self.known[what, of] = self.answers.read(header["size"])
        return content

    def open(self, path: str) -> io.TextIOWrapper:
        """Open a text file for reading."""
        return io.TextIOWrapper(io.BytesIO(self.ask("read", path)), encoding="utf-8")

    def find(self, package: str) -> str:
        """Return the folder of a package."""
        return self.ask("find", package).decode()

    def glob(self, pattern: str) -> list[str]:
        """Return the files that match a pattern."""
        found: list[str] = json.loads(self.ask("glob", pattern))
        return found
