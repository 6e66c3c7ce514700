"""The short run beside the committed rows: ratios to peers, of calls for one sample.

Ratios depend less on the machine than times. Batches of the short run are smaller, and are not compared. Runs
on shared machines differ, so nothing fails by a line: its reader decides.
"""

from __future__ import annotations

from collections.abc import Iterator

from benchmarks.fronts import ratios
from benchmarks.report import Results

#: By how much a ratio may grow before a line says so: short runs differ by up to a half.
GROWTH = 2.0


def changes(now: Results, committed: Results) -> Iterator[str]:
    """Yield a line for each ratio that both runs have; "warning" comes first where it has grown."""
    before, after = (
        {(row.case, row.model, row.method): row.value for row in ratios(results) if row.batch == 1}
        for results in (committed, now)
    )
    for key in [key for key in after if key in before]:
        word = "warning: " if after[key] > GROWTH * before[key] else ""
        yield (
            f"{word}{', '.join(key)}: {after[key]:.3g} times the time of the fastest peer, "
            f"{before[key]:.3g} in the committed rows"
        )
