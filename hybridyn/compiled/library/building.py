"""Build a shared library from C sources: compile the units in parallel, then link them."""

from __future__ import annotations

import os
import platform
import subprocess
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ...errors import CompileError
from .compilers import FLAGS, Compiler

#: Compiler flags for this machine's processor.
NATIVE = ("-mcpu=native",) if platform.machine() in ("aarch64", "arm64") else ("-march=native",)

ADVICE = "Name another compiler in the environment variable CC; the general path works without one"


def build(units: tuple[str, ...], compiler: Compiler, target: Path, libraries: tuple[str, ...] = ()) -> None:
    """Compile sources into a library.

    Args:
        units: C sources.
        compiler: The compiler.
        target: Path of the library; the sources are kept beside it during the build.
        libraries: Linker flags of further libraries; -lm is always linked.

    Raises:
        CompileError: The compiler fails; the message quotes its output.
    """
    with tempfile.TemporaryDirectory(prefix="hybridyn-", dir=target.parent) as folder:
        sources = [Path(folder, f"unit{i}.c") for i in range(len(units))]
        for path, text in zip(sources, units, strict=True):
            path.write_text(text)
        longest_first = sorted(sources, key=lambda path: -path.stat().st_size)

        def compiled(source: Path) -> str:
            """Compile a unit and return the path of its object file."""
            command = [*compiler.command, *FLAGS, *NATIVE, "-c", str(source), "-o", f"{source}.o"]
            _run(command)
            return f"{source}.o"

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            objects = list(pool.map(compiled, longest_first))
        _run([*compiler.command, "-shared", "-o", str(target), *objects, *libraries, "-lm"])
    if not target.exists():
        raise CompileError(
            f"the C compiler '{compiler.command[0]}' reported success, but there is no library. {ADVICE}"
        )


def _run(command: list[str]) -> None:
    """Run the compiler.

    Raises:
        CompileError: The compiler cannot be started, or it fails.
    """
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace"
        )
    except OSError as error:
        raise CompileError(f"the C compiler '{command[0]}' cannot be started: {error}") from error
    if done.returncode:
        said = " ".join((done.stderr or done.stdout).split())[:600]
        raise CompileError(
            f"the C compiler '{command[0]}' failed (status {done.returncode}): {said or 'no output'}. "
            f"{ADVICE}"
        )
