"""Choose the writer of a file by its ending.

A new format is one entry of `WRITERS`: a function from a `Request` to a `Written`. Writers are imported when
they are used.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from ..description.names import did_you_mean
from ..errors import ModelError
from .request import Request, Written


def _urdf(request: Request) -> Written:
    from .urdf.urdf import write_urdf

    return write_urdf(request)


def _mjcf(request: Request) -> Written:
    from .mjcf.mjcf import write_mjcf

    return write_mjcf(request)


def _sdf(request: Request) -> Written:
    from .sdf.sdf import write_sdf

    return write_sdf(request)


def _usd(request: Request) -> Written:
    from .usd.usd import write_usd

    return write_usd(request)


#: Writers by the ending of the file.
WRITERS: dict[str, Callable[[Request], Written]] = {
    ".urdf": _urdf,
    ".xml": _mjcf,
    ".sdf": _sdf,
    ".usda": _usd,
    ".usd": _usd,
}


def writer_of(target: Path) -> Callable[[Request], Written]:
    """Return the writer of a file.

    Raises:
        ModelError: No writer has this ending.
    """
    ending = target.suffix.lower()
    if ending in WRITERS:
        return WRITERS[ending]
    raise ModelError(
        f"unknown ending '{ending}'{did_you_mean(ending, WRITERS)}; known: {', '.join(WRITERS)}",
        file=str(target),
    )
