"""Choose the writer of a file by its ending.

A new format is one entry of `WRITERS`: a function that receives a `Request`, adds what is lost to `Losses`,
and returns `Written`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from ..description.closure_forms import words_of_rows
from ..description.names import did_you_mean
from ..description.records import Description
from ..errors import ModelError
from .mjcf.mjcf import write_mjcf
from .request import Losses, Request, Written
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
    d = _sayable(request.description, losses)
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


def _sayable(d: Description, losses: Losses) -> Description:
    """Return a robot without what no format says: closures without rows, terms of couplings that are zero.

    Args:
        losses: Receives what is left out.
    """
    rowless = [c.name for c in d.closures if not words_of_rows(c.translations, c.rotation)]
    for reason, names in (
        ("position limits of which the lower is above the upper", d.crossed),
        ("which part of a link is an added body", [load.name for load in d.loads]),
        ("closures left out, since they have no row", rowless),
    ):
        for name in names:
            losses.add(reason, name)
    return replace(
        d,
        name=d.name or "robot",
        closures=tuple(closure for closure in d.closures if closure.name not in rowless),
        couplings=tuple(
            replace(c, terms=tuple((name, factor) for name, factor in c.terms if factor)) for c in d.couplings
        ),
    )
