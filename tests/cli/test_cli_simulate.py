"""`hybridyn simulate`: results, stopping and going on, what it says, and what idm makes of a run."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridyn.cli import simulate
from tests import ROOT
from tests.support.command_line import read_table
from tests.support.extras import needs
from tests.support.files import save

SCENE = f"""duration = 0.03
[robot]
file = "{ROOT}/urdf/five_bar.urdf.xacro"
[initial]
joints = {{ m1_left_drive = 0.3 }}
[controller]
kind = "efforts"
efforts = {{ m1_left_drive = 0.5 }}
[output]
rate = 200.0
"""
EFFORTS = (
    1e-6  # efforts of the run against those of the inverse model, of the largest: closed loops, twice solved
)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    return save(tmp_path, SCENE, "scene.toml")


#: No engine is weighed, which takes a short run by itself.
GENERAL = "--engine", "general"


def table(path: Path) -> dict[str, np.ndarray]:
    return read_table(path.read_text())


def test_a_run_and_the_same_run_again(run, scene: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "a.csv", tmp_path / "b.csv"
    said = run("simulate", scene, "-o", first, *GENERAL)
    assert said.out == ""
    assert run("simulate", scene, "-o", second, "-q", *GENERAL) == (0, "", "")
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv", "scene.toml"]
    columns = table(first)
    joints = [f"m1_{side}_{joint}" for side in ("left", "right") for joint in ("drive", "elbow")]
    expected = [
        "time",
        *(f"{name}/{rate}" for name in joints for rate in ("position", "velocity", "acceleration")),
    ]
    expected += ["m1_left_drive/effort", "m1_right_drive/effort"]
    assert list(columns) == [*expected, "energy/kinetic", "energy/potential", "energy/total", "residual"]
    assert columns["time"] == pytest.approx(np.arange(7) / 200)
    assert columns["energy/total"] == pytest.approx(columns["energy/kinetic"] + columns["energy/potential"])
    for word in (
        "five_bar, base fixed: 0.03 s by dopri5",
        "peak kinetic",
        "worst closure residual",
        "steps",
        "wall time",
        "effects on: gravity, inertia, leg_inertia, velocity",
        "engine: ",
    ):
        assert word in said.err


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_run_is_read_back_as_a_trajectory(run, scene: Path, tmp_path: Path, ending: str) -> None:
    target = tmp_path / f"run.{ending}"
    if ending == "parquet":
        needs("io")
    run("simulate", scene, "-o", target, "-q", *GENERAL)
    said = run("idm", ROOT / "urdf/five_bar.urdf.xacro", target)
    assert "spline" not in said.err
    efforts = read_table(said.out)
    assert len(efforts["time"]) == 7
    assert efforts["m1_left_drive/effort"] == pytest.approx(0.5, abs=EFFORTS)
    assert efforts["m1_right_drive/effort"] == pytest.approx(0.0, abs=EFFORTS)
    run("ddm", ROOT / "urdf/five_bar.urdf.xacro", target, "-q")


def test_stopped_and_resumed_is_never_stopped(run, scene: Path, tmp_path: Path) -> None:
    whole, target = tmp_path / "whole.csv", tmp_path / "run.csv"
    run("simulate", scene, "-o", whole, "-q", *GENERAL)
    said = run("simulate", scene, "-o", target, "--until", 0.02, *GENERAL)
    assert f"go on with: hybridyn simulate {scene} --resume -o {target}" in said.err
    assert 0.02 <= table(target)["time"][-1] + 0.005 < 0.03
    said = run("simulate", scene, "--resume", "-o", target, "-q", *GENERAL)
    assert (said.status, said.err) == (0, "")
    assert target.read_bytes() == whole.read_bytes()
    assert not (tmp_path / "run.csv.state").exists()


LAW = """import os, signal
from pathlib import Path

def controller(robot):
    def law(t, q, v):
        mark = Path(__file__).with_name("stop")
        if t > 0.01 and mark.exists():
            mark.unlink()
            os.kill(os.getpid(), signal.SIGINT)
        return [0.5, 0.0]
    return law
"""


def test_ctrl_c_keeps_what_was_computed(run, scene: Path, tmp_path: Path) -> None:
    """The signal comes in the middle of a step; the run stops after it, and goes on to the same bits."""
    (tmp_path / "law.py").write_text(LAW)
    scene.write_text(
        SCENE.replace('kind = "efforts"', 'kind = "python"\nfile = "law.py"').replace("efforts = {", "#")
    )
    target, whole = tmp_path / "run.csv", tmp_path / "whole.csv"
    run("simulate", scene, "-o", whole, "--allow-python", *GENERAL)
    (tmp_path / "stop").touch()
    said = run("simulate", scene, "-o", target, "--allow-python", *GENERAL, status=130)
    assert "stopped at t = 0.0" in said.err
    assert 0 < len(table(target)["time"]) < 7
    run("simulate", scene, "--resume", "-o", target, "--allow-python", *GENERAL)
    assert target.read_bytes() == whole.read_bytes()


def test_what_cannot_be_resumed(run, scene: Path, tmp_path: Path) -> None:
    target = tmp_path / "run.csv"
    run("simulate", scene, "-o", target, "--until", 0.02, "-q", *GENERAL)
    other = save(
        tmp_path,
        SCENE.replace("efforts = { m1_left_drive = 0.5 }", "efforts = { m1_left_drive = 0.6 }"),
        "other.toml",
    )
    run("simulate", other, "--resume", "-o", target, status=1, says="was not begun with this scene")
    begun = target.read_bytes()
    run(
        "simulate",
        other,
        "-o",
        target,
        status=2,
        says=f"and was not begun with this scene as it stands in '{other}' now: --overwrite begins anew",
    )
    run("simulate", scene, "-o", target, status=2, says="--resume continues it, --overwrite begins anew")
    assert target.read_bytes() == begun
    run("simulate", scene, "-o", target, "--until", 0.02, "-q", "--overwrite", *GENERAL)
    assert target.read_bytes() == begun
    (tmp_path / "run.csv.state").unlink()
    run("simulate", scene, "--resume", "-o", target, status=1, says="no '.state' file")
    run("simulate", scene, "--resume", status=2, says="name it with -o")
    (tmp_path / "run.csv.state").write_text("x")
    run("simulate", scene, "--resume", "-o", target, status=1)
    run("simulate", scene, "-o", target, status=2, says="now: --overwrite begins anew")


@pytest.mark.parametrize("status", simulate.FAILED)
def test_a_run_that_an_error_ended_is_not_one_to_continue(
    run, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: str
) -> None:
    """It would come to the same error: what is corrected begins anew, without --overwrite."""
    target, played = tmp_path / "run.csv", simulate.play

    def failing(*given: Any, **options: Any) -> Any:
        """Play the scene, which an error ends."""
        return replace(played(*given, **options), status=status, message="at t = 0.02 s")

    words = ("simulate", scene, "--until", 0.01, "-q", "-o", target, *GENERAL)
    with monkeypatch.context() as patch:
        patch.setattr(simulate, "play", failing)
        run(*words, status=1, says=f"{status} at t = 0.02 s")
        assert target.exists()
        run(*words, "--resume", status=1, says="finished, ended with an error, or was not begun here")
    scene.write_text(SCENE.replace("0.5", "0.6"))
    assert run(*words)[0] == 0


def test_columns_and_file_of_the_scene(run, tmp_path: Path) -> None:
    path = save(tmp_path, SCENE + 'columns = ["*/effort", "energy/total"]\nfile = "mine.csv"\n', "scene.toml")
    assert run("simulate", path, "-q", "--until", 0.02, *GENERAL)[0] == 0
    assert list(table(tmp_path / "mine.csv")) == [
        "time",
        "m1_left_drive/effort",
        "m1_right_drive/effort",
        "energy/total",
    ]
    path.write_text(SCENE + 'columns = ["*/efort"]\n')
    said = f"{path}:11: 'output.columns': '*/efort' matches no column"
    run("simulate", path, "--until", 0.01, status=1, says=said)


def test_standard_output_and_mistakes(run, scene: Path) -> None:
    said = run("simulate", scene, "--until", 0.02, *GENERAL)
    assert said.out.startswith("time,m1_left_drive/position,")
    assert "give a result file" in said.err
    scene.write_text(SCENE.replace("efforts = {", "effort = {"))
    said = run("simulate", scene, status=1)
    assert said.err.startswith(
        f"error: {scene}:8: 'controller.effort': unknown key 'effort' (did you mean 'efforts'?)"
    )
    scene.write_text(
        SCENE.replace('kind = "efforts"', 'kind = "python"\nfile = "law.py"').replace("efforts = {", "#")
    )
    run("simulate", scene, status=1, says="--allow-python")


def test_a_run_that_an_event_ends_is_whole(run, scene: Path, tmp_path: Path) -> None:
    """It swings towards a singularity of its loop."""
    scene.write_text(SCENE.replace("0.03", "0.06") + '[[events]]\nsingularity = "closures"\nat = 0.4\n')
    target = tmp_path / "run.csv"
    said = run("simulate", scene, "-o", target, *GENERAL)
    assert "event: singularity of the closures at " in said.err
    assert 0.0 < table(target)["time"][-1] < 0.06
