"""What reading a robot may take: one table of bounds for all formats, and the budget of one robot.

A hostile or broken file is huge, nests or repeats its parts, or names other files without end. A reader asks
here before it makes what a file states. Each refusal says what is too much, by number and bound.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple

from ..errors import ModelError


class Bound(NamedTuple):
    """The most that is read of something.

    Attributes:
        most: The bound.
        says: What a refusal says; "{most}", "{count}" and "{mend}" stand for the bound, for what was
            found, and for what to do.
        unit: Unit in which the bound is told [bytes]; what was found is then told in bytes.
        mend: What to do if nothing else is known.
    """

    most: int
    says: str
    unit: str = ""
    mend: str = ""


#: Bounds by what they are of. Those of one file, text or value:
BOUNDS = {
    "file": Bound(128 * 2**20, "is larger than {most}: {count}", "MiB"),
    # Side-cars, models and scenes have a few kilobytes, package.xml even less.
    "side-car": Bound(2**20, "is larger than {most}: {count}", "MiB"),
    # Aliases of aliases grow without bound.
    "values": Bound(100_000, "more than {most} values: {count}; are aliases nested?"),
    # Python's reader of TOML keeps a table for each prefix of a dotted key.
    "parts of a key": Bound(16, "a key has more than {most} parts: {count}"),
    # A number of characters or elements of a text or list, of digits, or of bits.
    "length": Bound(10_000, "too large: {count} characters, elements, bits or digits, limit {most}"),
    # A value with all that it holds: lists of lists share their parts, but are written as a whole.
    "value": Bound(10_000_000, "too large: a value of {count}, limit {most}", "MB"),
    "prims": Bound(100_000, "it has more than {most} prims: {count}"),
    "depth of models": Bound(50, "models are nested more than {most} deep: {count}"),
    # The time of MuJoCo's compiler grows with the square of their number.
    "replicas": Bound(
        50_000, "with its replicas, the file has more than {most} elements up to here: {count}"
    ),
    # Those of one robot with all its files. A stack of 1,000 six-legged modules has about 45 MiB, and half a
    # million elements.
    "XML": Bound(128 * 2**20, "{count} of XML, limit {most}", "MiB"),
    "elements": Bound(2_000_000, "{count} elements, limit {most}"),
    "files": Bound(1000, "more than {most} files are included: {count}"),
    # Files and packages for which xacro asks; robots include a few dozen files.
    "asked": Bound(10_000, "reads more than {most} files: {count}"),
    # What an expansion of xacro makes takes less than 10 s and 500 MB. A stack of 256 six-legged modules
    # (80,000 elements) makes 57 % of it; arms, hands and humanoids below 10 %.
    "made": Bound(
        500_000_000,
        "macros, blocks, includes and expressions make more than {most}: {count}; {mend}. If the robot is "
        "that large, expand it by the program xacro, and open what that writes",
        "MB",
        "find the macro that calls itself or repeats its blocks too often",
    ),
    # Those of the process of OpenUSD; a robot of 10,000 links takes 10 s.
    "memory": Bound(2 * 2**30, "{most} of memory", "GiB"),
    "seconds": Bound(120, "{most} s"),
}

#: Largest number that is told as it is.
COUNTED = 10**15

_UNITS = {"": 1, "MB": 10**6, "MiB": 2**20, "GiB": 2**30}


class RunawayError(ModelError):
    """A robot file, which calls itself or repeats its parts, makes or reads too much."""


def said(what: str, count: float = 0, mend: str = "") -> str:
    """Return what a refusal says of a bound; the arguments are those of `refuse_above`."""
    bound = BOUNDS[what]
    most = f"{bound.most / _UNITS[bound.unit]:,.4g} {bound.unit}" if bound.unit else f"{bound.most:,}"
    found = f"{int(count):,}" if count < COUNTED else f"{COUNTED:,} and more"
    return bound.says.format(most=most, count=found + bool(bound.unit) * " bytes", mend=mend or bound.mend)


def refuse_above(
    what: str, count: float, refuse: Callable[[str], Exception] = RunawayError, mend: str = ""
) -> None:
    """Raise for what is above its bound.

    Args:
        what: A key of `BOUNDS`.
        count: Its number.
        refuse: Makes the error of its message.
        mend: What to do, where more is known of it than the bound says.

    Raises:
        Exception: The number is above the bound; the message says both.
    """
    if count > BOUNDS[what].most:
        raise refuse(said(what, count, mend))


class Budget:
    """Counts what one robot takes."""

    def __init__(self) -> None:
        self._spent = dict.fromkeys(BOUNDS, 0.0)

    def spend(
        self, what: str, count: float, refuse: Callable[[str], Exception] = RunawayError, mend: str = ""
    ) -> None:
        """Count more of something; the arguments are those of `refuse_above`, which refuses the sum."""
        self._spent[what] += count
        if self._spent[what] > BOUNDS[what].most:
            refuse_above(what, self._spent[what], refuse, mend)

    def restart(self, what: str) -> None:
        """Count something from zero."""
        self._spent[what] = 0.0


#: Digest of each file that was read, by its path, while they are recorded.
_recorded: ContextVar[dict[str, str] | None] = ContextVar("files_read", default=None)


@contextmanager
def recorded() -> Iterator[dict[str, str]]:
    """Record the robot files that are read, also by an expansion of xacro that is kept.

    Yields:
        Digest of each file, by its absolute path.
    """
    found: dict[str, str] = {}
    token = _recorded.set(found)
    try:
        yield found
    finally:
        _recorded.reset(token)


def record(path: str | os.PathLike[str], content: bytes) -> None:
    """Record a file that was read."""
    found = _recorded.get()
    if found is not None:
        found[os.path.abspath(path)] = hashlib.sha256(content).hexdigest()


def content_of(path: str) -> bytes:
    """Read a file, and record it.

    Raises:
        OSError: The system cannot open or read the file.
        ModelError: It is not a regular file, or larger than the bound.
    """
    handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    with os.fdopen(handle, "rb") as file:
        about = os.fstat(handle)
        if not stat.S_ISREG(about.st_mode):
            raise ModelError(f"'{path}' is not a regular file")
        refuse_above("file", about.st_size, lambda message: ModelError(f"'{path}' {message}"))
        content = file.read(BOUNDS["file"].most)
    record(path, content)
    return content
