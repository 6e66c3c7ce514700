"""Bags of ROS 2 are tables: the same numbers as in a CSV file with the same motion."""

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.cli import main
from hybridyn.errors import TrajectoryError
from hybridyn.tables.opening import open_table, read_columns
from tests.support.extras import needs

needs("ros", "rosbags")

from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

MOTORS = ("m1_left_drive", "m1_right_drive")
TYPES = get_typestore(Stores.ROS2_JAZZY)
#: Start of the recording [ns]: the year 2026.
START = 1_780_000_000_000_000_000


def write(
    bag: Path, messages: list[dict[str, Any]], topics: tuple[str, ...] = ("/motor_states",),
    storage: StoragePlugin = StoragePlugin.SQLITE3,
) -> Path:  # fmt: skip
    """Write joint states, with their times [ns], on topics."""
    kinds = TYPES.types
    with Writer(bag, version=9, storage_plugin=storage) as writer:
        for topic in topics:
            at = writer.add_connection(topic, "sensor_msgs/msg/JointState", typestore=TYPES)
            for message in messages:
                t, names = message["time"], message["names"]
                stamp = kinds["builtin_interfaces/msg/Time"](sec=t // 10**9, nanosec=t % 10**9)
                numbers = (np.array(message.get(what, []), dtype=float) for what in ("p", "v", "e"))
                state = kinds["sensor_msgs/msg/JointState"](
                    kinds["std_msgs/msg/Header"](stamp=stamp, frame_id=""), list(names), *numbers
                )
                writer.write(at, t, TYPES.serialize_cdr(state, "sensor_msgs/msg/JointState"))
    return bag


def recorded(folder: Path) -> tuple[Path, Path]:
    """Write a swing with efforts as a bag, whose joints change places, and as a CSV file."""
    robot, rows = hybridyn.load("five_bar"), []
    for t in range(0, 2_000_000_000, 10_000_000):
        w, s = 3.0, t / 1e9
        p = [0.3 * np.sin(w * s), 0.2 * np.cos(w * s) - 0.2]
        v = [0.3 * w * np.cos(w * s), -0.2 * w * np.sin(w * s)]
        rows.append({"time": START + t, "names": MOTORS, "p": p, "v": v})
    whole = [np.array([row[what] for row in rows]) for what in ("p", "v")]
    a = -9.0 * (whole[0] + [0.0, 0.2])
    tau = hybridyn.idm(robot, *hybridyn.assemble(robot, motors=(*whole, a), guess=robot.home))
    for row, effort in zip(rows, tau, strict=True):
        row["e"] = effort
    file = folder / "swing.csv"
    with file.open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["time", *(f"{m}/{x}" for x in ("position", "velocity", "effort") for m in MOTORS)])
        writer.writerows([(r["time"] - START) / 1e9, *r["p"], *r["v"], *r["e"]] for r in rows)
    turned = [
        row if i % 2 else {key: x if key == "time" else x[::-1] for key, x in row.items()}
        for i, row in enumerate(rows, 1)
    ]
    return write(folder / "bag", turned, storage=StoragePlugin.MCAP), file  # as `ros2 bag record` of Jazzy


def test_a_bag_holds_the_numbers_of_a_csv_file(tmp_path: Path) -> None:
    bag, file = recorded(tmp_path)
    with open_table(file) as table:
        columns = table.columns
    with open_table(bag, choose=lambda every: columns) as table:
        values = np.concatenate([block.values for block in table.blocks])
    np.testing.assert_array_equal(values, read_columns(file, columns))


def test_efforts_are_computed_from_a_bag(tmp_path: Path) -> None:
    bag, file = recorded(tmp_path)
    plain = tmp_path / "plain.csv"  # a motion has no efforts
    rows = [line.split(",") for line in file.read_text().splitlines()]
    plain.write_text("\n".join(",".join(row[:5]) for row in rows) + "\n")
    for source in (bag, plain):
        assert main(["idm", "five_bar", str(source), "-o", f"{source}.out.csv", "-q"]) == 0
    assert Path(f"{bag}.out.csv").read_text() == Path(f"{plain}.out.csv").read_text()


def test_parameters_are_identified_from_a_bag(tmp_path: Path) -> None:
    bag, file = recorded(tmp_path)
    robot = hybridyn.load("five_bar")
    one, other = (hybridyn.identify(robot, str(source), effects=["default"]) for source in (bag, file))
    np.testing.assert_array_equal(one.values, other.values)


def test_the_topic_is_named_where_several_have_joint_states(tmp_path: Path) -> None:
    message = {"time": START, "names": ["j"], "p": [0.5]}
    bag = write(tmp_path / "bag", [message], ("/a", "/b"))
    with pytest.raises(TrajectoryError, match="there are: /a, /b"):
        read_columns(bag, ["j/position"])
    assert read_columns(f"{bag}#/b", ["time", "j/position"]).tolist() == [[0.0, 0.5]]


WRONG: dict[str, tuple[list[dict[str, Any]], str]] = {
    "no message": ([], "has no joint state"),
    "a joint is missing": (
        [{"time": 1, "names": ["j"], "p": [0.5]}, {"time": 2, "names": ["k"], "p": [0.5]}],
        "row 2, column 'j/position': is missing in a message",
    ),
    "not a number": ([{"time": 1, "names": ["j"], "p": [np.nan]}], "not a finite number: nan"),
}


@pytest.mark.parametrize(("messages", "said"), WRONG.values(), ids=WRONG)
def test_a_wrong_bag_is_one_line(tmp_path: Path, messages: list[dict[str, Any]], said: str) -> None:
    bag = write(tmp_path / "bag", messages)
    with pytest.raises(TrajectoryError) as error:
        read_columns(bag, ["time", "j/position"])
    assert said in str(error.value)


def test_a_broken_bag_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "metadata.yaml").write_text("nothing: here\n")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        read_columns(tmp_path, ["time"])
