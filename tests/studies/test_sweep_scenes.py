"""Scenes as tasks of sweeps, compared with the energy of a pendulum."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from hybridyn.errors import ModelError
from hybridyn.studies.sweep.reading import read_study
from tests.studies.test_sweep import evaluated, folder
from tests.support.comparing import refused

__all__ = ["folder"]

#: Largest relative error of a motion whose steps are accurate to 1e-7.
OF_STEPS = 1e-5
#: Angle at which the fall ends [rad].
END = 1.0

SCENE = """duration = 5.0
[robot]
file = "pendulum.urdf.xacro"
xacro = { length = 3.0 }
[solver]
method = "dopri5"
rtol = 1e-7
[[events]]
name = "halfway"
joint = "turn"
at = 0.5
stop = false
[[events]]
name = "down"
joint = "turn"
at = 1.0
[[events]]
name = "never"
joint = "turn"
at = -1.0
"""
STUDY = """[robot]
file = "pendulum.urdf.xacro"
[designs]
method = "grid"
[parameters]
length = { values = [0.5, 1.5] }
[tasks.fall]
scene = "fall.toml"
[tasks.fall.measure]
t = "time"
half = "event halfway"
never = "event never"
count = "events"
speed = "final turn/velocity"
kinetic = "max energy/kinetic"
drift = "final energy/total"
top = "peak_effort"
"""


@pytest.fixture(autouse=True)
def fall(folder: Path) -> None:
    """Write a scene and a study of the pendulum."""
    Path("fall.toml").write_text(SCENE)
    Path("study.toml").write_text(STUDY)


def test_a_fall_has_the_energy_and_the_time_of_a_pendulum() -> None:
    """From rest at the horizontal, the kinetic energy is m g l sin(angle), and the time its quadrature."""
    for row in evaluated(Path("study.toml")):
        length = row.values[0]
        inertia = 0.1 + 2.0 * length**2

        def rate(angle: float, length: float = length, inertia: float = inertia) -> float:
            return float(np.sqrt(2 * 2.0 * 9.81 * length * np.sin(angle) / inertia))

        def until(angle: float, rate: object = rate) -> float:
            # 1 / rate is singular at 0 like 1 / sqrt(x): x = s^2 makes it smooth.
            return float(quad(lambda s: 2 * s / rate(s * s), 0, np.sqrt(angle))[0])  # type: ignore[operator]

        assert row.status == "ok"
        t, half, never, count, speed, kinetic, total, effort = row.measures
        wanted = [until(END), until(0.5), rate(END), 2.0 * 9.81 * length * np.sin(END)]
        assert np.allclose([t, half, speed, kinetic], wanted, rtol=OF_STEPS)
        assert (count, effort) == (2, 0)
        assert np.isnan(never)
        assert abs(total) < OF_STEPS * kinetic


def test_a_scene_that_cannot_begin_is_counted() -> None:
    Path("fall.toml").write_text(SCENE + "[initial]\njoints = { turn = 0.0, end = 1.0 }\n")
    assert {row.status for row in evaluated(Path("study.toml"))} == {"failed"}


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("fall.toml", '"pendulum.urdf.xacro"', '"five_bar"', "fall.toml:3: .*must be the robot of the study"),
        ("fall.toml", "{ length = 3.0 }", "{ mass = 3.0 }", "fall.toml:4: .*another value, or none"),
        ("fall.toml", "xacro =", "gravity = [0, 0, 0]\nxacro =", "'robot.gravity': must be that of the"),
        ("fall.toml", "duration", "duratio", "fall.toml:1: 'duratio': unknown key"),
        ("study.toml", "event half", "event hal", "'halway' is no event of the scene .did you mean 'half"),
        ("study.toml", "fall.toml", "fal.toml", "'tasks.fall.scene': there is no file 'fal.toml'"),
        ("study.toml", '"peak_effort"', '"reach"', "there is no measure 'reach'.*'event NAME'"),
        ("study.toml", "scene =", "effects = 'none'\nscene =", "'effects' belongs to a trajectory"),
        (
            "fall.toml", "[solver]", "[controller]\nkind = 'python'\nfile = 'c.py'\n[solver]",
            "study.toml:8: .*allow it with allow_python=True",
        ),
    ],
)  # fmt: skip
def test_wrong_scenes_are_one_line(file: str, old: str, new: str, said: str) -> None:
    text = Path(file).read_text()
    assert old in text
    Path(file).write_text(text.replace(old, new))
    refused(lambda: read_study("study.toml"), ModelError, said)
