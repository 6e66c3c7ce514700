"""Cache of built libraries in the user's cache folder.

    keys/<key>            hash of the source that a cheap description of the model led to last time
    models/<source>.json  programs in the library of a source, and the hash of the library's file
    libraries/<hash>.so   libraries by their own hash

Each file is written beside its place and then moved there, so several processes may build at the same time.
A file is built again if it is truncated, if its name does not match its content, or if another user may have
written it (`description.cache_folder`).

The least recently used libraries are removed when the cache exceeds `LIMIT`. A library's modification time is
the time of its last use. A loaded library stays usable after its file is removed. A process whose file is
removed before it is loaded builds it again (`calls.loaded`). So no process waits for another.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import json
import os
import os.path
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...description.cache_folder import VARIABLE, check_ownership, folder, hashed, is_own
from ...description.writing import appearing
from ...errors import CompileError
from .building import FLAGS, NATIVE, QUICK_FLAGS, Runner, build, find_compiler, machine, run_at_once

if TYPE_CHECKING:
    from ..code.library_source import Source

#: Size of the cached libraries [bytes]; the library of a robot with 24 motors has 400,000.
LIMIT = 256 * 2**20
#: Time after its last use in which a library is never removed [s].
IN_USE = 3600.0
#: Age from which unfinished files are taken to be left by a killed process [s].
ABANDONED = 86400.0


def remove_unused(at: Path) -> None:
    """Remove libraries beyond `LIMIT`, the records and keys that lead to them, and abandoned files."""
    libraries, models, room = at / "libraries", at / "models", LIMIT
    for path in sorted(libraries.glob("*.so"), key=_age_and_size):
        age, size = _age_and_size(path)
        room -= size
        if room < 0 and age > IN_USE:
            _remove(path)
    if room < 0:  # records and keys are written after their library, so none is removed too early
        for record in models.glob("*.json"):
            if not os.path.exists(libraries / f"{_target(record)}.so"):
                _remove(record)
        for key in (at / "keys").glob("[0-9a-f]*"):
            if not os.path.exists(models / f"{_target(key)}.json"):
                _remove(key)
    for path in [*at.glob("building-*"), *at.glob("*/tmp*")]:
        if _age_and_size(path)[0] > ABANDONED:
            shutil.rmtree(path, ignore_errors=True)
            _remove(path)


def _target(path: Path) -> str:
    """Return the name that a record or a key leads to; empty if its content is invalid."""
    try:
        text = path.read_text()
        return str(json.loads(text)["library"]) if path.suffix else text
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _age_and_size(path: Path) -> tuple[float, int]:
    """Return the time since a file's last use [s] and its size [bytes]; zeros if it is gone."""
    try:
        stat = path.stat()
    except OSError:
        return 0.0, 0
    return time.time() - stat.st_mtime, stat.st_size


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):
        path.unlink()


#: Folders of the package that generate no source.
UNREAD = ("cli", "figures", "studies", "view")


@dataclass(frozen=True)
class Built:
    """A built library.

    Attributes:
        path: Its file.
        about: Description of its programs (`Source.about`).
        quick: Whether it was built with `QUICK_FLAGS`.
    """

    path: Path
    about: dict[str, Any]
    quick: bool = False


def cached(
    key: str,
    make_source: Callable[[], Source],
    libraries: tuple[str, ...] = (),
    accept: Callable[[Built], None] = lambda built: None,
    *,
    quick: bool = False,
    run: Runner = run_at_once,
) -> Built:
    """Return the library of a model from the cache, or build it.

    Args:
        key: Text that determines the source and is cheap to compute.
        make_source: Generates the source; called only for a new key.
        libraries: Linker flags of further libraries; -lm is always linked.
        accept: Checks a library and raises if it is wrong; its key is then not stored.
        quick: Whether a library without the slow optimisations will do, where there is none with them.
        run: Runs the compiler.

    Raises:
        CompileError: There is no compiler, the compiler fails, the cache folder cannot be used, or other
            users can write in it.
    """
    if (found := known(key, libraries, quick=quick)) is not None:
        return found
    flags = QUICK_FLAGS if quick else FLAGS
    at, tools = folder_in_use(), _tools(libraries, flags)
    pointer = _pointer(at, key, tools)
    source = make_source()
    name = hashed(*source.units, json.dumps(source.about, sort_keys=True), tools)
    try:
        found = _load(at, name)
        if found is None:
            made = functools.partial(build, source.units, find_compiler(), libraries=libraries)
            found = _build(at, name, source, functools.partial(made, flags=flags, run=run))
        found = replace(found, quick=flags is QUICK_FLAGS)
        accept(found)
        _write(pointer, name.encode())
    except OSError as error:  # a full disk, a folder where a file should be
        raise CompileError(
            f"the cache folder '{at}' cannot be used: {error}; repair it, or name another in {VARIABLE}"
        ) from error
    return found


def known(key: str, libraries: tuple[str, ...] = (), *, quick: bool = False) -> Built | None:
    """Return the library that was built for a key, or None; arguments and errors are those of `cached`."""
    at = folder_in_use()
    check_ownership(at)
    for flags in (FLAGS, QUICK_FLAGS) if quick else (FLAGS,):
        pointer = _pointer(at, key, _tools(libraries, flags))
        with contextlib.suppress(OSError, ValueError):  # the file does not exist, or is no text
            if is_own(pointer) and (found := _load(at, pointer.read_text())) is not None:
                return replace(found, quick=flags is QUICK_FLAGS)
    return None


def folder_in_use() -> Path:
    """Return the cache folder, or the temporary one that replaces a folder that cannot be written.

    Raises:
        CompileError: No folder can be written.
    """
    return _writable(folder())


def _pointer(at: Path, key: str, tools: str) -> Path:
    """Return the file that leads from a key to the hash of its source."""
    return at / "keys" / hashed(key, package_state(), tools)


def _tools(libraries: tuple[str, ...], flags: tuple[str, ...]) -> str:
    """Return a text that identifies compiler, flags and machine."""
    compiler = find_compiler()
    return " ".join([compiler.identity, *compiler.command, *flags, *NATIVE, *libraries, machine()])


@cache
def package_state() -> str:
    """Return a hash of the sizes and times of the package's files that generate the source."""
    root, lines = str(Path(__file__).parents[2]), []
    for place, inner, files in os.walk(root):
        left_out = UNREAD if place == root else ()
        inner[:] = [name for name in inner if name not in left_out]
        for name in files:
            if name.endswith((".py", ".h")):
                file = os.path.join(place, name)
                stat = os.stat(file)
                lines.append(f"{file[len(root) :]} {stat.st_size} {stat.st_mtime_ns}")
    return hashed(*sorted(lines))


def _load(at: Path, name: str) -> Built | None:
    """Return a built model if its files exist and are intact, else None."""
    try:
        described = at / "models" / f"{name}.json"
        record = json.loads(described.read_bytes())
        path = at / "libraries" / f"{record['library']}.so"
        if not (is_own(described) and is_own(path)):
            return None
        with contextlib.suppress(OSError):  # the file does not exist, or belongs to another user
            os.utime(path)  # protects it from eviction for some time
        whole = hashlib.sha256(path.read_bytes()).hexdigest() == record["library"]
        return Built(path, record["about"]) if whole and record["name"] == name else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _build(at: Path, name: str, source: Source, make: Callable[[Path], None]) -> Built:
    """Build a library at a path with `make`, and move it to its place."""
    at.mkdir(parents=True, exist_ok=True)  # the cache may have been emptied meanwhile
    with tempfile.TemporaryDirectory(dir=at, prefix="building-") as temporary:
        target = Path(temporary, "library.so")
        make(target)
        digest = hashlib.sha256(target.read_bytes()).hexdigest()
        path = at / "libraries" / f"{digest}.so"
        path.parent.mkdir(exist_ok=True, mode=0o700)
        target.chmod(0o700)
        os.replace(target, path)
    record = {"name": name, "library": digest, "about": source.about}
    _write(at / "models" / f"{name}.json", json.dumps(record).encode())
    remove_unused(at)
    return Built(path, source.about)


def _write(path: Path, content: bytes) -> None:
    """Write a file beside its place and move it there."""
    path.parent.mkdir(exist_ok=True, mode=0o700)
    with appearing(path) as draft:
        draft.touch(0o600)
        draft.write_bytes(content)


@cache
def _writable(at: Path) -> Path:
    """Return the cache folder, created if missing; a temporary one if it cannot be written."""
    try:
        at.mkdir(parents=True, exist_ok=True, mode=0o700)
        with tempfile.TemporaryFile(dir=at):
            return at
    except OSError as error:
        try:
            alone = tempfile.mkdtemp(prefix="hybridyn-")
        except OSError:
            raise CompileError(
                f"the cache folder '{at}' cannot be written: {error}; name another in {VARIABLE}"
            ) from error
        atexit.register(_remove_folder, Path(alone), os.getpid())
        return Path(alone)


def _remove_folder(alone: Path, owner: int) -> None:
    """Remove a temporary folder at the end of the process that made it, not of its forks."""
    if os.getpid() == owner:
        shutil.rmtree(alone, ignore_errors=True)
