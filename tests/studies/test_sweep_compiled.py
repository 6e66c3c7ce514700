"""Sweeps by compiled models: the rows of the general path, however the work is divided."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.description.reading import read
from hybridyn.description.records import Description
from hybridyn.structure.parameters.slots import differences
from hybridyn.studies.sweep import compiled_chunks, compiled_designs
from hybridyn.studies.sweep import sweep as sweeping
from hybridyn.studies.sweep import variants as variants_module
from hybridyn.studies.sweep.compiled_designs import _difference
from hybridyn.studies.sweep.evaluation import Designer, DesignRow
from hybridyn.studies.sweep.reading import read_study
from hybridyn.studies.sweep.shards import about_of
from hybridyn.studies.sweep.sweep import Swept
from hybridyn.studies.sweep.variants import Variants
from tests import ROOT
from tests.robots.excavator import HOME, excavator, teeth
from tests.studies.test_sweep import SCALES, folder, here, rows_of, written
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save

__all__ = ["folder", "here"]

#: Largest relative difference of a measure between compiled models and the general path.
SAME = 1e-11
FIVE_BAR = """[robot]
file = "five_bar"
[designs]
method = "sobol"
count = 16
[parameters]
upper_length = { range = [0.18, 0.30] }
upper = { scale_inertia = "m1_left_upper", range = [0.8, 1.2] }
spacing = { range = [0.1, 0.7] }
[tasks.swing]
trajectory = "motors.csv"
[tasks.swing.measure]
peak = "peak_effort"
given = "energy"
left = "stroke_margin"
fast = "max m1_left_elbow/velocity"
"""


#: No design's file is read; arms of some do not reach the path.
NUMBERS = """[robot]
file = "five_bar"
[designs]
method = "random"
count = 12
check = 12
[parameters]
arm = { range = [0.14, 0.28] }
tool = { scale_inertia = "m1_tool", range = [0.5, 2.0] }
apart = { range = [0.1, 0.3] }
[numbers]
"position:m1_left_drive.x" = "-apart / 2"
"position:m1_right_drive.x" = "apart / 2"
"position:m1_left_elbow.x" = "arm"
"position:m1_right_elbow.x" = "arm"
[tasks.swing]
trajectory = "tool.csv"
measure = { peak = "peak_effort", mean = "mean_power", w = "rms m1_left_elbow/velocity" }
"""

#: A tool through three modules: with two numbers, one freedom is left.
EXCAVATOR = """[robot]
file = "excavator.urdf"
[designs]
method = "random"
count = 8
check = 8
[parameters]
pin = { range = [2.1, 2.3] }
reach = { range = [2.45, 2.55] }
stick = { scale_inertia = "stick", range = [0.5, 2.0] }
[numbers]
"position:boom_pin/successor.x" = "pin"
"position:bucket_joint.x" = "reach"
[tasks.dig]
trajectory = "teeth.csv"
measure = { peak = "peak_effort", mean = "mean_power", w = "rms stick_joint/velocity" }
"""


#: Four-bar loops in a row: rows of one, two, whose first bar has other masses, and, once only, three.
FOUR_BARS = """[robot]
file = "{file}"
[designs]
method = "table"
table = "designs.csv"
check = 9
[parameters]
n = {{}}
bar = {{ scale_inertia = "bar1" }}
[tasks.swing]
trajectory = "swing.csv"
measure = {{ peak = "peak_effort", mean = "mean_power", w = "rms top0/velocity" }}
"""


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Compile models for few designs."""
    monkeypatch.setattr(compiled_designs, "WORTH_COMPILING", 0)


def test_without_compiled_models_the_general_path_runs_and_the_report_says_why(
    folder: Path, here: Any
) -> None:
    state = hybridyn.sweep(written("method = 'grid'", SCALES), "out")
    assert "every joint" in state.why_general
    assert (state.compiled, state.statuses) == (0, {"ok": 6})
    assert not about_of("out").compiled


@pytest.mark.slow
def test_a_small_study_is_compiled_where_the_models_are_in_the_cache(
    folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    needs("compiled")
    study = five_bar_in(folder)
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path_factory.mktemp("cache")))
    monkeypatch.setattr(compiled_designs, "WORTH_COMPILING", 16 * 41 + 1)  # one more than designs times rows
    state = hybridyn.sweep(study, "general", jobs=1)
    assert (state.compiled, state.why_general) == (0, "")
    monkeypatch.setattr(compiled_designs, "WORTH_COMPILING", 16 * 41)
    assert hybridyn.sweep(study, "built", jobs=1).compiled
    monkeypatch.setattr(compiled_designs, "WORTH_COMPILING", 16 * 41 + 1)
    assert hybridyn.sweep(study, "again", jobs=1).compiled


def both_ways(study: Path) -> Swept:
    """Return a sweep by compiled models; the general path has the same rows."""
    needs("compiled")
    state = hybridyn.sweep(study, "compiled")
    assert state.why_general == ""
    assert 0 < state.difference <= SAME
    general = hybridyn.sweep(study, "general", compiled=False)
    assert state.statuses == general.statuses
    ours, theirs = rows_of("compiled"), rows_of("general")
    for name in ("design", "status", "message"):
        assert ours[name] == theirs[name]
    for name in about_of("compiled").measures:
        assert np.allclose(ours[name], theirs[name], rtol=SAME, atol=0, equal_nan=True)
    return state


def in_one_chunk(study: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Return the rows of a sweep that is not divided, to their last bits."""
    monkeypatch.setattr(sweeping, "MOST_IN_CHUNK", 16)
    hybridyn.sweep(study, "whole")
    return bits_of("whole")


def bits_of(output: str) -> dict[str, str]:
    return {name: repr(values) for name, values in rows_of(output).items()}


def five_bar_in(folder: Path) -> Path:
    """Write a study of a five-bar whose motors swing; some designs do not reach all postures."""
    t = np.linspace(0.0, 0.8, 41)
    w = 2 * np.pi / 0.8
    wave = [0.3 * np.sin(w * t), 0.3 * w * np.cos(w * t), -0.3 * w**2 * np.sin(w * t)]
    sides = ("m1_left_drive", "m1_right_drive")
    header = [f"{side}/{level}" for side in sides for level in ("position", "velocity", "acceleration")]
    rows = np.column_stack([t, *(-x for x in wave), *wave])
    np.savetxt("motors.csv", rows, "%.17g", ",", header=",".join(["time", *header]), comments="")
    return save(folder, FIVE_BAR, "five_bar.toml")


@pytest.mark.slow
def test_compiled_rows_are_those_of_the_general_path_however_the_work_is_divided(
    folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = five_bar_in(folder)
    state = both_ways(study)
    assert 0 < state.checked <= 2  # a tenth
    assert 8 <= state.compiled <= state.statuses["ok"] < 16

    whole = in_one_chunk(study, monkeypatch)
    for file in sorted(Path("compiled").glob("designs-*"))[::2]:
        file.unlink()
    resumed = hybridyn.sweep(study, "compiled", resume=True)
    assert 0 < resumed.now < 16
    assert bits_of("compiled") == whole

    monkeypatch.setattr(compiled_chunks, "CompiledDesigns", refuse)
    next(Path("compiled").glob("designs-*")).unlink()
    refused(
        lambda: hybridyn.sweep(study, "compiled", resume=True),
        hybridyn.HybridynError,
        r"are of compiled models.*: no C compiler$",
    )


def refuse(*_: object, **__: object) -> None:
    """Stand for a machine without a compiler."""
    raise hybridyn.CompileError("no C compiler")


@pytest.mark.slow
def test_descriptions_of_many_designs_are_those_of_each(
    folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each file is read once, when it is asked for; designs that differ in scales share what was read."""
    variants = Variants(read_study(five_bar_in(folder)))
    values = np.array([[0.20, 1.0, 0.3], [0.25, 1.1, 0.3], [0.20, 0.9, 0.3]])
    each = [Variants(variants.source).description(variants.named(own)) for own in values]
    for own in values[:2]:
        variants.description(variants.named(own))
    monkeypatch.setattr(variants_module, "read", refuse)
    for own, wanted in zip(values, each, strict=True):
        assert differences(variants.description(variants.named(own)), wanted) == []
    refused(
        lambda: variants.description(variants.named(np.array([0.28, 1.0, 0.3]))),
        hybridyn.HybridynError,
        "no C compiler",
    )


def test_efforts_that_are_rounding_stop_no_sweep(monkeypatch: pytest.MonkeyPatch) -> None:
    """Efforts and accelerations of rounding are compared with natural sizes, not with themselves."""
    robot = hybridyn.load("five_bar")
    rest = np.zeros((2, robot.nv))
    theirs = [np.tile(robot.home, (2, 1)), rest, rest, np.full((2, len(robot.motors)), 1e-17)]
    ours = [*theirs[:3], -theirs[3]]
    assert _difference(robot, ours, theirs) <= compiled_designs.EQUAL
    weight = 9.81 * sum(body.mass for body in robot.bodies.bodies) * robot.bodies.size
    ours[3] = theirs[3] + 1e-9 * weight
    assert _difference(robot, ours, theirs) > compiled_designs.EQUAL
    ours = [*theirs[:2], rest + 1e-9, theirs[3]]
    assert _difference(robot, ours, theirs) > compiled_designs.EQUAL
    monkeypatch.setattr(compiled_designs, "natural_force", lambda *_: np.zeros(2))  # nothing has a mass
    theirs[3] = 0 * theirs[3]
    assert _difference(robot, theirs, theirs) == 0


@pytest.mark.slow
def test_models_that_differ_are_refused(folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    needs("compiled")
    study = five_bar_in(folder)
    monkeypatch.setattr(compiled_designs, "EQUAL", 0.0)
    refused(
        lambda: hybridyn.sweep(study, "out"),
        hybridyn.HybridynError,
        r"design \d+, task 'swing': compiled .* differ by",
    )


@pytest.mark.slow
def test_some_coordinates_of_a_pose_and_stated_numbers_give_the_rows_of_the_general_path(
    folder: Path, here: Any
) -> None:
    """Designs that do not reach the path are counted the same."""
    t = np.linspace(0, 0.8, 21)
    rows = np.column_stack([t, 0.15 * np.sin(8 * t), np.full(21, -0.48)])
    np.savetxt("tool.csv", rows, "%.17g", ",", header="time,m1_tool/pose/x,m1_tool/pose/z", comments="")
    state = both_ways(save(folder, NUMBERS, "five_bar.toml"))
    assert state.checked + state.statuses["unreachable"] == 12
    assert 6 <= state.compiled == state.statuses["ok"] < 12


@pytest.mark.slow
def test_the_pose_of_a_tool_through_modules_gives_the_rows_of_the_general_path(
    folder: Path, here: Any
) -> None:
    excavator(folder)
    t = np.linspace(0, 2.0, 41)
    x, z, _ = teeth(HOME)
    rows = np.column_stack([t, x - 0.3 * np.sin(t), z + 0.2 * np.sin(2 * t)])
    np.savetxt("teeth.csv", rows, "%.17g", ",", header="time,teeth/pose/x,teeth/pose/z", comments="")
    state = both_ways(save(folder, EXCAVATOR, "excavator.toml"))
    assert (state.compiled, state.checked, state.statuses) == (8, 8, {"ok": 8})


def scaled(description: Description, link: str, factor: float) -> Description:
    if factor < 0:
        raise hybridyn.ModelError("no robot")
    links = [
        replace(one, mass=factor * one.mass, inertia=factor * one.inertia) if one.name == link else one
        for one in description.links
    ]
    return replace(description, links=tuple(links))


def test_structures_that_occur_often_enough_are_found(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tips of other names stand for other structures."""
    text, robots = Path("pendulum.urdf").read_text(), {}
    for k in (1.0, 2.0, 3.0):
        Path("other.urdf").write_text(text.replace("tip", f"tip{k:.0f}"))
        robots[k] = read("other.urdf")
    designer = Designer(read_study(written("method = 'grid'", SCALES)))
    monkeypatch.setattr(
        designer.variants, "description", lambda own: scaled(robots[own["length"]], "rod", own["rod"])
    )
    monkeypatch.setattr(Designer, "__call__", lambda _, k, own: DesignRow(k, (), able[own[1]], (), ""))
    able = {1.0: "unreachable", 2.0: "ok", 3.0: "ok"}
    values = np.array([[1, 2], [2, 1], [2, 2], [2, 3], [3, 2], [1, -1], [1, 3]])  # -1 is no robot

    def found() -> list[tuple[list[float], set[str], list[float]]]:
        return [
            (structure.base.tolist(), {slot.field for slot in structure.slots}, some[:, 1].tolist())
            for structure, some in compiled_chunks._structures(designer, values)
        ]

    scales = {"mass", "inertia"}
    two, one = ([2.0, 2.0], scales, [1.0, 2.0, 3.0]), ([1.0, 2.0], scales, [2.0, 3.0])
    assert found() == [two, one]  # only one design has the third structure
    monkeypatch.setattr(Designer, "__call__", lambda _, k, own: DesignRow(k, (), "singular", (), ""))
    refused(found, hybridyn.HybridynError, "none of 6 designs")


@pytest.mark.slow
def test_each_structure_has_compiled_models_of_its_own(
    folder: Path, here: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    t = np.linspace(0.0, 0.8, 21)
    rows = np.column_stack([t, 0.3 * np.sin(5 * t), 1.5 * np.cos(5 * t), -7.5 * np.sin(5 * t)])
    header = "time,foot0/position,foot0/velocity,foot0/acceleration"
    np.savetxt("swing.csv", rows, "%.17g", ",", header=header, comments="")
    designs = [(n, 0.8 + 0.05 * k * (n > 1)) for k, n in enumerate([1, 2, 2, 1, 3, 2, 1, 2, 2])]
    np.savetxt("designs.csv", designs, "%.17g", ",", header="n,bar", comments="")
    study = save(
        folder,
        FOUR_BARS.format(file=ROOT / "urdf" / "benchmarks" / "n_four_bar.urdf.xacro"),
        "four_bars.toml",
    )
    state = both_ways(study)
    assert (state.compiled, state.checked, state.statuses) == (8, 8, {"ok": 9})
    assert in_one_chunk(study, monkeypatch) == bits_of("compiled")
