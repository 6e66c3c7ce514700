"""Poses of a tool that several modules move stand wherever motors stand: an excavator's teeth.

Each case is given once by rods, once by coordinates of the teeth, whose closed form says that both are one
motion, and once by the direction of the teeth, their height, and their distance from a point.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.assembly.assemble import assemble
from hybridyn.scenes.stage import stage
from hybridyn.spatial import Array
from hybridyn.studies.assemblies import assemblies
from hybridyn.studies.sweep.compiled_chunks import evaluate_chunk
from hybridyn.studies.sweep.designs import designs_of
from hybridyn.studies.sweep.evaluation import Chunk
from hybridyn.studies.sweep.reading import read_study
from tests.robots.excavator import HOME, MOTORS, cylinders, excavator, teeth
from tests.support.command_line import call, read_table
from tests.support.comparing import close_to, refused
from tests.support.files import save
from tests.support.samples import slow

TIME = np.linspace(0.0, 1.0, 9)
ANGLES = HOME + 0.1 * np.sin(np.outer(TIME, [1.0, 1.3, 0.7]))
WAYS = ("rods", "teeth", "pointed")
#: A point from which the distance of the teeth is measured.
CENTRE = {"cx": 1.0, "cy": 0.3, "cz": 0.5}
AXES = ("x", "z", "pitch")
EXACT = 1e-9  # of postures, relative to the largest
SPLINED = 2e-3  # of rates of splines through different columns, whose rows are 0.125 s apart


def numbers(way: str, angles: Array) -> dict[str, float]:
    """Return positions of the rods, or coordinates of the teeth."""
    if way == "rods":
        return dict(zip(MOTORS, (cylinders(angles) - cylinders(HOME)).tolist(), strict=True))
    if way == "pointed":
        x, z, pitch = teeth(angles).tolist()
        axis = {"xx": 2.0 * float(np.cos(pitch)), "xy": 0.0, "xz": -2.0 * float(np.sin(pitch))}
        way_to = np.array([x, 0.0, z]) - np.array([*CENTRE.values()])
        return {**axis, "z": z, "distance": float(np.linalg.norm(way_to)), **CENTRE}
    return dict(zip(AXES, teeth(angles).tolist(), strict=True))


def table(folder: Path, way: str, efforts: bool = False) -> None:
    """Write the motion, with efforts of zero if wanted, as a table."""
    rows = [numbers(way, angles) for angles in ANGLES]
    named = {"rods": "{}/position", "teeth": "teeth/pose/{}", "pointed": "teeth/pose/{}"}[way]
    header = ["time", *map(named.format, rows[0]), *(f"{name}/effort" for name in MOTORS if efforts)]
    lines = [[t, *row.values(), *[0.0] * (3 * efforts)] for t, row in zip(TIME.tolist(), rows, strict=True)]
    text = "\n".join(",".join(map(repr, line)) for line in lines)
    save(folder, ",".join(header) + "\n" + text + "\n", f"{way}.csv")


def inline(values: dict[str, float]) -> str:
    return "{ " + ", ".join(f"{name} = {value!r}" for name, value in values.items()) + " }"


def posed(way: str, angles: Array) -> str:
    """Return the keys of a scene for a posture."""
    values = inline(numbers(way, angles))
    return f"joints = {values}" if way == "rods" else f"platforms = {{ teeth = {values} }}"


def scene(folder: Path, way: str, text: str) -> Path:
    head = "duration = 0.5\n[robot]\nfile = 'excavator.urdf'\n"
    return save(folder, head + text + "\n[output]\nrate = 20\n", f"{way}.toml")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    excavator(tmp_path)
    for way in WAYS:
        table(tmp_path, way)
    return tmp_path


def of_sweep(folder: Path, way: str, capsys: pytest.CaptureFixture[str]) -> Array:
    study = f"""[robot]
file = "excavator.urdf"
[designs]
method = "grid"
[parameters]
mass = {{ scale_inertia = "bucket", values = [0.9] }}
[tasks.dig]
trajectory = "{way}.csv"
measure = ["peak_effort", "peak_speed"]
"""
    source = read_study(save(folder, study, "study.toml"))
    rows = evaluate_chunk(source, Chunk(0, designs_of(source)), None).rows
    return np.array([row.measures for row in rows])


def of_ddm(folder: Path, way: str, capsys: pytest.CaptureFixture[str]) -> Array:
    table(folder, way, efforts=True)
    call(capsys, "ddm", "excavator.urdf", f"{way}.csv", "-o", f"{way}_a.csv")
    columns = read_table((folder / f"{way}_a.csv").read_text())
    return np.stack([columns[f"{name}/acceleration"] for name in MOTORS])


def of_motion(folder: Path, way: str, capsys: pytest.CaptureFixture[str]) -> Array:
    found = scene(folder, way, f"[motion]\ntable = '{way}.csv'")
    call(capsys, "simulate", found, "-o", f"{way}_q.csv")
    columns = read_table((folder / f"{way}_q.csv").read_text())
    return np.stack([columns[f"{name}/effort"] for name in MOTORS])


def of_controller(folder: Path, way: str, capsys: pytest.CaptureFixture[str]) -> Array:
    points = "".join(
        f"[[controller.reference.points]]\ntime = {t!r}\n{posed(way, angles)}\n"
        for t, angles in zip(TIME[1:].tolist(), ANGLES[1:], strict=True)
    )
    ready = stage(scene(folder, way, f"[controller]\nkind = 'computed_torque'\nkp = 100\nkd = 20\n{points}"))
    assert callable(ready.effort)
    still = np.zeros(ready.robot.nv)
    return np.stack([ready.effort(t, ready.q0, still) for t in np.linspace(0.0, 1.0, 12)])


def of_start(folder: Path, way: str, capsys: pytest.CaptureFixture[str]) -> Array:
    return stage(scene(folder, way, f"[initial]\n{posed(way, ANGLES[-1])}")).q0


CASES: dict[str, tuple[Callable[[Path, str, pytest.CaptureFixture[str]], Array], float]] = {
    "task of a sweep": (of_sweep, SPLINED),
    "start of ddm": (of_ddm, SPLINED),
    "motion of a scene": (of_motion, SPLINED),
    "points of a controller": (of_controller, 1e-7),
    "start of a scene": (of_start, EXACT),
}


#: Cases with directions and distances that take longer than a second.
LONG = ("motion of a scene", "points of a controller")


@pytest.mark.parametrize(
    ("case", "way"),
    [
        *((case, "teeth") for case in CASES),
        *(slow(case, "pointed") if case in LONG else (case, "pointed") for case in CASES),
    ],
)
def test_teeth_stand_where_rods_stand(
    case: str, way: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    of, tolerance = CASES[case]
    rods, tips = (of(folder, one, capsys) for one in ("rods", way))
    close_to(tips, rods, tolerance)
    assert np.ptp(rods) > 0


@pytest.mark.slow
def test_cost_takes_teeth(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "leg inertia" in call(capsys, "cost", "excavator.urdf", "teeth.csv").out


def test_rates_of_the_teeth_at_a_start_are_those_of_the_rods(folder: Path) -> None:
    rates = "[initial.rates]\nplatforms = { teeth = { x = 0.2, z = -0.1, pitch = 0.3 } }"
    ready = stage(scene(folder, "rates", f"[initial]\n{posed('teeth', HOME)}\n{rates}"))
    robot, step = ready.robot, 1e-5
    moved = np.array([0.2, -0.1, 0.3])
    ends = []
    for sign in (1.0, -1.0):
        pose = dict(zip(AXES, teeth(HOME) + sign * step * moved, strict=True))
        ends.append(assemble(robot, platforms={"teeth": (pose,)})[0][robot.motor_q])
    close_to(ready.v0[robot.motor_v], (ends[0] - ends[1]) / (2 * step), 1e-7)


def test_postures_of_several_modules_are_not_searched_at_once(folder: Path) -> None:
    robot = hybridyn.load("excavator.urdf")
    search = partial(assemblies, robot, platforms={"teeth": (numbers("teeth", HOME),)}, starts=10)
    refused(search, hybridyn.AssemblyError, "'teeth' moves 'boom', 'stick', 'rocker' together; .*give motors")
