"""Build a shared library from C sources: compile the units in parallel, then link them."""

from __future__ import annotations

import os
import platform
import subprocess
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ...errors import CompileError
from .compilers import FLAGS, Compiler

#: Compiler flags for this machine's processor.
NATIVE = ("-mcpu=native",) if platform.machine() in ("aarch64", "arm64") else ("-march=native",)

ADVICE = "Name another compiler in the environment variable CC; the general path works without one"


#: Runs commands of the compiler; raises CompileError if one fails.
Runner = Callable[[list[list[str]]], None]


def run_at_once(commands: list[list[str]]) -> None:
    """Run commands of the compiler, one per core at once.

    Raises:
        CompileError: The compiler cannot be started, or it fails.
    """
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(run_one, commands))


def build(
    units: tuple[str, ...],
    compiler: Compiler,
    target: Path,
    libraries: tuple[str, ...] = (),
    flags: tuple[str, ...] = FLAGS,
    run: Runner = run_at_once,
) -> None:
    """Compile sources into a library.

    Args:
        units: C sources.
        target: Path of the library; the sources are kept beside it during the build.
        libraries: Linker flags of further libraries; -lm is always linked.
        flags: Flags of every unit.
        run: Runs the compiler.

    Raises:
        CompileError: The compiler fails; the message quotes its output.
    """
    with tempfile.TemporaryDirectory(prefix="hybridyn-", dir=target.parent) as folder:
        sources = [Path(folder, f"unit{i}.c") for i in range(len(units))]
        for path, text in zip(sources, units, strict=True):
            path.write_text(text)
        longest_first = sorted(sources, key=lambda path: -path.stat().st_size)
        objects = [f"{source}.o" for source in longest_first]
        run(
            [
                [*compiler.command, *flags, *NATIVE, "-c", str(source), "-o", made]
                for source, made in zip(longest_first, objects, strict=True)
            ]
        )
        run([[*compiler.command, "-shared", "-o", str(target), *objects, *libraries, "-lm"]])
    if not target.exists():
        raise CompileError(
            f"the C compiler '{compiler.command[0]}' reported success, but there is no library. {ADVICE}"
        )


def run_one(command: list[str]) -> None:
    """Run the compiler.

    Raises:
        CompileError: It cannot be started, or it fails.
    """
    try:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
    except OSError as error:
        raise CompileError(f"the C compiler '{command[0]}' cannot be started: {error}") from error
    with process:
        try:
            said, _ = process.communicate()
        except BaseException:
            process.kill()
            raise
    if process.returncode:
        raise CompileError(
            f"the C compiler '{command[0]}' failed (status {process.returncode}): "
            f"{' '.join(said.split())[:600] or 'no output'}. {ADVICE}"
        )
