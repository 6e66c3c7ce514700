"""Define what a writer receives and what it returns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from ..description.records import Array, Description

ShapeKind = Literal["box", "cylinder", "sphere", "mesh"]

#: Distance by which closures may open in a simulator that holds them with springs [m], where left out.
TIGHTNESS = 1e-4


@dataclass(frozen=True)
class Shape:
    """A visual shape of a link.

    Attributes:
        kind: One of `ShapeKind`.
        placement: The shape's frame in the link, shape (4, 4). Boxes, cylinders (along z) and spheres are
            centred on it.
        size: Of a box its three edges, of a cylinder radius and length, of a sphere the radius [m]; of a mesh
            its scale along x, y and z.
        file: Address of a mesh (`package://...`) as its author wrote it, or its path from the folder of the
            file to be written; "" for other kinds.
        path: The mesh on this machine, or None if it was not found.
        colour: Red, green, blue and opacity from 0 to 1, or None.
    """

    link: str
    kind: ShapeKind
    placement: Array
    size: tuple[float, ...]
    file: str = ""
    path: Path | None = None
    colour: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class Request:
    """A robot to be written.

    Attributes:
        description: The robot.
        target: The file to be written; a writer does not write it, but may refer to other files from it.
        shapes: The visual shapes of its links.
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
        losses: What the format cannot say, one line each, with the names of joints, links and closures. What
            hybridyn reads back from the files beside is not lost.
        notes: Remarks for the user that are no losses.
        beside: Content of the files beside it that hybridyn also reads, by their ending: ".model.toml" after
            the file's name (see `model_file`), ".yaml" in place of its ending.
    """

    text: str
    losses: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    beside: Mapping[str, str] = field(default_factory=dict)
