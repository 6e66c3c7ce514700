"""A progress bar on standard error, if this is a terminal and the work is long."""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

#: Time before the bar appears [s].
PATIENCE = 2.0
#: Time between two updates [s].
INTERVAL = 0.1
BAR_WIDTH = 30


@contextmanager
def progress(thing: str = "samples") -> Iterator[Callable[[int, float | None], None]]:
    """Yield a function that shows the progress: a bar that appears after two seconds, and goes at the end.

    The function takes the number of things done, and the part of the work that is done, in [0, 1], or None if
    it is unknown.
    """
    started = drawn = time.perf_counter()

    def show(count: int, part: float | None) -> None:
        """Draw the bar, if an update is due."""
        nonlocal drawn
        now = time.perf_counter()
        if now - started < PATIENCE or now - drawn < INTERVAL or not sys.stderr.isatty():
            return
        import shutil  # only a bar that is drawn needs it

        drawn, elapsed = now, now - started
        text = f"{count:,} {thing}, {count / elapsed:,.0f}/s"
        if part:
            full, left = round(BAR_WIDTH * part), elapsed * (1.0 - part) / part
            text = f"[{'#' * full}{'.' * (BAR_WIDTH - full)}] {part:4.0%}  {text}, {left:,.0f} s left"
        sys.stderr.write(f"\r\x1b[K{text[: shutil.get_terminal_size().columns - 1]}")
        sys.stderr.flush()

    try:
        yield show
    finally:
        if drawn > started:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()
