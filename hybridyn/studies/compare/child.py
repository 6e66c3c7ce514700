"""The process in which `apart` judges an engine: `python -m hybridyn.studies.compare.child TASK VERDICT`."""

from __future__ import annotations

import pickle
import sys
from pathlib import Path

from .judge_engine import judge_way


def main(given: str, found: str) -> None:
    """Judge the way into an engine that a file names, and write the verdict to another file."""
    task = pickle.loads(Path(given).read_bytes())
    Path(found).write_bytes(pickle.dumps(judge_way(*task)))


if __name__ == "__main__":
    main(*sys.argv[1:])
