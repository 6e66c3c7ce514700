"""Gradients of a study's measures, against differences of the measures themselves."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import HybridynError, ModelError
from hybridyn.spatial import Array
from hybridyn.studies.sweep.evaluation import Designer
from hybridyn.studies.sweep.gradients import StudyGradients
from hybridyn.studies.sweep.measures import OF_MOTORS
from hybridyn.studies.sweep.reading import read_study
from tests.robots.shipped import changed_copy
from tests.structure.test_parameters import THREE, with_three_motors

#: Agreement with a quotient of differences of order four: its rounding, 1e-13 over steps of 1e-3, counts.
AGREE, STEP = 1e-8, 1e-3
STUDY = """
[robot]
file = "five_bar"
[designs]
method = "sobol"
count = 4
[parameters]
upper_length = { range = [0.20, 0.30] }
gap = { range = [0.1, 0.3] }
upper = { scale_inertia = ["m1_left_upper", "m1_right_upper"], range = [0.8, 1.2] }
[numbers]
"position:m1_left_drive.x" = "-gap / 2"
"position:m1_right_drive.x" = "gap / 2"
[tasks.loop]
trajectory = "loop.csv"
"""
COLUMNS = (
    "max m1_left_elbow/position", "min m1_left_elbow/velocity", "final m1_left_elbow/acceleration",
    "rms m1_left_drive/effort", "mean m1_left_drive/power", "peak m1_right_drive/power",
    "max m1_left_lower/pose/x", "rms m1_left_lower/velocity/z", "mean m1_right_upper/velocity/wy",
    "min m1_right_lower/acceleration/x", "rms m1_left_lower/acceleration/wy",
)  # fmt: skip
ALL = "[tasks.loop.measure]\n" + "\n".join(f'm{k} = "{x}"' for k, x in enumerate((*OF_MOTORS, *COLUMNS)))
NUMBERS = np.array([0.2525, 0.204, 1.03])


def study(folder: Path, measures: str, text: str = STUDY, pushed: tuple[str, ...] = ()) -> StudyGradients:
    """Write a study whose tool goes round an ellipse, where wrenches push some links, and read it."""
    t = np.linspace(0.0, 1.0, 6)
    x = -0.04 * np.cos(2 * np.pi * t) + 0.01 * np.sin(4 * np.pi * t)
    wrenches = [f"{link}/wrench/{x}" for link in pushed for x in ("fx", "fy", "fz", "mx", "my", "mz")]
    W = np.sin(np.arange(len(wrenches)) + t[:, None])
    rows = np.column_stack([t, x, -0.5 + 0.02 * np.sin(2 * np.pi * t), W])
    header = ",".join(["time,m1_tool/pose/x,m1_tool/pose/z", *wrenches])
    np.savetxt(folder / "loop.csv", rows, delimiter=",", header=header, comments="")
    (folder / "study.toml").write_text(text + measures)
    return StudyGradients(read_study(folder / "study.toml"))


def test_gradients_of_measures_are_those_of_the_measures(tmp_path: Path) -> None:
    """Limits of the motors follow the parameters, too, and wrenches act on two links."""
    before = 'lower="-1.2" upper="1.2" effort="${torque}" velocity="${speed}"'
    limits = 'lower="${-9 * upper_length}" upper="${7 * upper_length}" effort="${50 * upper_length}"'
    after = limits + ' velocity="${33 * upper_length}"'
    changed_copy("five_bar", tmp_path, {"modules/five_bar.xacro": (before, after)})
    text = STUDY.replace('"five_bar"', '"urdf/five_bar.urdf.xacro"')
    of = study(tmp_path, ALL, text, ("m1_tool", "m1_left_upper"))
    along = NUMBERS * [1.0, -1.0, 0.5]
    found = of(NUMBERS)
    assert found.row.status == "ok"

    def at(part: float) -> Array:
        """Return all measures, and how well loops close, of a design beside."""
        other = of(NUMBERS + part * STEP * along)
        return np.array([*other.row.measures, other.closing, other.conditioning])

    coarse, fine = at(1) - at(-1), 2 * (at(0.5) - at(-0.5))
    wanted = (4 * fine - coarse) / (6 * STEP)
    assert 0.0 < found.conditioning < 1.0
    own = np.vstack([found.gradient, found.closing_gradient, found.conditioning_gradient]) @ along
    assert (np.abs(own - wanted) <= AGREE * (np.abs(wanted) + 1.0)).all()


TWO = """[robot]
file = "urdf/five_bar.urdf.xacro"
[designs]
method = "grid"
[parameters]
upper_length = {{ values = [{}] }}
upper_mass = {{ values = [0.9] }}
[tasks.loop]
trajectory = "loop.csv"
"""


def with_tip(folder: Path, name: str, z: str) -> None:
    """Copy the five-bar, with a link without mass on its tool."""
    tip = f"""<xacro:property name="m" value="$(arg upper_mass)"/><link name="{name}"/>
    <joint name="tip_mount" type="fixed"><parent link="m1_tool"/><child link="{name}"/>
    <origin xyz="0 0 {z}"/></joint></robot>"""
    changed_copy("five_bar", folder, {"five_bar.urdf.xacro": ("</robot>", tip)})


def test_a_design_of_another_structure_has_its_own_models(tmp_path: Path) -> None:
    """Beside each design the same numbers change, and a number that does not differs between them."""
    with_tip(tmp_path, "tip", "${0.3 if m > 0.95 else 0.1}")
    of = study(tmp_path, 'measure = { x = "mean tip/pose/x" }', TWO.format("0.25"))
    of.prepare(np.array([0.25, 0.7]))
    found, measure = of(np.array([0.2525, 1.1])), Designer(of.source)
    ahead, back = (measure(0, np.array([x, 1.1])).measures[0] for x in (0.2535, 0.2515))
    assert found.gradient[0] == pytest.approx([(ahead - back) / 2e-3, 0.0], rel=1e-4, abs=1e-9)


def test_shares_that_follow_a_parameter_have_no_gradient(tmp_path: Path) -> None:
    with_three_motors(tmp_path, "15", "${20 * x}")
    text = TWO.format("0.25").replace("[designs]", f"motors = {THREE}\n[designs]")
    of = study(tmp_path, 'measure = ["rms_effort"]', text)
    with pytest.raises(ModelError, match="3 motors share a load by their effort limits, whose ratios differ"):
        of(np.array([0.25, 0.9]))


def test_a_design_that_cannot_be_assembled_says_so(tmp_path: Path) -> None:
    found = study(tmp_path, 'measure = ["rms_effort"]')(np.array([0.05, 0.2, 1.0]))
    assert found.row.status in ("unreachable", "not loaded")
    assert "\n" not in found.row.message
    assert found.row.message
    assert np.isnan(found.gradient).all()
    assert np.isnan([found.closing, found.conditioning]).all()


@pytest.mark.parametrize(
    ("text", "measures", "says"),
    [
        (STUDY.replace('trajectory = "loop.csv"', 'workspace = { steps = { x = 0.2, z = 0.2 } }'),
         'measure = ["poses"]', "task 'loop' has a workspace.*lattice"),
        (STUDY.replace("drive.x", "drive.y").replace("-gap", "gap").replace("gap / 2", "gap - 0.204", 1)
         .replace("gap / 2", "0.204 - gap"), 'measure = ["energy"]',
         "parameter 'gap' opens loops"),
    ],
)  # fmt: skip
def test_what_has_no_gradient_is_refused(text: str, measures: str, says: str, tmp_path: Path) -> None:
    with pytest.raises(HybridynError, match=says) as caught:
        study(tmp_path, measures, text)(NUMBERS)
    assert isinstance(caught.value, ModelError)
    assert "\n" not in str(caught.value)


def of_every_joint(folder: Path) -> None:
    """Write a trajectory of every joint of the five-bar."""
    robot, t = hybridyn.load("five_bar"), np.linspace(0.0, 1.0, 6)
    moved = dict.fromkeys(robot.motors, (0.2 * t, 0.2 + 0 * t, 0 * t))
    levels = zip(
        ("position", "velocity", "acceleration"), hybridyn.assemble(robot, motors=moved), strict=True
    )
    columns = {f"{x}/{what}": rows[:, k] for what, rows in levels for k, x in enumerate(robot.joints)}
    np.savetxt(
        folder / "loop.csv", np.column_stack([t, *columns.values()]), delimiter=",",
        header=",".join(["time", *columns]), comments="",
    )  # fmt: skip


def test_solved_accelerations_have_gradients(tmp_path: Path) -> None:
    """The right arm needs no effort, which has no motor; measures of its acceleration stay the table's."""
    text = (
        STUDY.partition("[parameters]")[0].replace('"five_bar"', '"five_bar"\nmotors = ["m1_left_drive"]')
        + """[parameters]
upper = { scale_inertia = "m1_right_upper", range = [0.8, 1.2] }
[tasks.loop]
trajectory = "loop.csv"
passive = "solved"
"""
    )
    measure = 'measure = { x = "rms m1_left_drive/effort", y = "mean m1_right_drive/acceleration" }'
    of = study(tmp_path, measure, text)
    of_every_joint(tmp_path)
    found, *beside = (of(np.array([1.0 + x])) for x in (0.0, STEP, -STEP))
    one, other = (x.row.measures for x in beside)
    slope = (one[0] - other[0]) / (2 * STEP)
    assert found.gradient[0] == pytest.approx(slope, rel=1e-6)  # the square of the step
    assert (found.gradient[1, 0], one[1]) == (0.0, other[1])


def test_a_table_of_every_joint_has_gradients_where_no_loop_opens(tmp_path: Path) -> None:
    """Efforts are linear in the inertia of links; lengths would open the loop."""
    measure = 'measure = { x = "mean m1_left_drive/effort" }'
    of = study(tmp_path, measure, STUDY.partition("[numbers]")[0].partition("upper_length =")[0] + """
upper = { scale_inertia = ["m1_left_upper", "m1_right_upper"], range = [0.8, 1.2] }
[tasks.loop]
trajectory = "loop.csv"
""")  # fmt: skip
    of_every_joint(tmp_path)
    one, other = of(np.array([1.0])), of(np.array([1.1]))
    wanted = (other.row.measures[0] - one.row.measures[0]) / 0.1
    assert abs(one.gradient[0, 0] - wanted) <= AGREE * abs(wanted)
    text = (
        (tmp_path / "study.toml")
        .read_text()
        .replace("[parameters]", "[parameters]\nlower_length = { range = [0.3, 0.5] }")
    )
    (tmp_path / "study.toml").write_text(text)
    with pytest.raises(ModelError, match="parameter 'lower_length' opens loops"):
        StudyGradients(read_study(tmp_path / "study.toml"))(np.array([0.4, 1.0]))


def test_power_that_no_motor_takes_back_has_no_slope(tmp_path: Path) -> None:
    """The tool rises all the time."""
    of, t = study(tmp_path, 'measure = ["braking_power", "peak_power"]'), np.linspace(0.0, 1.0, 6)
    rows = np.column_stack([t, 0.0 * t, -0.5 + 0.05 * t + 0.02 * t**2])
    header = "time,m1_tool/pose/x,m1_tool/pose/z"
    np.savetxt(tmp_path / "loop.csv", rows, delimiter=",", header=header, comments="")
    found = of(NUMBERS)
    assert found.row.measures[0] == 0.0
    assert not found.gradient[0].any()
    assert found.gradient[1].any()
