"""Define what a writer receives and what it returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ..description.records import Description
from ..description.urdf.shapes import Shape

#: Distance by which closures may open in a simulator that holds them with springs [m], where left out.
TIGHTNESS = 1e-4
#: Gravity of a robot whose file states none [m/s^2].
USUAL_GRAVITY = (0.0, 0.0, -9.81)


@dataclass(frozen=True)
class Request:
    """A robot to be written.

    Attributes:
        description: The robot.
        target: The file to be written; a writer does not write it, but may refer to other files from it.
        shapes: The visual shapes of its links; a mesh is named by its address, or by its path from the folder
            of the file to be written.
        tightness: Distance by which closures may open in a simulator that holds them with springs [m].
    """

    description: Description
    target: Path
    shapes: tuple[Shape, ...] = ()
    tightness: float = TIGHTNESS


@dataclass(frozen=True)
class Written:
    """What a writer returns.

    Attributes:
        text: The content of the file.
        notes: Remarks for the user that are no losses.
        beside: Content of the files beside it that hybridyn also reads, by their ending: ".model.toml" after
            the file's name (see `model_file`), ".yaml" in place of its ending.
        losses: What the format cannot say, one line each, with the names of joints, links and closures. What
            hybridyn reads back from the files beside is not lost. `writers.write` adds them.
    """

    text: str
    notes: tuple[str, ...] = ()
    beside: Mapping[str, str] = field(default_factory=dict)
    losses: tuple[str, ...] = ()
