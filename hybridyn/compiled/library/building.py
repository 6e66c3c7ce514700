"""Find the C compiler of this machine, and build a shared library: compile units in parallel, then link."""

from __future__ import annotations

import importlib.util
import logging
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

from ...errors import CompileError

log = logging.getLogger("hybridyn.compiled")

#: Compiler flags of every unit; `building.NATIVE` is added.
FLAGS = (
    "-std=gnu11",
    "-O3",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",  # fusing.py chooses the fused products
    "-fno-math-errno",
    "-fno-trapping-math",
    "-w",
)

#: Further flags of a huge C file [bytes]: GCC then chooses registers in half the time, or less.
HUGE, HUGE_FLAGS = 400_000, ("--param", "lra-max-considered-reload-pseudos=50")

#: Environment variable that names a folder for the C of libraries that are built; a debugger finds it there.
KEEP_C = "HYBRIDYN_KEEP_C"

NAMES = ("cc", "gcc", "clang")

NO_COMPILER = (
    "no C compiler was found: install gcc or clang, name one in the environment variable CC, or "
    "`pip install ziglang` (the extra 'compiler'); the general path works without one"
)


def has_compiler() -> bool:
    """Return whether there is a C compiler."""
    try:
        return bool(find_compiler())
    except CompileError:
        return False


@cache
def find_compiler() -> tuple[str, ...]:
    """Return the command line of a C compiler: $CC, then cc, gcc, clang, then the `ziglang` wheel.

    Raises:
        CompileError: No compiler is found; the message says what to install.
    """
    named = os.environ.get("CC", "")
    try:
        words = shlex.split(named)
    except ValueError as error:
        raise CompileError(f"the compiler that CC names cannot be read: {named!r}: {error}") from error
    for name in words[:1] or NAMES:
        if path := shutil.which(name):
            return (path, *words[1:])
    if words:
        raise CompileError(f"the compiler that CC names, '{words[0]}', does not exist")
    if importlib.util.find_spec("ziglang") is not None:
        return (sys.executable, "-m", "ziglang", "cc")
    raise CompileError(NO_COMPILER)


@cache
def features() -> frozenset[str]:
    """Return the words in which Linux describes this processor: its model, and "avx512f", "avx", "fma"."""
    cpuinfo, wanted = Path("/proc/cpuinfo"), ("flags", "Features", "model name", "CPU part")
    if not cpuinfo.exists():
        return frozenset()
    lines = cpuinfo.read_text(errors="replace").splitlines()
    return frozenset(word for line in lines if line.startswith(wanted) for word in line.split())


def machine() -> str:
    """Return a text that identifies system, processor and processor features."""
    return " ".join([platform.system(), platform.machine(), *sorted(features())])


def best_lanes(number: str = "float64") -> int:
    """Return how many numbers a vector register of this machine holds."""
    known = features()
    doubles = 8 if "avx512f" in known else 4 if "avx" in known or not known else 2
    return doubles * (2 if number == "float32" else 1)


#: Compiler flags for this machine's processor.
NATIVE = ("-mcpu=native",) if platform.machine() in ("aarch64", "arm64") else ("-march=native",)

ADVICE = "Name another compiler in the environment variable CC; the general path works without one"


def build(
    units: Mapping[str, str],
    compiler: Sequence[str],
    target: Path,
    libraries: tuple[str, ...] = (),
    jobs: int | None = None,
    kept: Path | None = None,
) -> None:
    """Compile sources into a library.

    Args:
        units: C sources by name.
        compiler: Its command line.
        target: Path of the library.
        libraries: Linker flags of further libraries; -lm is always linked.
        jobs: Number of units that are compiled at once; None for that of the cores.
        kept: Folder where the sources stay, and of which the library tells debuggers; None keeps nothing.

    Raises:
        CompileError: The compiler fails; the message quotes its output. Or the folder cannot be written.
    """
    with tempfile.TemporaryDirectory(prefix="hybridyn-", dir=target.parent) as folder:
        commands, objects = [], []
        for name, text in sorted(units.items(), key=lambda unit: -len(unit[1])):  # the longest first
            source = _written(Path(folder), name, text) if kept is None else _kept(kept, name, text)
            objects.append(f"{Path(folder, name)}.o")
            own = (*(HUGE_FLAGS if len(text) > HUGE else ()), *(() if kept is None else ("-g",)))
            commands.append([*compiler, *FLAGS, *NATIVE, *own, "-c", str(source), "-o", objects[-1]])
        with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
            for done, _ in enumerate(pool.map(run_one, commands), 1):
                log.info("the C compiler has done %d of %d files", done, len(commands))
        run_one([*compiler, "-shared", "-o", str(target), *objects, *libraries, "-lm"])
    if not target.exists():
        raise CompileError(
            f"the C compiler '{compiler[0]}' reported success, but there is no library. {ADVICE}"
        )


def _written(folder: Path, name: str, text: str) -> Path:
    """Write a C file, and return its path."""
    path = folder / f"{name}.c"
    path.write_text(text)
    return path


def _kept(folder: Path, name: str, text: str) -> Path:
    """Write a C file that stays.

    Raises:
        CompileError: The folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _written(folder.absolute(), name, text)
    except OSError as error:
        raise CompileError(
            f"the folder '{os.environ[KEEP_C]}' that {KEEP_C} names cannot be written: {error}"
        ) from error


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
