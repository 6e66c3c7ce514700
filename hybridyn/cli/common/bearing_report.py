"""The report of `hybridyn idm --bearings`: what each joint transmits over a motion."""

from collections.abc import Sequence
from typing import Any

import click

from ...streams.departures import Departures
from ...streams.one_pass import BlockResults
from ...structure.robot import HybridRobot
from ...studies.bearings import BEARING_UNITS, BearingLoad, Bearings
from ...tables.layout import Layout
from .one_table import CommandTables
from .reports import save_report, unless_rounding
from .text import aligned_rows, counted

#: What the printed table shows of a load that redundant closures share.
SHARED = "shared"


class BearingReport:
    """The loads of the joints, collected block by block, and their report."""

    def __init__(self, robot: HybridRobot, tables: CommandTables) -> None:
        self.robot, self.tables, self.bearings = robot, tables, Bearings(robot)

    def add(self, done: BlockResults) -> None:
        """Add a block, whose reactions are loads."""
        assert done.reactions is not None
        self.bearings.add(done.time, done.first_row, done.reactions)

    def show(self, layout: Layout, left: Departures, quiet: bool) -> None:
        """Print the table and write the files."""
        loads, timed = self.bearings.loads(), layout.time is not None
        rows = [bearing_facts(load, timed) for load in loads]
        save_report(rows, self.robot, self.tables, "loads of bearings")
        head = (
            f"{self.robot.name}: {counted(len(loads), 'joint')}, {counted(self.bearings.samples, 'sample')}"
        )
        lines = [head, *bearing_table(loads, timed), *left.lines()]
        if any(None in load.peaks.values() for load in loads):
            lines.append(
                f"{SHARED}: redundant closures share this load, so that the motion does not determine it"
            )
        click.echo("\n".join(lines))


def bearing_table(loads: Sequence[BearingLoad], timed: bool) -> list[str]:
    """Return the printed table: one line per joint. Moments are rounding of forces times some metre."""
    at = "at [s]" if timed else "row"
    rows = [["joint", "kind"]]
    for word in BEARING_UNITS:
        rows[0] += [f"peak {word}", at, "RMS"]
    for load in loads:
        cells, force = [load.joint, load.kind], load.largest_force
        for word, unit in BEARING_UNITS.items():
            peak, rms = load.peaks.get(word), load.rms.get(word)
            if peak is None or rms is None:
                cells += [SHARED if word in load.peaks else "", "", ""]
            else:
                value, mean = unless_rounding(peak.value, force), unless_rounding(rms, force)
                cells += [f"{value:.4g} {unit}", f"{peak.at:.5g}" if value else "", f"{mean:.4g}"]
        rows.append(cells)
    return [f"  {line}" for line in aligned_rows(rows, right=range(2, len(rows[0])))]


def bearing_facts(load: BearingLoad, timed: bool) -> dict[str, Any]:
    """Return the loads of a joint as flat names and values, None for what is absent or shared.

    Args:
        load: The loads.
        timed: Whether the table has time; if not, peaks are at rows.
    """
    out: dict[str, Any] = {"joint": load.joint, "kind": load.kind}
    for word in BEARING_UNITS:
        peak = load.peaks.get(word)
        out |= {
            f"peak_{word}": peak and peak.value,
            f"peak_{word}_{'at' if timed else 'row'}": peak and peak.at,
            f"rms_{word}": load.rms.get(word),
        }
    return out
