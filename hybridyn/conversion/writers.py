"""Choose the writer of a file by its ending.

A new format is one entry of `WRITERS`: a function that receives a `Request`, adds what is lost to `Losses`,
and returns `Written`. Writers are imported when they are used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..description.names import did_you_mean
from ..errors import ModelError
from .any_format import sayable
from .losses import Losses
from .request import Request, Written


def _urdf(request: Request, losses: Losses) -> Written:
    from .urdf.urdf import write_urdf

    return write_urdf(request, losses)


def _mjcf(request: Request, losses: Losses) -> Written:
    from .mjcf.mjcf import write_mjcf

    return write_mjcf(request, losses)


def _sdf(request: Request, losses: Losses) -> Written:
    from .sdf.sdf import write_sdf

    return write_sdf(request, losses)


def _usd(request: Request, losses: Losses) -> Written:
    from .usd.usd import write_usd

    return write_usd(request, losses)


#: Writers by the ending of the file.
WRITERS: dict[str, Callable[[Request, Losses], Written]] = {
    ".urdf": _urdf,
    ".xml": _mjcf,
    ".sdf": _sdf,
    ".usda": _usd,
    ".usd": _usd,
}


def write(request: Request) -> Written:
    """Return the text of a robot's file, the files beside it, and what is lost.

    Raises:
        ModelError: No writer has this ending, or the format cannot hold the robot.
    """
    losses = Losses()
    d = sayable(request.description, losses)
    written = writer_of(request.target)(replace(request, description=d), losses)
    return replace(written, losses=losses.lines())


def writer_of(target: Path) -> Callable[[Request, Losses], Written]:
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
