"""The command line in tests: called in this process, or as a program of its own."""

from __future__ import annotations

import csv
import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest

from hybridyn.cli import main
from tests import ROOT


class Said(NamedTuple):
    """What a command answered."""

    status: int
    out: str
    err: str


def call(capsys: pytest.CaptureFixture[str], *words: object) -> Said:
    """Run the command line in this process."""
    status = main([str(word) for word in words])
    return Said(status, *capsys.readouterr())


def program(*words: object, **options: object) -> subprocess.Popen[str]:
    """Start the command line as a program, warnings being errors."""
    environment = {**os.environ, "PYTHONWARNINGS": "error", "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "hybridyn", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment,
        **options,  # type: ignore[call-overload]
    )


def table_text(header: list[str], rows: np.ndarray) -> str:
    """Return a CSV table."""
    return "\n".join([",".join(header), *(",".join(map(repr, row)) for row in rows.tolist()), ""])


def read_table(text: str) -> dict[str, np.ndarray]:
    """Return the columns of a CSV table by name."""
    header, *rows = csv.reader(text.splitlines())
    return dict(zip(header, np.array(rows, dtype=float).T, strict=True))
