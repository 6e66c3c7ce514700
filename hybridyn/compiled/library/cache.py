"""Cache of built libraries in the user's cache folder.

    keys/<name>          hash of a library's file, and the description of its programs
    libraries/<hash>.so  libraries by their own hash

A key's name is the hash of a cheap description of the model, or of the source that it led to.

Each file is written beside its place and then moved there, so several processes may build at the same time.
A file is built again if it is truncated, if its name does not match its content, or if another user may have
written it (`description.cache_folder`).

The least recently used libraries are removed when the cache exceeds `LIMIT`. A library's modification time is
the time of its last use. A loaded library stays usable after its file is removed. A process whose file is
removed before it is loaded builds it again (`Artifact.loaded`). So no process waits for another.
"""

from __future__ import annotations

import atexit
import contextlib
import hashlib
import json
import os
import re
import shutil
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...description.cache_folder import VARIABLE, folder, hashed, is_own
from ...description.writing import appearing
from ...errors import CompileError
from .building import FLAGS, KEEP_C, NATIVE, build, find_compiler, machine

if TYPE_CHECKING:
    from ..code.library_source import Source

#: Size of the cached libraries [bytes]; the library of a robot with 24 motors has 400,000.
LIMIT = 256 * 2**20
#: Time after its last use in which a library is never removed [s].
IN_USE = 3600.0
#: Age from which unfinished files are taken to be left by a killed process [s].
ABANDONED = 86400.0
#: Most letters of names in the name of a folder with kept C; systems allow 255.
MOST_LETTERS = 150


def remove_unused(at: Path) -> None:
    """Remove libraries beyond `LIMIT`, the keys that lead to them, and abandoned files."""
    libraries, room = at / "libraries", LIMIT
    for path in sorted(libraries.glob("*.so"), key=_age_and_size):
        age, size = _age_and_size(path)
        room -= size
        if room < 0 and age > IN_USE:
            _remove(path)
    for key in (at / "keys").glob("[0-9a-f]*") if room < 0 else ():  # written after their library
        with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
            if (libraries / f"{json.loads(key.read_bytes())['library']}.so").exists():
                continue
        _remove(key)
    for path in [*at.glob("building-*"), *at.glob("keys/.*")]:
        if _age_and_size(path)[0] > ABANDONED:
            shutil.rmtree(path, ignore_errors=True)
            _remove(path)


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
    """

    path: Path
    about: dict[str, Any]


def folder_in_use() -> Path:
    """Return the cache folder, or the temporary one that replaces a folder that cannot be written.

    Raises:
        CompileError: No folder can be written.
    """
    return _writable(folder())


def name_of_key(key: str, libraries: tuple[str, ...]) -> str:
    """Return the name of a key: a hash of its text, of the package, and of all that builds the library."""
    return hashed(key, package_state(), _tools(libraries))


def _tools(libraries: tuple[str, ...]) -> str:
    """Return a text that identifies compiler, flags and machine."""
    compiler = find_compiler()
    file = os.stat(compiler[0])  # asking for its version costs more
    state = [*compiler, str(file.st_size), str(file.st_mtime_ns)]
    return " ".join([*state, *FLAGS, *NATIVE, *libraries, os.environ.get(KEEP_C, ""), machine()])


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


def kept(at: Path, name: str) -> Built | None:
    """Return the library of a key if its files exist and are intact, else None."""
    try:
        key = at / "keys" / name
        record = json.loads(key.read_bytes())
        path = at / "libraries" / f"{record['library']}.so"
        if not (is_own(key) and is_own(path)):
            return None
        with contextlib.suppress(OSError):  # a read-only file
            os.utime(path)  # protects it from eviction for some time
        whole = hashlib.sha256(path.read_bytes()).hexdigest() == record["library"]
        return Built(path, record["about"]) if whole else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def keep(at: Path, name: str, built: Built) -> None:
    """Let a key lead to a library."""
    record = {"library": built.path.stem, "about": built.about}
    path = at / "keys" / name
    path.parent.mkdir(exist_ok=True, mode=0o700)
    with appearing(path) as draft:
        draft.touch(0o600)
        draft.write_text(json.dumps(record))


def library_of_source(
    at: Path, source: Source, libraries: tuple[str, ...], jobs: int | None, robot: str
) -> Built:
    """Return the library of a source from the cache, or build it; errors are those of `building.build`."""
    name = hashed(*source.units.values(), json.dumps(source.about, sort_keys=True), _tools(libraries))
    if (found := kept(at, name)) is not None:
        return found
    at.mkdir(parents=True, exist_ok=True)  # the cache may have been emptied meanwhile
    with tempfile.TemporaryDirectory(dir=at, prefix="building-") as temporary:
        target = Path(temporary, "library.so")
        kept_at = kept_c(robot, source, name)
        build(source.units, find_compiler(), target, libraries, jobs, kept_at)
        path = at / "libraries" / f"{hashlib.sha256(target.read_bytes()).hexdigest()}.so"
        path.parent.mkdir(exist_ok=True, mode=0o700)
        target.chmod(0o700)
        os.replace(target, path)
    made = Built(path, source.about)
    keep(at, name, made)
    remove_unused(at)
    return made


def kept_c(robot: str, source: Source, name: str) -> Path | None:
    """Return the folder for a library's C, of the robot's and programs' names; None if none is wanted."""
    if not (within := os.environ.get(KEEP_C)):
        return None
    words = re.sub(r"[^\w.-]+", "_", "-".join([robot, *source.about["programs"]]))
    return Path(within, f"{words[:MOST_LETTERS]}-{name[:8]}")


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
