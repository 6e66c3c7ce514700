"""Format text for the terminal: counts and columns."""

import textwrap
from collections.abc import Sequence

from ...description.names import counted

__all__ = ["aligned_rows", "counted", "terminal_width", "wrapped"]

#: Limits of the width of text [characters]: terminals may be tiny, and wide text is hard to read.
NARROWEST, WIDEST = 40, 110


def terminal_width() -> int:
    """Return the width of text [characters]."""
    import shutil  # few commands need it

    return min(max(shutil.get_terminal_size().columns, NARROWEST), WIDEST)


def wrapped(text: str, width: int, indent: str = "  ") -> list[str]:
    """Break a text into lines, which do not divide words; those after the first begin with four spaces."""
    return textwrap.wrap(
        text, width, initial_indent=indent, subsequent_indent="    ", break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def aligned_rows(rows: Sequence[Sequence[str]], right: Sequence[int] = ()) -> list[str]:
    """Align cells in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.rjust(width) if column in right else cell.ljust(width)
            for column, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return lines
