"""What numbers of a study mean: the units of its peaks, and expressions over its columns."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.figures.sweep import chart_of_sweep
from hybridyn.studies.sweep.expressions import Expression
from hybridyn.studies.sweep.measures import OF_KIND, check_units, unit_of
from hybridyn.studies.sweep.reading import read_study
from hybridyn.studies.sweep.shards import read_shards
from hybridyn.studies.sweep.variants import Variants
from tests.robots.robot_texts import INERTIAL
from tests.support.command_line import table_text
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save

#: A slide that carries a joint that turns: their efforts are in N and in N m.
ARM = (
    f'<robot name="arm"><link name="base"/><link name="slider">{INERTIAL}</link><link name="tool">{INERTIAL}'
    '</link><joint name="lift" type="prismatic"><parent link="base"/><child link="slider"/>'
    '<axis xyz="0 0 1"/>'
    '<limit lower="-1" upper="1" effort="100" velocity="1"/></joint>'
    '<joint name="turn" type="revolute"><parent link="slider"/><child link="tool"/><axis xyz="0 1 0"/>'
    '<limit lower="-3" upper="3" effort="100" velocity="1"/></joint></robot>'
)
STUDY = """[robot]
file = "arm.urdf"
[designs]
method = "grid"
[parameters]
mass = {{ values = [1.0, 2.0] }}
[numbers]
"mass:tool" = "mass"
[tasks.follow]
trajectory = "traj.csv"
measure = {measure}
"""
TIME = 0.1 * np.arange(6)
COLUMNS = ["time", *(f"{joint}/{what}" for joint in ("lift", "turn") for what in ("position", "velocity"))]
MOTION = np.column_stack([TIME, 0.1 * TIME**2, 0.2 * TIME, 0.3 * TIME, 0.3 + 0 * TIME])


def study(folder: Path, measure: str) -> Path:
    save(folder, ARM, "arm.urdf")
    save(folder, table_text(COLUMNS, MOTION), "traj.csv")
    return save(folder, STUDY.format(measure=measure), "study.toml")


@pytest.mark.parametrize("word", OF_KIND)
def test_a_peak_of_different_units_is_refused(word: str, tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, ARM, "arm.urdf"))
    words = f"'{word}': the motors are slides and joints that turn"
    refused(lambda: check_units(robot, [word]), hybridyn.ModelError, words)
    one = ARM.replace('type="prismatic"', 'type="revolute"')
    check_units(hybridyn.load(save(tmp_path, one, "one.urdf")), [word])


def test_a_study_names_the_unit(tmp_path: Path) -> None:
    needs("sweep")
    measure = "{ force = 'peak lift/effort', torque = 'peak turn/effort', rise = 'peak lift/velocity' }"
    hybridyn.sweep(study(tmp_path, measure), tmp_path / "out", jobs=1)
    rows = read_shards(str(tmp_path / "out"))
    for i, mass in enumerate((1.0, 2.0)):
        robot = hybridyn.load(tmp_path / "arm.urdf").with_parameters({"mass:tool": mass})
        motion = hybridyn.idm(robot, MOTION[:, 1::2], MOTION[:, 2::2], np.tile([0.2, 0.0], (len(TIME), 1)))
        np.testing.assert_allclose(
            [rows["force"][i], rows["torque"][i]], np.abs(motion).max(axis=0), rtol=1e-9
        )
        assert rows["rise"][i] == pytest.approx(0.2 * TIME[-1])
    chart = chart_of_sweep(tmp_path / "out")
    assert [panel.label for panel in chart.panels] == ["force [N]", "torque [N m]", "rise [m/s]"]


@pytest.mark.parametrize(
    ("measure", "said"),
    [
        ('["peak_effort"]', "write 'peak MOTOR/effort' or 'peak MOTOR/velocity' for each of them"),
        ("['peak lift/effort']", "needs a name"),
        ("{ a = 'peak_effort[N]' }", "there is no measure"),
    ],
)
def test_studies_that_compare_different_units_are_one_line(measure: str, said: str, tmp_path: Path) -> None:
    asked = partial(hybridyn.sweep, study(tmp_path, measure), tmp_path / "out", jobs=1)
    refused(asked, hybridyn.HybridynError, re.escape(said))


@pytest.mark.parametrize(
    ("word", "unit"),
    [
        ("peak_effort", "N or N m"),
        ("max lift/position", "m"), ("peak turn/effort", "N m"), ("peak tool/velocity/wy", "rad/s"),
        ("min tool/pose/z", "m"), ("max tool/acceleration/x", "m/s^2"), ("energy", "J"),
        ("stroke_margin", ""), ("cost.py:cost", ""), ("event landed", ""),
    ],
)  # fmt: skip
def test_a_measure_has_the_unit_of_its_motors_or_column(word: str, unit: str, tmp_path: Path) -> None:
    assert unit_of(word, hybridyn.load(save(tmp_path, ARM, "arm.urdf")).description) == unit


@pytest.mark.parametrize(
    ("link", "low", "said"),
    [
        ("tol", 1.0, "parameters.mass.*'tol'.*did you mean 'tool'"),
        ("tool", -1.0, "'parameters': mass of 'tool' cannot be -2"),
    ],
)
def test_a_scale_names_a_link_and_is_not_negative(tmp_path: Path, link: str, low: float, said: str) -> None:
    path = study(tmp_path, '["energy"]')
    text = path.read_text().replace('[numbers]\n"mass:tool" = "mass"\n', "")
    path.write_text(text.replace("values = [1.0, 2.0]", f"scale_inertia = '{link}', values = [{low}, 2.0]"))
    variants = Variants(read_study(path))
    refused(lambda: variants({"mass": low}), hybridyn.ModelError, said)


OF_ROWS = {"a": [0.5, 1.5, 2.5, 1.0], "b": [2.0, 0.0, 3.0, 1.0]}


@pytest.mark.parametrize(
    "text",
    [
        "-(a > 1)", "+(a > 1)", "(a > 1) - (b > 1)", "(a > 1) + (b > 1)", "(a > 1) * (b > 1)", "-(not a > 1)",
        "abs((a > 1) - 2)", "abs(a > 1)", "(a > 1) ** 2", "(a > 1) / 2 > 0", "1 - (a > 1 and b > 1)",
    ],
)  # fmt: skip
def test_what_is_true_counts_one(text: str) -> None:
    found = Expression(text, ["a", "b"], "--where")({name: np.array(x) for name, x in OF_ROWS.items()})
    rows = zip(*OF_ROWS.values(), strict=True)
    wanted = [eval(text, {"__builtins__": {"abs": abs}}, {"a": a, "b": b}) for a, b in rows]
    assert np.array_equal(found, wanted)
    assert Expression("sqrt(a > 1)", ["a", "b"], "--where")({"a": np.array([2.0])}).dtype == float
