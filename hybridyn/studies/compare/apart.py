"""Judge an engine in a process of its own: its crash is a refusal, and what it prints stays there."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from typing import Any

from .judging import Verdict, judge_way

#: Longest time of an engine [s].
LONGEST = 600


def judged_apart(way: str, *task: Any) -> Verdict:
    """Judge as `judge_way` does, in another process; a process without a verdict is a refusal."""
    command, path = [sys.executable, "-m", __name__], os.pathsep.join(sys.path)
    engine, number = task[3]
    try:
        done = subprocess.run(
            command, input=pickle.dumps((way, *task)), capture_output=True, timeout=LONGEST, check=True,
            env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return Verdict(engine, number, way, f"it did not end within {LONGEST} s")
    except subprocess.CalledProcessError as error:
        return Verdict(engine, number, way, f"its process ended without a result (status {error.returncode})")
    verdict: Verdict = pickle.loads(done.stdout)
    return verdict


def main() -> None:
    """Judge the task of the standard input; write the verdict to the standard output, and nothing else."""
    found = os.dup(1)
    os.dup2(2, 1)
    with open(found, "wb") as file:
        pickle.dump(judge_way(*pickle.load(sys.stdin.buffer)), file)


if __name__ == "__main__":
    main()
