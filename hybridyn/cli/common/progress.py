"""A progress bar on standard error, if this is a terminal and the work is long."""

import sys
import time
from types import TracebackType
from typing import Self

#: Time before the bar appears [s].
PATIENCE = 2.0
#: Time between two updates [s].
INTERVAL = 0.1
BAR_WIDTH = 30


class Progress:
    """A bar that appears after two seconds and is erased at the end. A context manager."""

    def __init__(self, thing: str = "samples") -> None:
        self._thing = thing
        self.started = self.drawn = time.perf_counter()
        self.wanted = sys.stderr.isatty()
        self.visible = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.visible:
            sys.stderr.write("\r\x1b[K")
            sys.stderr.flush()

    def show(self, samples: int, fraction: float | None) -> None:
        """Draw the bar, if an update is due.

        Args:
            samples: Number of samples done.
            fraction: Fraction of the work that is done, in [0, 1], or None if unknown.
        """
        now = time.perf_counter()
        if not self.wanted or now - self.started < PATIENCE or now - self.drawn < INTERVAL:
            return
        import shutil  # only a bar that is drawn needs it

        self.drawn, self.visible = now, True
        elapsed = now - self.started
        text = f"{samples:,} {self._thing}, {samples / elapsed:,.0f}/s"
        if fraction:
            full = round(BAR_WIDTH * fraction)
            left = elapsed * (1.0 - fraction) / fraction
            text = f"[{'#' * full}{'.' * (BAR_WIDTH - full)}] {fraction:4.0%}  {text}, {left:,.0f} s left"
        sys.stderr.write(f"\r\x1b[K{text[: shutil.get_terminal_size().columns - 1]}")
        sys.stderr.flush()
