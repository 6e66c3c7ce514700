"""Break each equation, closure row and guard in turn, and say which tests of its room fail.

    python -m tests.tools.mutants                       all of them (`mutants.toml`)
    python -m tests.tools.mutants "(43) legs" "(53)"    those whose names begin so
    python -m tests.tools.mutants --first               stop at the first test that fails: much sooner

A mutant is one fragment of one file, replaced in a copy of the tree. It lives if no test of its room fails.
"""

import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from tests import ROOT

#: The tests of a room, by the folder of the package that the mutant is in; the first that fits counts.
ROOMS = {
    "dynamics/quantities": ["quantities"],
    "dynamics/cones": ["simulation/test_sticking_balls.py"],
    "dynamics": ["dynamics", "effects", "hard/test_singular_answers.py"],
    "linkage": ["linkage", "dynamics", "manifold", "assembly", "extending/test_closures.py",
                "compiled/test_programs.py"],
    "manifold": ["manifold", "simulation"],
    "simulation": ["simulation"], "effects": ["effects"], "assembly": ["assembly"],
    "structure": ["dynamics", "structure", "assembly"],
    "compiled": ["compiled", "dynamics/test_engines.py"],
}  # fmt: skip


def killers(file: str, old: str, new: str, *options: str) -> list[str]:
    """Return the tests of the room that fail with a mutant.

    Raises:
        ValueError: The fragment is not found exactly once: the code has moved, and the table must follow.
    """
    path = Path("hybridyn") / file
    text = (ROOT / path).read_text()
    if text.count(old) != 1:
        raise ValueError(f"found {text.count(old)} times in {path}, not once: {old!r}")
    room = next(tests for folder, tests in ROOMS.items() if file.startswith(folder))
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder, "tree")
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".*", "__pycache__"))
        (tree / path).write_text(text.replace(old, new))
        tests = [f"tests/{name}" for name in room]
        command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *options, *tests]
        done = subprocess.run(command, cwd=tree, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise ValueError(f"the tests did not run: {done.stdout[-500:]}{done.stderr[-500:]}")
    return re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)


def main(*words: str) -> None:
    """Print what kills each mutant that is asked for."""
    options = ["-x"] if "--first" in words else []
    names = tuple(word for word in words if word != "--first")
    for file, mutants in tomllib.loads((ROOT / "tests" / "mutants.toml").read_text()).items():
        for name, (old, new) in mutants.items():
            if name.startswith(names or ""):
                found = killers(file, old, new, *options)
                what = f"dies in {len(found)}: {' '.join(found[:3])}" if found else "LIVES"
                print(f"{name:34s} {what}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
