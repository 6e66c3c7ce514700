"""Find the C compiler of this machine, and build a shared library: compile units in parallel, then link."""

from __future__ import annotations

import hashlib
import importlib.util
import logging
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
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

#: Flags of a quick build (-O1 takes half more time), with the same bits: no flag lets the compiler reorder
#: or contract arithmetic. Kernels on plain numbers are left out.
QUICK_FLAGS = ("-DQUICK", *("-Og" if flag == "-O3" else flag for flag in FLAGS))

#: Further flags of a huge C file [bytes]: GCC then chooses registers in half the time, or less.
HUGE, HUGE_FLAGS = 400_000, ("--param", "lra-max-considered-reload-pseudos=50")

NAMES = ("cc", "gcc", "clang")

NO_COMPILER = (
    "no C compiler was found: install gcc or clang, name one in the environment variable CC, or "
    "`pip install ziglang` (the extra 'compiler'); the general path works without one"
)


@dataclass(frozen=True)
class Compiler:
    """A C compiler.

    Attributes:
        command: Its command line.
        identity: Text that changes whenever the compiler changes.
    """

    command: tuple[str, ...]
    identity: str


@cache
def find_compiler() -> Compiler:
    """Find a compiler: $CC, then cc, gcc, clang, then the `ziglang` wheel.

    Raises:
        CompileError: No compiler is found; the message says what to install.
    """
    if words := _words(os.environ.get("CC", "")):
        path = shutil.which(words[0])
        if path is None:
            raise CompileError(f"the compiler that CC names, '{words[0]}', does not exist")
        return Compiler((path, *words[1:]), _identity(path))
    for name in NAMES:
        if path := shutil.which(name):
            return Compiler((path,), _identity(path))
    spec = importlib.util.find_spec("ziglang")
    if spec is not None and spec.origin:
        return Compiler((sys.executable, "-m", "ziglang", "cc"), _identity(spec.origin))
    raise CompileError(NO_COMPILER)


def _words(command: str) -> list[str]:
    """Split a command into words, as a shell does."""
    try:
        return shlex.split(command)
    except ValueError as error:
        raise CompileError(f"the compiler that CC names cannot be read: {command!r}: {error}") from error


def _identity(path: str) -> str:
    """Return path, size and modification time of a compiler's file; asking for its version costs more."""
    real = os.path.realpath(path)
    stat = os.stat(real)
    return f"{real} {stat.st_size} {stat.st_mtime_ns}"


@cache
def machine() -> str:
    """Return a text that identifies system, processor and processor features."""
    features = platform.processor()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        wanted = ("flags", "Features", "model name", "CPU part")
        lines = {line for line in cpuinfo.read_text(errors="replace").splitlines() if line.startswith(wanted)}
        features = "\n".join(sorted(lines))
    digest = hashlib.sha256(features.encode()).hexdigest()[:16]
    return f"{platform.system()} {platform.machine()} {digest}"


@cache
def features() -> frozenset[str]:
    """Return the vector features of this processor by their Linux names ("avx512f", "avx", "fma")."""
    cpuinfo = Path("/proc/cpuinfo")
    if not cpuinfo.exists():
        return frozenset()
    for line in cpuinfo.read_text(errors="replace").splitlines():
        if line.startswith(("flags", "Features")):
            return frozenset(line.split(":", 1)[1].split())
    return frozenset()


def best_lanes(number: str = "float64") -> int:
    """Return how many numbers a vector register of this machine holds."""
    known = features()
    doubles = 8 if "avx512f" in known else 4 if "avx" in known or not known else 2
    return doubles * (2 if number == "float32" else 1)


#: Compiler flags for this machine's processor.
NATIVE = ("-mcpu=native",) if platform.machine() in ("aarch64", "arm64") else ("-march=native",)

ADVICE = "Name another compiler in the environment variable CC; the general path works without one"


def build(
    units: tuple[str, ...],
    compiler: Compiler,
    target: Path,
    libraries: tuple[str, ...] = (),
    flags: tuple[str, ...] = FLAGS,
    jobs: int | None = None,
) -> None:
    """Compile sources into a library.

    Args:
        units: C sources.
        target: Path of the library; the sources are kept beside it during the build.
        libraries: Linker flags of further libraries; -lm is always linked.
        flags: Flags of every unit.
        jobs: Number of units that are compiled at once; None for that of the cores.

    Raises:
        CompileError: The compiler fails; the message quotes its output.
    """
    with tempfile.TemporaryDirectory(prefix="hybridyn-", dir=target.parent) as folder:
        commands, objects = [], []
        for i, text in sorted(enumerate(units), key=lambda unit: -len(unit[1])):  # the longest first
            source = Path(folder, f"unit{i}.c")
            source.write_text(text)
            objects.append(f"{source}.o")
            own = HUGE_FLAGS if len(text) > HUGE else ()
            commands.append([*compiler.command, *flags, *NATIVE, *own, "-c", str(source), "-o", objects[-1]])
        with ThreadPoolExecutor(jobs or os.cpu_count()) as pool:
            for done, _ in enumerate(pool.map(run_one, commands), 1):
                log.info("the C compiler has done %d of %d files", done, len(commands))
        run_one([*compiler.command, "-shared", "-o", str(target), *objects, *libraries, "-lm"])
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
