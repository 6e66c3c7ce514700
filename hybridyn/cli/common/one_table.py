"""The files of a command that computes one table from another."""

from collections.abc import Callable
from typing import Any, NamedTuple

from .files import check_targets
from .options import refuse


class CommandTables(NamedTuple):
    """The files of a command, and its options for them.

    Attributes:
        source: The table that is read.
        output: File of the result, or None for standard output.
        reactions: File of the reactions, or None.
        jobs: Number of processes, or None for the command's own choice.
        quiet: Whether the summary is left out.
        plot: File of a figure of the result, or None.
        redundancy: The rule for freedoms that poses leave, as in `hybridyn.assemble`.
    """

    source: str
    output: str | None
    reactions: str | None
    jobs: int | None
    quiet: bool
    plot: str | None
    redundancy: str


def one_table(compute: Callable[..., int], words: dict[str, Any]) -> int:
    """Check the files of one table, and compute it."""
    tables = CommandTables(**{name: words.pop(name) for name in CommandTables._fields})
    check_targets([tables.source], (tables.output, tables.reactions))
    refuse(
        (
            tables.reactions == "-" and tables.output in (None, "-"),
            "efforts and reactions cannot both go to standard output",
        )
    )
    return compute(tables=tables, **words)
