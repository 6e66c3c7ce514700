"""Write and read small reports: rows of names and values as CSV or JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import Any

from .files import ends_in

#: Checks the ending and the folder of a report's file, before any work is done.
report_file = ends_in(".csv", ".json")


def write_report(target: str, rows: Sequence[dict[str, Any]]) -> None:
    """Write rows in the format of the file's ending; the file appears when it is complete.

    Args:
        target: The file, .csv or .json.
        rows: Names and values, None for unknown ones.
    """
    from ...description.writing import write_text

    write_text(target, json.dumps(rows, indent=2) + "\n" if target.lower().endswith(".json") else _csv(rows))


def _csv(rows: Sequence[dict[str, Any]]) -> str:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def read_report(source: str) -> list[dict[str, Any]]:
    """Read a report that `write_report` wrote; of any other file, return no rows."""
    if source.lower().endswith(".json"):
        with open(source, encoding="utf-8") as text:
            found: list[dict[str, Any]] = json.load(text)
        return found
    if not source.lower().endswith(".csv"):
        return []
    with open(source, encoding="utf-8", newline="") as text:
        reader = csv.DictReader(text)
        known = {"motor", "setting"} & {*(reader.fieldnames or ())}
        return [{**row} for row in reader] if known else []
