"""Write MP4 videos without a screen: of a motion, or of a camera orbit around a robot at rest."""

from __future__ import annotations

import contextlib
import errno
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


def corners_of(robot: HybridRobot, picture: Picture, run: Run) -> Array:
    """Compute the bounding box of a robot over a motion in the world, shape (2, 3), [m]."""
    samples = np.unique(np.linspace(0, len(run.q) - 1, LOOKS).round().astype(int))
    boxes = np.array([extent(picture, place_bodies(robot, run.q[i])) for i in samples])
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def frames_of_run(
    robot: HybridRobot, picture: Picture, run: Run, size: tuple[int, int], *, own_colours: bool = False
) -> Iterator[Image]:
    """Render the frames of a motion in real time, or faster if it is longer than `LONGEST`.

    Args:
        picture: The robot's shapes.
        size: Width and height [pixels].
        own_colours: Whether shapes keep the colours of their files.

    Yields:
        Images, `RATE` of them per second.
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
    """Compute the number of frames of a film and its speed relative to the motion.

    Args:
        run: The motion, or None for an orbit around a robot at rest.
    """
    if run is None:
        return round(AROUND * RATE), 1.0
    span = run.end - run.begin if run.timed else len(run.q) / RATE
    speed = max(span / LONGEST, 1.0)
    return max(2, round(RATE * span / speed)), speed


def frames_around(
    robot: HybridRobot, picture: Picture, q: Array, size: tuple[int, int], *, own_colours: bool = False
) -> Iterator[Image]:
    """Render the frames of an orbit around a robot at rest; arguments as for `frames_of_run`."""
    placement = place_bodies(robot, q)
    count, _ = pictures_of(None)
    corners = extent(picture, placement)
    middle, reach = corners.mean(axis=0), float(np.linalg.norm(np.ptp(corners, axis=0)[:2])) / 2
    # A box that has the same extent from every side stays in view during the orbit.
    around = np.array([middle - reach, middle + reach])
    around[:, 2] = corners[:, 2]
    for turn in np.linspace(0, 2 * np.pi, count, endpoint=False):
        camera = camera_around(around, *size, turn=float(turn) - 0.9)
        yield labelled(render(picture, placement, camera, own_colours=own_colours), robot.name)


def save_mp4(frames: Iterator[Image], size: tuple[int, int], file: str) -> int:
    """Write frames as a video file.

    Args:
        size: Width and height [pixels], even numbers.
        file: Name of the video file.

    Returns:
        The number of images.

    Raises:
        TrajectoryError: imageio-ffmpeg is not installed.
        OSError: ffmpeg ended before the film was complete, as on a full disk.
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
