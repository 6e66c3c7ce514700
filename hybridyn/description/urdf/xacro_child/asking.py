"""Ask the parent process for files; this process opens none.

A question is one line of JSON, `{"ask": "read", "of": path}` (or "glob" with a pattern, "find" with a
package); the answer is one line of JSON and `size` bytes, or `error`, with `errno` where the system says so.
"""

from __future__ import annotations

import io
import json
from typing import Any, BinaryIO

from .expressions import RefusedError


class Parent:
    """The process that reads for this one.

    Args:
        answers: Where its answers come from.
        questions: Where questions go.
    """

    def __init__(self, answers: BinaryIO, questions: BinaryIO) -> None:
        self.answers, self.questions = answers, questions

    def request(self) -> dict[str, Any]:
        """Return what the parent wants, which comes first."""
        request: dict[str, Any] = json.loads(self.answers.readline())
        return request

    def answer(self, header: dict[str, Any], text: bytes) -> None:
        """Return the result."""
        self.questions.write(json.dumps(header).encode() + b"\n" + text)
        self.questions.flush()

    def ask(self, what: str, of: str) -> bytes:
        """Ask a question.

        Args:
            what: "read", "glob" or "find".
            of: Path, pattern or name of a package.

        Raises:
            OSError: The system does not give the file.
            RefusedError: The parent does not.
        """
        self.answer({"ask": what, "of": of}, b"")
        header = json.loads(self.answers.readline())
        if "errno" in header:
            raise OSError(header["errno"], header["error"], of)
        if "error" in header:
            raise RefusedError(header["error"])
        return self.answers.read(header["size"])

    def open(self, path: str) -> io.TextIOWrapper:
        """Open a text file for reading."""
        return io.TextIOWrapper(io.BytesIO(self.ask("read", path)), encoding="utf-8")

    def find(self, package: str) -> str:
        """Return the folder of a package."""
        return self.ask("find", package).decode()

    def glob(self, pattern: str) -> list[str]:
        """Return the files that a pattern fits."""
        found: list[str] = json.loads(self.ask("glob", pattern))
        return found
