"""A chart of a result over time, which is drawn while it is computed."""

from collections.abc import Sequence

import numpy as np

from ...figures.motion import MOST_SAMPLES, chart_of_rows, extremes
from ...spatial import Array
from ...streams.departures import Departures
from ...streams.one_pass import Rows
from ...structure.robot import HybridRobot
from ...tables.columns import Layout
from ...tables.opening import Table
from .figures import save, title_of


class Drawing:
    """A chart of a result over time, which watches the blocks of a pass."""

    def __init__(self, robot: HybridRobot, table: Table, columns: Sequence[str], target: str) -> None:
        """Start without rows.

        Args:
            table: The table from which the result is computed.
            columns: Names of the columns of the rows.
            target: The file, whose ending says its format.
        """
        self.robot, self.columns, self.target = robot, columns, target
        self.title = title_of(robot, table.file)
        self.each = max(1, (table.rows or 0) // MOST_SAMPLES)
        self.parts: list[tuple[Array, Array]] = []

    def add(self, done: Rows) -> None:
        """Add a block."""
        numbers = np.arange(done.first_row, done.first_row + len(done.rows), dtype=float)
        self.parts.append(extremes(numbers if done.time is None else done.time, done.rows, self.each))

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Write the chart."""
        x, rows = map(np.concatenate, zip(*self.parts, strict=True))
        timed = layout.time is not None
        save(
            chart_of_rows(self.columns, x, rows, robot=self.robot, timed=timed, title=self.title), self.target
        )
