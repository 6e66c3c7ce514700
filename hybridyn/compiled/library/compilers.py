"""Find the C compiler of this machine and the vector features that its code may use."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ...errors import CompileError

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
#: or contract arithmetic. Single calls have no code of their own (`code.alone`).
QUICK_FLAGS = ("-DQUICK", *("-Og" if flag == "-O3" else flag for flag in FLAGS))

NAMES = ("cc", "gcc", "clang")

ADVICE = (
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
    raise CompileError(ADVICE)


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
