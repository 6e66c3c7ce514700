"""Read a file that may be broken: it is a robot, or refused with one readable line."""

from __future__ import annotations

from pathlib import Path

from hybridyn.description import Description, read
from hybridyn.errors import ModelError
from tests.waiting import must_end


def outcome(path: Path, text: bytes, *, never: str | None = None) -> Description | None:
    """Read a file that must be read, or refused with one readable line.

    Args:
        path: The file.
        text: What was written to it, or beside it, for messages.
        never: Words that no refusal may have.

    Returns:
        The robot, or None where it was refused.
    """
    try:
        with must_end(text):
            return read(path)
    except ModelError as error:
        message = str(error)
        assert message.strip()
        assert "\n" not in message, text
        assert len(message) < 2000, text
        assert never is None or never not in message, text
        return None


def written(path: Path, text: bytes) -> Path:
    """Write a file and return its path."""
    path.write_bytes(text)
    return path
