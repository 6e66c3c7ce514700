"""Judge an engine in a process of its own, so that its crash or its printing stays there."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from .judging import Verdict

#: Module of the other process.
CHILD = f"{__package__}.child"
#: Longest time of an engine [s]; Newton compiles its kernels for minutes.
LONGEST = 1800


def judged_apart(names: tuple[str, str], way: str, task: tuple[Any, ...]) -> Verdict:
    """Judge one way into an engine in another process.

    Args:
        names: Name and version of the engine.
        way: The way in words, for a process that ends without a verdict.
        task: Arguments of `judge_engine.judge_way`.

    Returns:
        The verdict; a refusal if the process ended without one.
    """
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder) / "task", Path(folder) / "verdict"
        given.write_bytes(pickle.dumps(task))
        command = [sys.executable, "-m", CHILD, str(given), str(found)]
        root = str(Path(__file__).parents[3])
        path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "PYTHONPATH": path}
        try:
            done = subprocess.run(command, capture_output=True, timeout=LONGEST, env=environment, check=False)
        except subprocess.TimeoutExpired:
            return Verdict(*names, way, refusal=f"it did not end within {LONGEST} s")
        if found.is_file():
            verdict: Verdict = pickle.loads(found.read_bytes())
            return verdict
        said = done.stderr.decode(errors="replace").strip().splitlines()
        how = f"signal {-done.returncode}" if done.returncode < 0 else f"status {done.returncode}"
        last = f": {said[-1][:200]}" if said else ""
        return Verdict(*names, way, refusal=f"its process ended with {how}{last}")
