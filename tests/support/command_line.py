"""The command line in tests: called in this process, or as a program of its own."""

import csv
import os
import subprocess
import sys
from collections.abc import Iterable
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


def call(
    capsys: pytest.CaptureFixture[str], *words: object, status: int = 0, says: str | Iterable[str] = ()
) -> Said:
    """Run the command line in this process.

    Args:
        capsys: Takes what it says.
        words: Its words.
        status: The exit status that it must have.
        says: Of a refusal, words that its one line on standard error must have; nothing else is said.
    """
    found = main([str(word) for word in words])
    said = Said(found, *capsys.readouterr())
    assert found == status, said.err
    if says:
        assert (said.out, said.err.count("\n")) == ("", 1), said
    for words_of_it in [says] if isinstance(says, str) else says:
        assert words_of_it in said.err
    return said


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
