"""The header of a trajectory: what each column means, and one test per way a header can be wrong."""

from typing import Any

import pytest

from hybridyn.description.records import Description
from hybridyn.errors import TrajectoryError
from hybridyn.tables.columns import acceleration_columns, read_layout
from hybridyn.tables.layout import Layout
from tests.support.comparing import refused
from tests.tables.arm import BALL, joint, links

ROBOT = Description(
    name="robot",
    links=links("base", "slider", "elbow", "tool", "flange", "ns/tip"),
    joints=(
        joint("lift", "prismatic", "base", "slider"),
        joint("elbow", "revolute", "slider", "elbow"),
        joint("spin", "continuous", "elbow", "tool"),
        joint("weld", "fixed", "tool", "flange"),
        joint("ns/tip_joint", "fixed", "flange", "ns/tip"),
    ),
)
MOTORS = ("lift", "elbow")
POSE = [f"tool/pose/{name}" for name in ("x", "y", "z", "qx", "qy", "qz", "qw")]
TWIST = [f"tool/velocity/{name}" for name in ("x", "y", "z", "wx", "wy", "wz")]
WRENCH = [f"tool/wrench/{name}" for name in ("fx", "fy", "fz", "mx", "my", "mz")]


def layout(columns: list[str], robot: Description = ROBOT, **options: Any) -> Layout:
    return read_layout(columns, robot, motors=MOTORS, file="t.csv", **options)


def refusal(columns: list[str], column: str, words: str = "", **options: Any) -> None:
    """Check that a header is refused with its column and some words."""
    error = refused(lambda: layout(columns, **options), TrajectoryError, "", file="t.csv", column=column)
    assert words in str(error)


def test_motors_with_some_rates() -> None:
    found = layout(["time", "elbow/position", "lift/position", "lift/velocity"])
    assert found.time == 0
    assert not found.full_state
    assert found.joints["lift"].position == (2,)
    assert found.joints["lift"].missing == ("acceleration",)
    assert found.joints["elbow"].missing == ("velocity", "acceleration")
    # Every joint is a full state, and needs no motors.
    found = layout(["time", "lift/position", "elbow/position", "spin/position"])
    assert found.full_state
    assert found.joints["spin"].wraps == (0,)
    assert found.joints["elbow"].wraps == ()


def test_a_link_and_a_joint_of_one_name_are_told_apart() -> None:
    columns = ["time", "elbow/position", "elbow/velocity", "elbow/pose/x", "elbow/velocity/x"]
    found = layout(columns)
    assert found.joints["elbow"].velocity == (2,)
    assert found.poses["elbow"].velocity == (4,)


def test_whole_and_partial_poses() -> None:
    found = layout(["time", *reversed(POSE)])
    assert found.poses["tool"].position == (7, 6, 5, 4, 3, 2, 1)
    found = layout(["time", "tool@slider/pose/yaw", "tool@slider/pose/z"])
    assert found.poses["tool@slider"].components == ("z", "yaw")
    assert found.poses["tool@slider"].position == (2, 1)
    assert found.poses["tool@slider"].wraps == (1,)


@pytest.mark.parametrize("lengths", [(), ("x",), ("x", "z"), ("x", "y", "z")])
@pytest.mark.parametrize("turn", [("qx", "qy", "qz", "qw"), ("rx", "ry", "rz")])
def test_a_complete_orientation_goes_with_any_lengths(
    lengths: tuple[str, ...], turn: tuple[str, ...]
) -> None:
    columns = ["time", *(f"tool/pose/{name}" for name in (*turn, *lengths))]
    found = layout(columns).poses["tool"]
    assert (found.components, found.turn, found.wraps) == ((*lengths, *turn), turn, ())
    rates = [f"tool/velocity/{name}" for name in (*lengths, "wx", "wy", "wz")]
    assert layout([*columns, *rates]).poses["tool"].missing == ("acceleration",)
    refusal([*columns, *rates[:-1]], "tool/velocity/wz", "is missing")
    refusal([*columns, *rates, "tool/velocity/yaw"], "tool/velocity/yaw", "does not belong")
    refusal([*columns[:2], *columns[3:]], f"tool/pose/{turn[1]}", "is missing")
    refusal([*columns, "tool/pose/yaw"], "tool/pose/yaw", "does not belong")


@pytest.mark.parametrize("owner", ["ns/tip", "ns/tip@slider", "slider@ns/tip"])
def test_names_with_separators_in_them(owner: str) -> None:
    assert owner in layout(["time", f"{owner}/pose/x"]).poses


def test_wrenches_and_efforts_and_outputs_of_a_run_that_are_skipped_when_it_is_read_back() -> None:
    columns = [f"{name}/position" for name in ("lift", "elbow")] + ["lift/effort", "elbow/effort"]
    run = ["time", *columns, "energy/kinetic", "energy/potential", "energy/total", "residual"]
    assert layout(run).efforts == {}
    assert layout(run, efforts=True).efforts == {"lift": 3, "elbow": 4}
    refusal(["time", *columns], "lift/effort")
    columns = ["time", "lift/position", "elbow/position", *WRENCH]
    assert layout(columns).wrenches == {"tool": (3, 4, 5, 6, 7, 8)}
    assert layout([*columns, "lift/effort", "elbow/effort"], efforts=True).efforts == {"lift": 9, "elbow": 10}
    refusal([*columns, "lift/effort"], "lift/effort")


@pytest.mark.parametrize(
    ("efforts", "column", "words"),
    [
        (["lift"], "elbow/effort", "every motor needs its effort"),
        (["lift", "elbow", "spin"], "spin/effort", "not driven"),
        (["lift", "elbov"], "elbov/effort", "did you mean 'elbow'"),
        (["lift", "tool"], "tool/effort", "'tool' is a link"),
        (["lift", "weld"], "weld/effort", "fixed"),
    ],
)
def test_efforts_that_do_not_fit_the_motors(efforts: list[str], column: str, words: str) -> None:
    columns = ["time", "lift/position", "elbow/position", *(f"{name}/effort" for name in efforts)]
    refusal(columns, column, words, efforts=True)


def test_with_efforts_no_accelerations_are_wanted_but_a_moving_base_s() -> None:
    rates = [f"{name}/{rate}" for name in MOTORS for rate in ("position", "velocity", "effort")]
    assert not any(signal.missing for signal in layout(rates, efforts=True).signals)
    base = [column.replace("tool", "base") for column in (*POSE, *TWIST)]
    read = layout([*rates, *base], base="floating", efforts=True)
    assert not any(signal.missing for signal in read.signals)
    read = layout(["time", *rates, *base], base="moving", efforts=True)
    assert {signal.name: signal.missing for signal in read.signals if signal.missing} == {
        "base": ("acceleration",)
    }


def test_columns_of_accelerations() -> None:
    assert acceleration_columns(ROBOT, ["lift", "elbow", "spin"], "fixed") == [
        f"{name}/acceleration" for name in ("lift", "elbow", "spin")
    ]
    floating = acceleration_columns(ROBOT, ["root_joint", "lift"], "floating")
    assert floating == [f"base/acceleration/{n}" for n in ("x", "y", "z", "wx", "wy", "wz")] + [
        "lift/acceleration"
    ]
    assert acceleration_columns(ROBOT, ["root_joint", "lift"], "moving") == ["lift/acceleration"]


def test_without_time_every_rate_must_be_given() -> None:
    rates = [f"{name}/{rate}" for name in MOTORS for rate in ("position", "velocity", "acceleration")]
    assert layout(rates).time is None
    refusal(rates[:-1], "time", "elbow/acceleration")


@pytest.mark.parametrize("base", ["moving", "floating"])
def test_a_base_that_moves_has_its_pose_in_the_table(base: str) -> None:
    pose = [column.replace("tool", "base") for column in POSE]
    joints = ["time", "lift/position", "elbow/position", "spin/position"]
    assert layout([*joints, *pose], base=base).full_state
    refusal(joints, "base/pose/x", base=base)
    refusal([*joints, "base/pose/x"], "base/pose/qx", base=base)
    refusal([*joints, *pose[:2], *pose[3:]], f"{pose[2]}", base=base)
    by_vector = [*(f"base/pose/{name}" for name in ("rx", "ry", "rz")), *pose[:3]]
    assert layout([*joints, *by_vector], base=base).full_state
    refusal([*joints, *pose], "base/pose/x", "fixed")


def test_joints_with_several_freedoms() -> None:
    position = [f"ball/position/q{axis}" for axis in "xyzw"]
    rates = [f"ball/{rate}/w{axis}" for rate in ("velocity", "acceleration") for axis in "xyz"]
    found = layout(["time", *position, *rates], robot=BALL)
    assert found.full_state
    assert found.joints["ball"].velocity == (5, 6, 7)
    refusal(["time", *position], "ball/velocity/wx", "not fitted", robot=BALL)
    refusal(["time", "ball/position"], "ball/position", robot=BALL)


@pytest.mark.parametrize(
    ("columns", "column", "words"),
    [
        (["Time", "lift/position"], "Time", "did you mean 'time'"),
        (["t", "lift/position"], "t", "did you mean 'time'"),
        (["time", "lift"], "lift", "did you mean 'lift/position'"),
        (["time", "lift/velocity_m_s"], "lift/velocity_m_s", "did you mean 'lift/velocity'"),
        (["time", "lift/positon"], "lift/positon", "did you mean 'lift/position'"),
        (["time", "speed"], "speed", "columns are 'time'"),
        (["time", "lifd/position"], "lifd/position", "did you mean 'lift'"),
        (["time", "tool/position"], "tool/position", "'tool' is a link"),
        (["time", "weld/position"], "weld/position", "fixed"),
        (["time", "tol/pose/x"], "tol/pose/x", "did you mean 'tool'"),
        (["time", "lift/pose/x"], "lift/pose/x", "'lift' is a joint"),
        (["time", "tool@tol/pose/x"], "tool@tol/pose/x", "no link 'tol'"),
        (["time", "tool@wrld/pose/x"], "tool@wrld/pose/x", "did you mean 'world'"),
        (["time", "world/pose/x"], "world/pose/x", "no link 'world'"),
        (["time", "base@world/pose/x"], "base/pose/x", "the base is fixed"),
        (["time", "base/pose/x", "base@world/pose/x"], "base@world/pose/x", "given twice"),
        (["time", "tool/pose"], "tool/pose", "lacks its component"),
        (["time", "lift/effort/x"], "lift/effort/x", "not known"),
        (["time", "lift/velocity", "elbow/position"], "lift/position", "is missing"),
        (["time", "lift/position"], "elbow/position", "is missing"),
        (["time"], "lift/position", "is missing"),
        (["time", "lift/position", "elbow/position/x"], "elbow/position/x", "does not belong"),
        (["time", "lift/position", "spin/position"], "spin/position", "--map spin"),
        (["time", *POSE[:-1]], "tool/pose/qw", "is missing"),
        (["time", *POSE, "tool/pose/roll"], "tool/pose/roll", "does not belong"),
        (["time", "tool/pose/x", "tool/pose/w"], "tool/pose/w", "does not belong"),
        (["time", *POSE, *TWIST[:-1]], "tool/velocity/wz", "is missing"),
        (["time", *POSE, "tool/velocity/yaw"], "tool/velocity/yaw", "does not belong"),
        (["time", "tool/pose/z", "tool/pose/yaw", "tool/velocity/z"], "tool/velocity/yaw", "is missing"),
        (["time", *TWIST], "tool/pose/x", "is missing"),
        (["time", *POSE, *WRENCH[:-1]], "tool/wrench/mz", "is missing"),
        (["time", *POSE, "tool@slider/wrench/fx"], "tool@slider/wrench/fx", "acts on one link"),
        (["time", *POSE, "lift/position", "elbow/position", "spin/position"], "tool/pose/x", "every joint"),
    ],
)
def test_names_the_column_that_is_wrong(columns: list[str], column: str, words: str) -> None:
    refusal(columns, column, words)
