"""Checked poses of links, complete or partial, as the caller gives them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import numpy as np

from ..description.names import did_you_mean
from ..errors import TrajectoryError
from ..joints.kinds import LENGTHS
from ..linkage.motion import Motion
from ..linkage.targets import COORDINATES
from ..spatial import LARGEST, Array, rotation_from_quaternion
from ..structure.given import pose_numbers, triple
from ..structure.samples import as_numbers
from ..tables.signals import WORLD
from .orientation import PLACES, check_unit, direction_of, distance_of, rate_names, turn_of

#: Largest positions, rates and accelerations, and what messages say of it. A far position is out of reach.
MOST = (float(np.finfo(float).max), LARGEST, LARGEST)
AT_MOST = ("", *[f", at most {LARGEST:.0e}"] * 2)


class PoseRequest(NamedTuple):
    """A pose of a link relative to another: complete (`motion`), or some of its coordinates.

    Attributes:
        other: The reference link, or `WORLD` until `in_root` replaces it.
        motion: The complete pose with rates and accelerations, in the reference link, or None.
        coordinates: Coordinate name to its value, rate and acceleration, shape (3, T).
        turn: The complete orientation without the position, as a motion in the reference link, or None.
        frame: The motion of the reference link in the frame in which all this is measured; None for the
            link's own frame.
        direction: Number of an axis of the link and the directions in which it points, with their first two
            derivatives, shape (3, T, 3), or None.
        distance: The distance of the link's origin and its derivatives, shape (3, T), from a point, shape
            (3, T, 3), or None.
    """

    link: str
    other: str
    motion: Motion | None
    coordinates: dict[str, Array]
    turn: Motion | None = None
    frame: Motion | None = None
    direction: tuple[int, Array] | None = None
    distance: tuple[Array, Array] | None = None

    @property
    def reference(self) -> str:
        """Name of the reference, for messages."""
        return self.other if self.frame is None else WORLD

    @property
    def further(self) -> bool:
        """Whether it prescribes a direction or a distance."""
        return self.direction is not None or self.distance is not None

    def part(self, start: int, stop: int) -> PoseRequest:
        """Return the pose at some consecutive samples."""
        coordinates = {name: x[:, start:stop] for name, x in self.coordinates.items()}
        whole = self.motion, self.turn, self.frame
        motion, turn, frame = (x and x.take(np.arange(start, stop)) for x in whole)
        direction = self.direction and (self.direction[0], self.direction[1][:, start:stop])
        distance = self.distance and (self.distance[0][:, start:stop], self.distance[1][:, start:stop])
        return PoseRequest(self.link, self.other, motion, coordinates, turn, frame, direction, distance)


def pose_levels(key: str, value: object) -> list[Array] | dict[str, list[Array]]:
    """Return pose, twist and acceleration, shape (width,) or (T, width), or the triples of a partial pose."""
    one = isinstance(value, list | tuple) and all(isinstance(x, int | float) for x in value)
    parts = triple((value,) if one else value)
    if not isinstance(parts[0], Mapping):
        parts = (pose_numbers(key, parts[0]), *parts[1:])
        return [_array(key, part, width) for part, width in zip(parts, (7, 6, 6), strict=True)]
    out = {}
    if not parts[0]:
        raise TrajectoryError(f"the pose of '{key}' is empty; give some of {', '.join(PLACES)}", column=key)
    for name in parts[0]:
        check_known(name, PLACES, "coordinate", f" of '{key}'; known: {', '.join(PLACES)}")
    names = rate_names(parts[0], key)
    wanted = (set(parts[0]), set(names), set(names))
    for part, own in zip(parts, wanted, strict=True):
        if part is not None and not (isinstance(part, Mapping) and set(part) == own):
            raise TrajectoryError(
                f"the rates of '{key}' must name the coordinates of its pose ({', '.join(names)})", column=key
            )
    for name in dict.fromkeys((*parts[0], *names)):
        levels = tuple(part.get(name) if isinstance(part, Mapping) else None for part in parts)
        out[name] = level_triple(levels, f"coordinate '{name}' of '{key}'", key)
    return out


def pose_request(link: str, other: str, one: list[Array] | dict[str, list[Array]], T: int) -> PoseRequest:
    """Build the request of a pose at T samples: whole, or some coordinates and a complete orientation."""
    key = link if link == other else f"{link}@{other}"
    if isinstance(one, list):
        return PoseRequest(link, other, _motion(key, one, T), {})
    coordinates = for_all(one, T)
    turn = turn_of(coordinates, key)
    names = LENGTHS if turn is not None else COORDINATES
    some = {n: x for n, x in coordinates.items() if n in names}
    further = direction_of(coordinates, key), distance_of(coordinates, key)
    if turn is not None and set(LENGTHS) <= set(coordinates):
        return PoseRequest(link, other, turn, {}, None, None, *further)
    return PoseRequest(link, other, None, some, turn, None, *further)


def _array(key: str, value: object, width: int) -> Array:
    """Return one part of a pose, shape (width,) or (T, width), zero where omitted."""
    out = as_numbers(np.zeros(width) if value is None else value, f"the pose of '{key}'")
    level = int(width == 6)
    if out.shape[-1:] != (width,) or out.ndim > 2 or not (np.abs(out) <= MOST[level]).all():
        raise TrajectoryError(
            f"needs finite numbers of shape ({width},) or (T, {width}){AT_MOST[level]}"
            + (f" or a matrix or pin.SE3, such as {{{key!r}: [0, 0, 0.5, 0, 0, 0, 1]}}" if width == 7 else "")
            + f", not {out.shape}",
            column=key,
        )
    return out


def _motion(key: str, parts: list[Array], T: int) -> Motion:
    """Return the motion of a complete pose at all samples."""
    pose, twist, acceleration = (np.broadcast_to(x, (T, x.shape[-1])) for x in parts)
    check_unit(pose[:, 3:], key)
    return Motion(
        rotation_from_quaternion(pose[:, 3:]),
        pose[:, :3],
        twist[:, 3:],
        twist[:, :3],
        acceleration[:, 3:],
        acceleration[:, :3],
    )


def level_triple(value: object, what: str, column: str) -> list[Array]:
    """Return position, rate and acceleration of a coordinate, shape () or (T,) each, zero where omitted."""
    parts = [as_numbers(0.0 if x is None else x, what) for x in triple(value)]
    for level, x in enumerate(parts):
        if x.ndim > 1 or not (np.abs(x) <= MOST[level]).all():
            wanted = f"finite numbers of shape () or (T,){AT_MOST[level]}"
            raise TrajectoryError(f"{what} needs {wanted}", column=column)
    return parts


def for_all(triples: Mapping[str, list[Array]], T: int) -> dict[str, Array]:
    """Return positions, rates and accelerations at all samples, shape (3, T), by name."""
    return {name: np.stack([np.broadcast_to(x, (T,)) for x in parts]) for name, parts in triples.items()}


def check_known(name: str, known: Collection[str], what: str, otherwise: str = "") -> None:
    """Check that a name is known; `otherwise` is what is said where it resembles none that is."""
    if name not in known:
        hint = did_you_mean(name, known) or otherwise
        raise TrajectoryError(f"unknown {what} '{name}'{hint}", column=name)
