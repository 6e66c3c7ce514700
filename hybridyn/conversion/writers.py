"""Choose the writer of a file by its ending.

A new format is one entry of `WRITERS`: a function that receives a `Request`, adds what is lost to `Losses`,
and returns `Written`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..description.names import did_you_mean
from ..errors import ModelError
from .any_format import sayable
from .losses import Losses
from .mjcf.mjcf import write_mjcf
from .request import Request, Written
from .sdf.sdf import write_sdf
from .urdf.urdf import write_urdf
from .usd.usd import write_usd

#: Writers by the ending of the file.
WRITERS: dict[str, Callable[[Request, Losses], Written]] = {
    ".urdf": write_urdf,
    ".xml": write_mjcf,
    ".sdf": write_sdf,
    ".usda": write_usd,
    ".usd": write_usd,
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
