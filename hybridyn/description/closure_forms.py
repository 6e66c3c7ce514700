"""Define the closures that files name ("revolute", "rows", ...), in the form of `records.Closure`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from .placement import turned
from .records import Array, Closure, RotationKind

#: One side of a closure: link, and the frame placed on it by the author, shape (4, 4).
Side = tuple[str, Array]


@dataclass(frozen=True, eq=False)
class Form:
    """The translations and rotations that a kind of closure locks; its axis is z.

    Attributes:
        translations: Axes of frame A along which B's origin may not move.
        rotation: The locked part of the rotation.
        has_axis: Whether this kind of closure has an axis.
        rotation_of_frames: Rotation of both frames about their own axes that brings the closure into this
            form, shape (3, 3).
    """

    translations: tuple[int, ...]
    rotation: RotationKind
    has_axis: bool = True
    rotation_of_frames: Array = field(default_factory=lambda: np.eye(3))


#: Closures by name; in this order they have 6, 5, 5, 5, 4, 4, 3, 3 and 3 rows.
FORMS: dict[str, Form] = {
    "fixed": Form((0, 1, 2), "fixed", has_axis=False),
    "revolute": Form((0, 1, 2), "parallel"),
    "continuous": Form((0, 1, 2), "parallel"),
    "prismatic": Form((0, 1), "fixed"),
    "cylindrical": Form((0, 1), "parallel"),
    "universal": Form((0, 1, 2), "perpendicular"),
    "planar": Form((2,), "parallel"),
    "spherical": Form((0, 1, 2), "free", has_axis=False),
    "point": Form((0, 1, 2), "free", has_axis=False),
}

#: Rows of a general closure: translations along and rotations about the axes of the predecessor frame.
ROWS = ("tx", "ty", "tz", "rx", "ry", "rz")
#: Largest cosine between the axes of a universal joint in a file: files keep 5 or 6 digits.
LARGEST_COSINE = 1e-5
#: The rotation row of a universal joint: the third axes of both frames stay perpendicular.
PERPENDICULAR = "perpendicular"
#: Axes of the second frame in the first one where a follower of MJCF has a universal closure at zero.
SIDEWAYS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])

SINGLE_ROTATION = (
    "a single rotation row is not holonomic, so it closes no loop by itself; "
    'lock two (the remaining axes stay parallel), three or none, or use type="universal" '
    "(two axes kept perpendicular)"
)


def closure_of(
    name: str,
    kind: str,
    sides: Iterable[Side],
    turns: Sequence[Array] = (np.eye(3),) * 2,
    form: Form | None = None,
    line: int | None = None,
) -> Closure:
    """Return the closure of a kind.

    Args:
        name: Its name.
        kind: Its kind, a key of `FORMS` where no form is given.
        sides: Both sides.
        turns: Rotations of both frames about their own axes that map z to the closure's axis, shapes (3, 3).
        form: Its form, where that is not the one of its kind.
        line: Line in the file, or None.
    """
    form = form or FORMS[kind]
    (link_a, at_a), (link_b, at_b) = sides
    frames = turned(at_a, turns[0]), turned(at_b, turns[1])
    return Closure(
        name, kind, link_a, frames[0], link_b, frames[1], form.translations, form.rotation, line, turns[0]
    )


def form_of_rows(text: str) -> Form:
    """Convert `rows="tx ty rx ry"` to canonical form by a cyclic permutation of the frames' axes.

    Two locked rotations leave the third axes of both frames parallel; that axis becomes z.

    Raises:
        ValueError: A row is unknown or repeated, there is no row, or a single rotation is locked.
    """
    words = text.split()
    for word in words:
        if word not in (*ROWS, PERPENDICULAR):
            raise ValueError(f"unknown row '{word}'; rows are {' '.join((*ROWS, PERPENDICULAR))}")
    if len(set(words)) != len(words):
        raise ValueError("a row is stated twice")
    if not words:
        raise ValueError("no row is stated, so nothing is closed")
    locked, turns = ([axis for axis in range(3) if kind + "xyz"[axis] in words] for kind in "tr")
    if PERPENDICULAR in words and turns:
        raise ValueError(f"'{PERPENDICULAR}' is the only rotation row that may be stated with itself")
    if len(turns) == 1:
        raise ValueError(SINGLE_ROTATION)
    if len(turns) == 2:
        z = ({0, 1, 2} - set(turns)).pop()
        order = [(z + 1) % 3, (z + 2) % 3, z]
        translations = tuple(sorted(order.index(axis) for axis in locked))
        return Form(translations, "parallel", rotation_of_frames=np.eye(3)[:, order])
    return Form(tuple(locked), "perpendicular" if PERPENDICULAR in words else "fixed" if turns else "free")


def words_of_rows(translations: tuple[int, ...], rotation: RotationKind) -> list[str]:
    """Return the rows of a closure in canonical form, the inverse of `form_of_rows`."""
    turns = {"free": (), "perpendicular": (PERPENDICULAR,), "parallel": ROWS[3:5], "fixed": ROWS[3:]}
    return [ROWS[axis] for axis in translations] + [*turns[rotation]]
