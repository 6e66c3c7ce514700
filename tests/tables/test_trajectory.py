"""From tables to motion: rates given or fitted, poses, states; changed tables are read or refused by name."""

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description.records import Description
from hybridyn.errors import TrajectoryError
from hybridyn.tables.columns import read_layout
from hybridyn.tables.opening import open_table
from hybridyn.tables.results import open_results
from hybridyn.tables.trajectory import TableMotion, read_motions
from hybridyn.tables.tree_coordinates import full_state
from tests.support.comparing import ROUNDING, refused
from tests.support.files import save
from tests.support.samples import slow
from tests.support.waiting import outcome
from tests.tables.arm import ARM, BALL

FIT = 1e-6  # fitted accelerations of the motions below, sampled at 100 Hz
DIFFERENCES = 1e-6  # central differences at 1e-5 s of motions of order one

TIME = 0.01 * np.arange(700)


def motions(
    tmp_path: Path,
    columns: dict[str, np.ndarray],
    robot: Description = ARM,
    base: str = "fixed",
    block_rows: int = 2000,
) -> list[TableMotion]:
    path = tmp_path / "t.csv"
    with open_results(path, list(columns)) as write:
        write(np.column_stack(list(columns.values())))
    motors = [joint.name for joint in robot.joints if joint.kind != "spherical"]
    with open_table(path, block_rows=block_rows) as table:
        layout = read_layout(table.columns, robot, motors=motors, base=base, file=str(path))
        return list(read_motions(table, layout))


def pose_columns(owner: str, pose: np.ndarray) -> dict[str, np.ndarray]:
    names = ("x", "y", "z", "qx", "qy", "qz", "qw")
    return {f"{owner}/pose/{name}": pose[:, index] for index, name in enumerate(names)}


def pose_at(t: float) -> pin.SE3:
    """Return some smooth pose."""
    turn = pin.exp3(np.array([0.4 * np.sin(t), 0.9 * np.cos(1.3 * t), 0.5 * t]))
    return pin.SE3(turn, np.array([np.sin(t), np.cos(0.7 * t), 0.2 * t]))


def poses_of(time: np.ndarray) -> np.ndarray:
    return np.array([pin.SE3ToXYZQUAT(pose_at(t)) for t in time])


def test_rates_that_are_given_are_taken_as_they_are(tmp_path: Path) -> None:
    generator = np.random.default_rng(0)
    rates = ("position", "velocity", "acceleration")
    columns = {f"{name}/{rate}": generator.normal(size=5) for name in ("lift", "spin") for rate in rates}
    (motion,) = motions(tmp_path, columns)
    assert motion.time is None
    for name in ("lift", "spin"):
        for level, rate in enumerate(rates):
            assert np.array_equal(motion.joints[name][level], columns[f"{name}/{rate}"])


def test_missing_rates_are_fitted(tmp_path: Path) -> None:
    lift, spin = np.sin(TIME), np.cos(TIME)
    columns = {"time": TIME, "lift/position": lift, "spin/position": spin, "spin/velocity": 2 * TIME**2}
    (motion,) = motions(tmp_path, columns)
    assert motion.joints["lift"][1] == pytest.approx(np.cos(TIME), abs=FIT)
    assert motion.joints["lift"][2] == pytest.approx(-np.sin(TIME), abs=FIT)
    assert np.array_equal(motion.joints["spin"][1], 2 * TIME**2)
    assert motion.joints["spin"][2] == pytest.approx(
        4 * TIME, abs=FIT
    )  # from the velocities, not the positions


def test_accelerations_given_without_velocities(tmp_path: Path) -> None:
    columns = {"time": TIME, "lift/position": np.sin(TIME), "lift/acceleration": TIME, "spin/position": TIME}
    (motion,) = motions(tmp_path, columns)
    assert motion.joints["lift"][1] == pytest.approx(np.cos(TIME), abs=FIT)
    assert np.array_equal(motion.joints["lift"][2], TIME)


def test_angles_may_wrap(tmp_path: Path) -> None:
    turned = np.angle(np.exp(2j * TIME))
    assert np.abs(np.diff(turned)).max() > 6.0
    (motion,) = motions(tmp_path, {"time": TIME, "lift/position": TIME, "spin/position": turned})
    assert motion.joints["spin"][1] == pytest.approx(2.0 * np.ones_like(TIME), abs=FIT)
    (motion,) = motions(tmp_path, {"time": TIME, "tool/pose/z": TIME, "tool/pose/yaw": turned})
    pose, velocity, acceleration = motion.platforms["tool"]
    assert sorted(pose) == sorted(velocity) == sorted(acceleration) == ["yaw", "z"]
    assert np.array_equal(pose["yaw"], turned)
    assert velocity["yaw"] == pytest.approx(2.0 * np.ones_like(TIME), abs=FIT)


def test_poses_give_twists_in_reference_axes(tmp_path: Path) -> None:
    pose = poses_of(TIME)
    pose[::5, 3:] *= -1.0
    (motion,) = motions(tmp_path, {"time": TIME, **pose_columns("tool@slider", pose)})
    found, twist, acceleration = motion.platforms["tool@slider"]
    h = 1e-5
    for index in (0, 150, 699):
        t = TIME[index]
        before, here, after = pose_at(t - h), pose_at(t), pose_at(t + h)
        omega = pin.log3(after.rotation @ before.rotation.T) / (2 * h)
        linear = (after.translation - before.translation) / (2 * h)
        assert pin.XYZQUATToSE3(found[index]).isApprox(here, ROUNDING)
        assert twist[index] == pytest.approx(np.concatenate([linear, omega]), abs=DIFFERENCES)
    middle = slice(1, -1)
    differences = (twist[2:] - twist[:-2]) / 0.02
    assert acceleration[middle] == pytest.approx(differences, abs=1e-3)  # h^2 of plain differences


@pytest.mark.parametrize(
    ("kept", "turn", "block_rows"),
    [("", "q", 50), ("", "r", 200), ("z", "q", 200), ("z", "r", 50), ("xz", "q", 50), ("xz", "r", 200),
     ("xyz", "q", 50), ("xyz", "q", 200), ("xyz", "r", 50), ("xyz", "r", 200)],
)  # fmt: skip
@pytest.mark.parametrize("given", [(), ("velocity",), ("velocity", "acceleration")])
def test_an_orientation_goes_with_any_lengths_and_gives_the_rates_of_the_whole_pose(
    tmp_path: Path, block_rows: int, kept: str, turn: str, given: tuple[str, ...]
) -> None:
    """Rotation vectors jump by whole turns, and quaternions to their opposites."""
    time = TIME[:80]
    pose = poses_of(time)
    (whole,) = motions(tmp_path, {"time": time, **pose_columns("tool", pose)})
    wanted = dict(zip(("velocity", "acceleration"), whole.platforms["tool"][1:], strict=True))
    spin = np.array([pin.log3(pin.Quaternion(x).matrix()) for x in pose[:, 3:]])
    spin[::7] *= 1 - 2 * np.pi / np.linalg.norm(spin[::7], axis=1, keepdims=True)
    pose[::5, 3:] *= -1.0
    at = [*("xyz".index(axis) for axis in kept), 3, 4, 5]
    columns = {f"tool/pose/{axis}": pose[:, "xyz".index(axis)] for axis in kept}
    parts = pose[:, 3:] if turn == "q" else spin
    columns |= {f"tool/pose/{turn}{axis}": x for axis, x in zip("xyzw", parts.T, strict=False)}
    names = [*kept, "wx", "wy", "wz"]
    for rate in given:
        columns |= {f"tool/{rate}/{n}": wanted[rate][:, i] for n, i in zip(names, at, strict=True)}
    found = TableMotion.joined(motions(tmp_path, {"time": time, **columns}, block_rows=block_rows))
    places, *rates = found.platforms["tool"]
    if kept == "xyz":
        places = dict(zip(("x", "y", "z", "qx", "qy", "qz", "qw"), places.T, strict=True))
        rates = [dict(zip(names, rate.T, strict=True)) for rate in rates]
    for level, rate in zip(rates, ("velocity", "acceleration"), strict=True):
        one = np.column_stack([level[name] for name in names])
        bound = FIT if rate == "velocity" or given else 100 * FIT  # the spline of other signs and vectors
        assert np.abs(one - wanted[rate][:, at]).max() < bound
    turned = np.column_stack([places[f"q{axis}"] for axis in "xyzw"])
    assert np.abs(np.abs(np.sum(turned * pose[:, 3:], axis=1)) - 1).max() < ROUNDING
    assert all(np.array_equal(places[axis], columns[f"tool/pose/{axis}"]) for axis in kept)


@pytest.mark.parametrize("block_rows", [50, 199, 350])
def test_blocks_do_not_change_the_numbers(tmp_path: Path, block_rows: int) -> None:
    noise = 1e-4 * np.random.default_rng(5).normal(size=len(TIME))
    columns = {"time": TIME, "lift/position": np.sin(TIME) + noise, **pose_columns("tool", poses_of(TIME))}
    (whole,) = motions(tmp_path, columns)
    pieces = motions(tmp_path, columns, block_rows=block_rows)
    assert len(pieces) > 1
    for level in range(3):
        lift = np.concatenate([piece.joints["lift"][level] for piece in pieces])
        tool = np.concatenate([piece.platforms["tool"][level] for piece in pieces])
        for found, wanted in ((lift, whole.joints["lift"][level]), (tool, whole.platforms["tool"][level])):
            assert np.abs(found - wanted).max() <= ROUNDING * np.abs(wanted).max()


def test_wrenches_and_time_go_with_their_rows(tmp_path: Path) -> None:
    wrench = np.random.default_rng(1).normal(size=(len(TIME), 6))
    names = ("fx", "fy", "fz", "mx", "my", "mz")
    columns = {"time": TIME, "lift/position": TIME, "spin/position": TIME}
    columns |= {f"tool/wrench/{name}": wrench[:, index] for index, name in enumerate(names)}
    pieces = motions(tmp_path, columns, block_rows=300)
    assert [piece.first_row for piece in pieces] == [1, 301, 601]
    assert np.array_equal(np.concatenate([piece.wrenches["tool"] for piece in pieces]), wrench)
    assert np.array_equal(np.concatenate([piece.time for piece in pieces]), TIME)


def test_full_state_in_pinocchios_coordinates(tmp_path: Path) -> None:
    (motion,) = motions(tmp_path, {"time": TIME, "lift/position": np.sin(TIME), "spin/position": TIME**2})
    q, v, a = full_state(motion, ARM.joints)
    assert q == pytest.approx(np.column_stack([np.sin(TIME), np.cos(TIME**2), np.sin(TIME**2)]), abs=ROUNDING)
    assert v == pytest.approx(np.column_stack([np.cos(TIME), 2 * TIME]), abs=1e-5)
    assert a == pytest.approx(np.column_stack([-np.sin(TIME), 2 + 0 * TIME]), abs=1e-3)


def test_full_state_of_a_ball_joint(tmp_path: Path) -> None:
    quaternions = poses_of(TIME)[:, 3:]
    columns = {f"ball/position/q{axis}": quaternions[:, i] for i, axis in enumerate("xyzw")}
    columns |= {f"ball/velocity/w{axis}": TIME + i for i, axis in enumerate("xyz")}
    columns |= {f"ball/acceleration/w{axis}": TIME - i for i, axis in enumerate("xyz")}
    (motion,) = motions(tmp_path, columns, robot=BALL)
    q, v, a = full_state(motion, BALL.joints)
    assert q == pytest.approx(quaternions, abs=ROUNDING)
    assert np.array_equal(v, TIME[:, None] + np.arange(3))
    assert np.array_equal(a, TIME[:, None] - np.arange(3))


def test_the_base_gets_local_velocities_and_spatial_accelerations(tmp_path: Path) -> None:
    columns = {
        "time": TIME,
        "lift/position": TIME,
        "spin/position": TIME,
        **pose_columns("base", poses_of(TIME)),
    }
    (motion,) = motions(tmp_path, columns, base="floating")
    q, v, a = full_state(motion, ARM.joints, root="base")
    assert q.shape == (len(TIME), 10)
    h = 1e-5
    for index in (100, 400):
        t = TIME[index]
        step = pin.log6(pose_at(t - h).actInv(pose_at(t + h))).vector / (2 * h)
        assert v[index, :6] == pytest.approx(step, abs=DIFFERENCES)
    assert a[1:-1, :6] == pytest.approx((v[2:, :6] - v[:-2, :6]) / 0.02, abs=1e-3)  # h^2 of plain differences


def test_rounded_quaternions_pass_and_are_normalised(tmp_path: Path) -> None:
    pose = np.round(poses_of(TIME[:20]), 7)
    (motion,) = motions(tmp_path, {"time": TIME[:20], **pose_columns("tool", pose)})
    assert np.linalg.norm(motion.platforms["tool"][0][:, 3:], axis=1) == pytest.approx(np.ones(20), abs=1e-15)


def of_joints(time: np.ndarray, lift: np.ndarray | None = None) -> dict[str, np.ndarray]:
    return {"time": time, "lift/position": time if lift is None else lift, "spin/position": time}


def turned(first: int, last: int | None, change: Callable[[np.ndarray], Any]) -> dict[str, np.ndarray]:
    """Return a table of poses, some of whose quaternions are changed."""
    pose = poses_of(TIME[:20])
    pose[first:last, 3:] = change(pose[first:last, 3:])
    return {"time": TIME[:20], **pose_columns("tool", pose)}


HALF_TURN = turned(10, None, lambda x: [1.0, 0.0, 0.0, 0.0])
STANDS_STILL = of_joints(TIME[[0, 1, 2, 3, 4, 4, 6, 7, 8, 9, 10, 11]])
NO_SPLINE = of_joints(TIME[:20], 1e308 * (-1.0) ** np.arange(20))
TOO_CLOSE = of_joints(np.concatenate([5e-324 * np.arange(6), np.arange(1.0, 6.0)]))


@pytest.mark.parametrize(
    ("columns", "words", "place", "block_rows"),
    [
        (STANDS_STILL, "", {"row": 6, "column": "time"}, 2000),
        (STANDS_STILL, "", {"row": 6, "column": "time"}, 5),
        *(
            (turned(7, 8, lambda x, by=by: by * x), "length", {"row": 8, "column": "tool/pose/qx"}, 2000)
            for by in (1.0 + 2e-6, 0.0, 1e300)
        ),
        (HALF_TURN, "degrees", {"row": 11, "column": "tool/pose/qx"}, 2000),
        (HALF_TURN, "degrees", {"row": 11, "column": "tool/pose/qx"}, 8),
        (of_joints(TIME[:5]), "too few", {}, 2000),
        (NO_SPLINE, "'lift'", {"row": 1}, 2000),
        (TOO_CLOSE, "too close", {"column": "time"}, 2000),
    ],
)
def test_what_no_motion_passes_is_named_with_its_place(
    tmp_path: Path, columns: dict[str, np.ndarray], words: str, place: dict[str, Any], block_rows: int
) -> None:
    refused(
        lambda: motions(tmp_path, columns, block_rows=block_rows), TrajectoryError, words,
        file=str(tmp_path / "t.csv"), **place,
    )  # fmt: skip


def test_six_rows_are_enough_for_a_fit(tmp_path: Path) -> None:
    assert len(motions(tmp_path, of_joints(TIME[:6]))) == 1


NASTY = [
    b"nan", b"inf", b"-inf", b"1e400", b"1e308", b"-1e-400", b"", b" ", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf",
    b'"', b'""', b"'", b"#", b";", b"\t", b"\r", b"\r\n", b"\n\n", b",", b",,", b"1_0", b"0x1", b"1,5",
    b"time", b"true", b"tool/pose/", b"/", b"@", b"tool@slider/pose/x", b"lift/effort", b"9999999999999",
    b"1e", b"--1", b"\x1b[31m", b"\xc3\xa9", b"\xef\xbc\x91", b"=1+1", b"\\n", b"%s", b"{}",
]  # fmt: skip


def valid_table(with_pose: bool) -> bytes:
    time = 0.1 * np.arange(12)
    columns = {"time": time, "lift/position": np.sin(time), "lift/velocity": np.cos(time)}
    if with_pose:
        half = 0.3 * time
        pose = {"x": 0 * time, "y": 0 * time, "z": time, "qx": 0 * time, "qy": 0 * time}
        pose |= {"qz": np.sin(half), "qw": np.cos(half)}
        columns |= {f"tool/pose/{name}": values for name, values in pose.items()}
        columns |= {f"tool/wrench/{name}": time for name in ("fx", "fy", "fz", "mx", "my", "mz")}
    else:
        columns |= {"spin/position": time**2}
    rows = np.column_stack(list(columns.values())).tolist()
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]).encode()


def mutated(content: bytes, draw: random.Random) -> bytes:
    for _ in range(draw.choice([1, 1, 1, 2, 5])):
        at, length = draw.randrange(len(content) + 1), draw.choice([0, 1, 1, 3, 20])
        cells = content.split(b",")
        cell = draw.randrange(len(cells))
        content = draw.choice(
            [
                content[:at] + draw.choice(NASTY) + content[at + length :],
                content[:at] + bytes([draw.randrange(256)]) + content[at + 1 :],
                content[:at],
                content[:at] + content[at : at + length] * draw.choice([2, 50]) + content[at + length :],
                b",".join([*cells[:cell], draw.choice(NASTY), *cells[cell + 1 :]]),
                b",".join([*cells[:cell], *cells[cell + 1 :]]),
                content.replace(b",", b";"),
                content.replace(b".", b","),
            ]
        )
    return content


def use(path: Path) -> None:
    """Read a table to the end, and check that what comes out is finite."""
    with open_table(path, block_rows=5) as table:
        layout = read_layout(table.columns, ARM, motors=("lift", "spin"), file=table.file)
        for motion in read_motions(table, layout):
            for triple in [*motion.joints.values(), *motion.platforms.values()]:
                for level in triple:
                    for numbers in level.values() if isinstance(level, dict) else [level]:
                        assert np.isfinite(numbers).all()
            if layout.full_state:
                assert all(np.isfinite(numbers).all() for numbers in full_state(motion, ARM.joints))


@pytest.mark.parametrize(("with_pose", "rounds"), [slow(False, 500), slow(True, 500), (True, 150)])
def test_a_mutated_table_is_read_or_refused(tmp_path: Path, with_pose: bool, rounds: int) -> None:
    content = valid_table(with_pose)
    path = save(tmp_path, content, "t.csv")
    use(path)
    draw = random.Random(20_10)
    read = 0
    for _ in range(rounds):
        path.write_bytes(mutated(content, draw))
        _, message = outcome(str(path), lambda: use(path))
        read += not message
        assert not message or (str(path) in message and message.isprintable()), message
    assert 0.04 * rounds < read < 0.8 * rounds  # most are refused, harmless ones are not
