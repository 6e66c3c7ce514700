"""Waits for other processes, and work that must end: by events, with limits that only a hang reaches."""

import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

import numpy as np
import pytest

from hybridyn.errors import HybridynError

T = TypeVar("T")

#: Seconds that an event may take. It fails no test on a slow machine: only what never comes takes so long.
PATIENCE = 300.0
#: Processor time for what takes far less than a second [s]: only what never ends takes so long.
ENDLESS = 300.0


def wait_until(holds: Callable[[], bool], what: str, pause: Callable[[float], object] = time.sleep) -> None:
    """Wait until something holds, and fail where it never does.

    Args:
        holds: Tells whether it does.
        what: What is waited for, in words.
        pause: Waits some seconds, and may do what has to go on meanwhile.
    """
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, f"never: {what}"
        pause(0.02)


@contextmanager
def must_end(what: object) -> Iterator[None]:
    """Fail where the block would never end."""

    def late(*_: object) -> None:
        pytest.fail(f"took more than {ENDLESS} s of processor time: {what}")

    before = signal.signal(signal.SIGPROF, late)
    left = signal.setitimer(signal.ITIMER_PROF, ENDLESS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, *left)
        signal.signal(signal.SIGPROF, before)


def outcome(case: str, call: Callable[[], T]) -> tuple[T | None, str]:
    """Return what a call gives, or the one line that refuses it; nothing else may happen, and it must end.

    Numbers that overflow are not told, as at the command line.
    """
    with must_end(case), np.errstate(all="ignore"):
        try:
            return call(), ""
        except HybridynError as error:
            said = str(error)
        except Exception as error:
            raise AssertionError(f"{case}: {error!r}") from error
    assert said.strip(), case
    assert not re.search("\n|is a bug", said), f"{case}: {said}"
    return None, said
