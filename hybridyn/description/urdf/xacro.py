"""Expanding xacro files, in a child process with limits (see `xacro_child.py`)."""

from __future__ import annotations

import importlib.util
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import ModelError
from .xml_node import LARGEST_FILE

MEMORY = 2 * 2**30
"""Memory that an expansion may use [bytes]."""

SECONDS = 120
"""Processor time that an expansion may use [s]; a stack of 1,000 six-legged modules takes 40."""

EXTRAS = {"example-robot-data": "robots"}
"""Extras of hybridyn that install a package of robot files."""

LONGEST_MESSAGE = 400
"""Characters of xacro's own message that are passed on."""


def expand(
    file: str, arguments: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[bytes, list[str]]:
    """Expand a xacro file.

    Args:
        file: Path of the file.
        arguments: Values of its arguments by name.
        package_dirs: Folders for `$(find package)`.

    Returns:
        The expanded XML, and xacro's warnings as notes.

    Raises:
        ModelError: xacro reports an error, or the expansion exceeds its limits; file and macro are named.
    """
    request = {
        "file": os.path.abspath(file),
        "arguments": {str(name): str(value) for name, value in arguments.items()},
        "package_dirs": [os.fspath(folder) for folder in package_dirs],
        "share_dirs": _share_dirs(),
        "paths": [_folder_of(module) for module in ("xacro", "yaml")],
        "memory": MEMORY,
        "seconds": SECONDS,
        "largest": LARGEST_FILE,
    }
    header, text = _run_child(file, json.dumps(request).encode())
    if "error" in header:
        inner = header["file"]
        where = file if inner in (None, request["file"]) else os.path.relpath(inner)
        message = f"xacro: {header['error']}{_extra_for(header['error'])}"
        if len(message) > LONGEST_MESSAGE:
            message = message[:LONGEST_MESSAGE] + " ..."
        raise ModelError(message, file=where, line=header["line"])
    return text, list(header["notes"])


def _extra_for(error: str) -> str:
    """Name the command that installs a package which was not found, where an extra of ours does."""
    for package, extra in EXTRAS.items():
        if f"package '{package}' is not found" in error:
            return f", or install it with `pip install 'hybridyn[{extra}]'`"
    return ""


def _run_child(file: str, request: bytes) -> tuple[dict[str, Any], bytes]:
    """Run the child and split its answer into header and XML."""
    child = Path(__file__).with_name("xacro_child.py")
    command = [sys.executable, "-I", "-S", "-X", "utf8", str(child)]
    try:
        done = subprocess.run(command, input=request, capture_output=True, env={}, timeout=2 * SECONDS)
    except subprocess.TimeoutExpired:
        raise ModelError(f"xacro: took more than {2 * SECONDS} s and was ended", file=file) from None
    except OSError as error:
        raise ModelError(f"xacro: no child process could be started: {error.strerror}", file=file) from None
    line, _, text = done.stdout.partition(b"\n")
    try:
        header = json.loads(line)
    except ValueError:
        raise ModelError(_reason(done), file=file) from None
    return header, text


def _reason(done: subprocess.CompletedProcess[bytes]) -> str:
    """Say why a child ended without an answer."""
    if done.returncode in (-signal.SIGKILL, -getattr(signal, "SIGXCPU", 24)):
        return f"xacro: took more than {SECONDS} s of processor time and was ended"
    last = done.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2]
    if "MemoryError" in last:
        return f"xacro: needs more than {MEMORY // 2**30} GiB of memory"
    return f"xacro: ended without a result (status {done.returncode}) {last[:LONGEST_MESSAGE]}".strip()


def _folder_of(module: str) -> str:
    """Return the folder from which a module is imported, without importing it."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        raise ModelError(f"the Python package '{module}' is not installed; it is needed for xacro files")
    return str(Path(spec.origin).parent.parent)


def _share_dirs() -> list[str]:
    """Return the folders where installed packages keep robot files, pip's and the system's."""
    pip = [Path(entry) / "cmeel.prefix" / "share" for entry in sys.path if entry]
    return [str(place) for place in (*pip, Path(sys.prefix) / "share") if place.is_dir()]
