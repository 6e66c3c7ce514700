"""Bags of ROS 2 as tables: joint states of one topic, read with rosbags (the extra `ros`), without ROS.

A bag is a folder with `metadata.yaml`. `BAG#/joint_states` names the topic where several have joint states.
Columns are `time`, since the first message, and `JOINT/position`, `/velocity` and `/effort`, as far as the
first message has them. A table of a motion has no efforts: only a reader that chooses columns sees them.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..description.records import Array
from ..errors import TrajectoryError, required

STATES = "sensor_msgs/msg/JointState"


def bag_columns(file: str) -> tuple[str, ...]:
    """Return all columns of a bag.

    Raises:
        HybridynError: rosbags is missing; the bag cannot be read, or its topic is in doubt.
    """
    first = next(_states(file), None)
    if first is None:
        raise TrajectoryError("has no joint state", file=file)
    _, message = first
    there = [what for what in ("position", "velocity", "effort") if len(getattr(message, what))]
    return ("time", *(f"{name}/{what}" for what in there for name in message.name))


def bag_parts(file: str, columns: Sequence[str], block_rows: int) -> Iterator[Array]:
    """Yield the rows of a bag in blocks, shape (rows, columns).

    Raises:
        TrajectoryError: A message lacks a joint or a number.
    """
    wanted = [name.rpartition("/")[::2] for name in columns]  # time has no joint
    rows = enumerate(_states(file), start=1)
    start = None
    while block := [*itertools.islice(rows, block_rows)]:
        start = block[0][1][0] if start is None else start
        out = np.empty((len(block), len(columns)))
        for row, (number, (time, message)) in zip(out, block, strict=True):
            at = {name: i for i, name in enumerate(message.name)}
            for i, (joint, what) in enumerate(wanted):
                if not joint:
                    row[i] = (time - start) / 1e9
                    continue
                numbers = getattr(message, what)
                if joint not in at or at[joint] >= len(numbers):
                    raise TrajectoryError("is missing in a message", file=file, row=number, column=columns[i])
                row[i] = numbers[at[joint]]
        yield out


def _states(file: str) -> Iterator[tuple[int, Any]]:
    """Yield the time [ns] and the message of each joint state, in the order of recording.

    Raises:
        HybridynError: As `bag_columns`.
    """
    highlevel = required("rosbags.highlevel", "ros", f"{file}: a bag")
    typesys = required("rosbags.typesys", "ros", f"{file}: a bag")
    folder, _, topic = file.partition("#")
    types = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
    try:
        with highlevel.AnyReader([Path(folder)], default_typestore=types) as bag:
            found = [one for one in bag.connections if one.msgtype == STATES and topic in ("", one.topic)]
            if len({one.topic for one in found}) != 1:
                names = sorted({one.topic for one in bag.connections if one.msgtype == STATES})
                said = ", ".join(names) or "none"
                raise TrajectoryError(
                    f"name one topic of joint states, as {folder}#/TOPIC; there are: {said}", file=file
                )
            for connection, recorded, raw in bag.messages(connections=found):
                message = bag.deserialize(raw, connection.msgtype)
                stamp = message.header.stamp
                yield (stamp.sec * 10**9 + stamp.nanosec) or recorded, message
    except (highlevel.AnyReaderError, OSError) as error:
        raise TrajectoryError(f"cannot be read: {error}", file=file) from error
