"""Films without a screen: a motion, or a walk around a robot that stands still, as MP4."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import TrajectoryError, install_advice
from ..spatial import Array
from ..structure.robot import HybridRobot
from .camera import camera_around
from .picture import Picture
from .placing import extent, place_bodies
from .render import Image, labelled, render
from .run import Run

#: Pictures per second.
RATE = 25
#: Seconds of a film: a longer motion is shown faster.
LONGEST = 20.0
#: Seconds of a walk around.
AROUND = 6.0
#: Samples of a motion that the camera is set up for.
LOOKS = 40
#: Of imageio-ffmpeg, 0 to 10.
QUALITY = 7


def corners_of(robot: HybridRobot, picture: Picture, run: Run) -> Array:
    """Return the box that holds a robot all along a motion, shape (2, 3), [m]."""
    samples = np.unique(np.linspace(0, len(run.q) - 1, LOOKS).round().astype(int))
    boxes = np.array([extent(picture, place_bodies(robot, run.q[i])) for i in samples])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def frames_of_run(
    robot: HybridRobot, picture: Picture, run: Run, size: tuple[int, int], *, own_colours: bool = False
) -> Iterator[Image]:
    """Return the pictures of a motion in its own time, faster where it is longer than `LONGEST`.

    Args:
        robot: The robot.
        picture: What is drawn.
        run: The motion.
        size: Width and height [pixels].
        own_colours: Whether shapes keep the colours of their files.

    Yields:
        Pictures, `RATE` of them per second.
    """
    camera = camera_around(corners_of(robot, picture, run), *size)
    count, speed = pictures_of(run)
    faster = f", shown {speed:.3g} times as fast" if speed > 1 and run.timed else ""
    for at in np.linspace(run.begin, run.end, count):
        number = run.index(float(at))
        image = render(picture, place_bodies(robot, run.q[number]), camera, own_colours=own_colours)
        text = f"{robot.name}   {at:.2f} s{faster}" if run.timed else f"{robot.name}   row {number + 1}"
        yield labelled(image, text)


def pictures_of(run: Run | None) -> tuple[int, float]:
    """Return how many pictures a film has, and how many times as fast as the motion it runs.

    Args:
        run: The motion, or None for a walk around a robot that stands still.
    """
    if run is None:
        return round(AROUND * RATE), 1.0
    span = run.end - run.begin if run.timed else len(run.q) / RATE
    speed = max(span / LONGEST, 1.0)
    return max(2, round(RATE * span / speed)), speed


def frames_around(
    robot: HybridRobot, picture: Picture, q: Array, size: tuple[int, int], *, own_colours: bool = False
) -> Iterator[Image]:
    """Return the pictures of a walk around a robot that stands still; arguments as for `frames_of_run`."""
    placement = place_bodies(robot, q)
    count, _ = pictures_of(None)
    corners = extent(picture, placement)
    middle, reach = corners.mean(axis=0), float(np.linalg.norm(np.ptp(corners, axis=0)[:2])) / 2
    # As seen from every side the same: the box that the walk leaves in view.
    around = np.array([middle - reach, middle + reach])
    around[:, 2] = corners[:, 2]
    for turn in np.linspace(0, 2 * np.pi, count, endpoint=False):
        camera = camera_around(around, *size, turn=float(turn) - 0.9)
        yield labelled(render(picture, placement, camera, own_colours=own_colours), robot.name)


def save_mp4(frames: Iterator[Image], size: tuple[int, int], file: str) -> int:
    """Write pictures as a film.

    Args:
        frames: The pictures.
        size: Width and height [pixels], even numbers.
        file: The film's file.

    Returns:
        The number of pictures.

    Raises:
        TrajectoryError: The writer of films is missing.
    """
    try:
        import imageio_ffmpeg
    except ImportError as error:
        message = f"films need imageio-ffmpeg: {install_advice('view')}"
        raise TrajectoryError(message) from error
    writer = imageio_ffmpeg.write_frames(
        file, size, fps=RATE, quality=QUALITY, macro_block_size=2, ffmpeg_log_level="error"
    )
    writer.send(None)
    count = 0
    try:
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
            count += 1
    finally:
        writer.close()
    return count
