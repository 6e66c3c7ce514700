"""Warnings, and what is good to know: written to a log, or held for a caller that computes anew."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

#: What holds the warnings of this thread, if anything does.
_held: ContextVar[list[str] | None] = ContextVar("held", default=None)


@contextmanager
def held_warnings() -> Iterator[list[str]]:
    """Hold what `warn` is told inside a `with` block, for a caller that computes anew where there is any."""
    held: list[str] = []
    before = _held.set(held)
    try:
        yield held
    finally:
        _held.reset(before)


def warn(text: str, *words: object, log: str = "hybridyn") -> None:
    """Write a warning to a log, whose module is imported then: most calls warn of nothing."""
    if (held := _held.get()) is not None:
        held.append(text % words)
        return
    import logging

    logging.getLogger(log).warning(text, *words)


def inform(text: str, *, log: str) -> None:
    """Write what is good to know to a log."""
    import logging

    logging.getLogger(log).info(text)
