"""Render pictures and MP4 videos without a screen: of a motion, or around a robot at rest."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..spatial import Array
from ..structure.robot import HybridRobot
from .camera import FRONT, camera_around
from .picture import Picture
from .placing import Placement, extent, place_bodies
from .render import Image, labelled, render
from .run import ShownMotion

#: Frames per second.
RATE = 25
#: Longest duration of a film [s]. A longer motion is played faster.
LONGEST = 20.0
#: Duration of an orbit [s].
AROUND = 6.0
#: Number of samples of a motion used to place the camera.
LOOKS = 40
#: Quality setting of imageio-ffmpeg, 0 to 10.
QUALITY = 7


def corners_of(robot: HybridRobot, picture: Picture, run: ShownMotion) -> Array:
    """Compute the bounding box of a robot over a motion in the world, shape (2, 3), [m]."""
    samples = np.unique(np.linspace(0, len(run.q) - 1, LOOKS).round().astype(int))
    boxes = np.array([extent(picture, place_bodies(robot, run.q[i])) for i in samples])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


class Shot(NamedTuple):
    """A robot as pictures and films show it.

    Attributes:
        robot: The robot.
        picture: Its shapes.
        size: Width and height [pixels].
        own_colours: Whether shapes keep the colours of their files.
    """

    robot: HybridRobot
    picture: Picture
    size: tuple[int, int]
    own_colours: bool = False

    def image(self, placement: Placement, corners: Array, text: str, turn: float = FRONT) -> Image:
        """Render the robot at a posture.

        Args:
            placement: Poses of its bodies.
            corners: Box that the camera sees, shape (2, 3), [m].
            text: Label after the robot's name.
            turn: Azimuth of the camera about the vertical [rad].
        """
        camera = camera_around(corners, *self.size, turn=turn)
        image = render(self.picture, placement, camera, own_colours=self.own_colours)
        return labelled(image, f"{self.robot.name}{text}")


def still(shot: Shot, run: ShownMotion | None, at: float | None) -> Image:
    """Render the robot at a time of a motion, or at its start; at home without one."""
    number = 0 if run is None or at is None else run.index(at)
    placement = place_bodies(shot.robot, shot.robot.home if run is None else run.q[number])
    when = f"   {run.time[number]:.2f} s" if run is not None and run.timed else ""
    return shot.image(placement, extent(shot.picture, placement), when)


def frames_of_run(shot: Shot, run: ShownMotion) -> Iterator[Image]:
    """Render the frames of a motion in real time, or faster if it is longer than `LONGEST`.

    Yields:
        Images, `RATE` of them per second.
    """
    corners = corners_of(shot.robot, shot.picture, run)
    count, speed = pictures_of(run)
    faster = f", shown {speed:.3g} times as fast" if speed > 1 and run.timed else ""
    for at in np.linspace(run.begin, run.end, count):
        number = run.index(float(at))
        text = f"   {at:.2f} s{faster}" if run.timed else f"   row {number + 1}"
        yield shot.image(place_bodies(shot.robot, run.q[number]), corners, text)


def frames_around(shot: Shot, q: Array) -> Iterator[Image]:
    """Render the frames of an orbit around a robot at rest, positions of shape (nq,)."""
    placement = place_bodies(shot.robot, q)
    count, _ = pictures_of(None)
    corners = extent(shot.picture, placement)
    middle, reach = corners.mean(axis=0), float(np.linalg.norm(np.ptp(corners, axis=0)[:2])) / 2
    # A box that has the same extent from every side stays in view during the orbit.
    around = np.array([middle - reach, middle + reach])
    around[:, 2] = corners[:, 2]
    for turn in np.linspace(0, 2 * np.pi, count, endpoint=False):
        yield shot.image(placement, around, "", float(turn) + FRONT)


def pictures_of(run: ShownMotion | None) -> tuple[int, float]:
    """Compute the number of frames of a film and its speed relative to the motion.

    Args:
        run: The motion, or None for an orbit around a robot at rest.
    """
    if run is None:
        return round(AROUND * RATE), 1.0
    span = run.end - run.begin if run.timed else len(run.q) / RATE
    speed = max(span / LONGEST, 1.0)
    return max(2, round(RATE * span / speed)), speed


def save_mp4(frames: Iterator[Image], size: tuple[int, int], file: str) -> int:
    """Write frames as a video file.

    Args:
        size: Width and height [pixels], even numbers.
        file: Name of the video file.

    Returns:
        The number of images.

    Raises:
        OSError: ffmpeg ended before the film was complete, as on a full disk.
    """
    import imageio_ffmpeg

    writer = imageio_ffmpeg.write_frames(
        file, size, fps=RATE, quality=QUALITY, macro_block_size=2, ffmpeg_log_level="error"
    )
    writer.send(None)
    count, kept = 0, -1
    try:
        for frame in frames:
            try:
                writer.send(np.ascontiguousarray(frame))
            except OSError:  # ffmpeg has ended; its message names neither the file nor the reason
                break
            count += 1
        else:
            writer.close()
            with contextlib.suppress(RuntimeError):  # not a film
                kept = imageio_ffmpeg.count_frames_and_secs(file)[0]
    finally:
        writer.close()
    if kept != count:
        raise OSError(errno.EIO, "the film is not complete; is the disk full?", file)
    return count
