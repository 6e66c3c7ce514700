"""What commands take for granted, write and say beside their numbers."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.errors import LONGEST, ModelError
from tests.command_line import call, read_table, without_remarks
from tests.comparing import refused
from tests.files import save

OWN = "five_bar/traj.csv"


@pytest.mark.parametrize("form", ["csv", "json"])
def test_effects_take_the_shipped_motion_and_write_their_numbers(
    form: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = tmp_path / f"worth.{form}"
    words = ("idm", "five_bar", "--by-effect", "--effects", "default")
    said = call(capsys, *words, "-o", report)
    text = report.read_text()
    rows = json.loads(text) if form == "json" else list(csv.DictReader(text.splitlines()))
    assert {row["effect"] for row in rows} == {"gravity", "inertia", "leg_inertia", "velocity"}
    table = [line.split() for line in said.out.splitlines()]
    for row in rows:
        (shown,) = [cells for cells in table if cells[:2] == [row["effect"], row["motor"]]]
        assert float(shown[2]) == pytest.approx(float(row["peak"]), rel=1e-3)
        assert shown[4:6] == row["unit"].split()


def test_cost_takes_the_shipped_motion(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[str] = []

    def measured(study: object, load: object, trajectory: str, progress: object) -> None:
        asked.append(trajectory)
        raise ModelError("enough")

    monkeypatch.setattr("hybridyn.cli.cost._robot", measured)
    assert call(capsys, "cost", "lx4", status=1).err == "error: enough\n"
    assert [Path(name).parts[-2:] for name in asked] == [("lx4", "traj.csv")]


def test_no_error_is_longer_than_a_few_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    robot = tmp_path / "robot.urdf"
    name = "n" * 1900
    robot.write_text(
        f'<robot name="r"><link name="{name}"/><link name="{name}x"/><link name="{name}y"/></robot>'
    )
    said = call(capsys, "info", robot, status=1)
    assert said.err.startswith(f"error: {robot}")
    assert said.err.endswith("a floating joint leaves free)\n")
    assert len(said.err) < LONGEST + 20
    caught = refused(lambda: hybridyn.load(robot), ModelError, "")
    assert len(str(caught)) <= LONGEST
    assert len(call(capsys, "info", "x" * 5000, status=2).err) < LONGEST + 20


def test_a_film_knows_how_many_pictures_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    from hybridyn.view import film
    from hybridyn.view.run import Run

    for name in ("render", "labelled", "camera_around", "corners_of", "place_bodies"):
        monkeypatch.setattr(film, name, lambda *_, **__: None)
    run = Run(np.linspace(0.0, 2.5, 11), np.zeros((11, 1)), None, "")
    count, speed = film.pictures_of(run)
    assert (count, speed) == (round(2.5 * film.RATE), 1.0)
    assert len([*film.frames_of_run(hybridyn.load("five_bar"), None, run, (2, 2))]) == count  # type: ignore[arg-type]
    assert film.pictures_of(None) == (round(film.AROUND * film.RATE), 1.0)


def test_a_floating_base_is_placed_without_naming_every_motor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The base's pose leaves the motors open; they stay at home where the scene does not name them."""
    robot = hybridyn.load("five_bar", base="floating")
    root = robot.description.root
    scene = save(
        tmp_path,
        'duration = 0.01\n[robot]\nfile = "five_bar"\nbase = "floating"\n[initial]\n'
        f"joints = {{ {robot.motors[0]} = 0.1 }}\nplatforms = {{ {root} = [0.1, 0, 0.5, 0, 0, 0, 1] }}\n"
        f"rates.platforms = {{ {root} = [0.3, 0, 0, 0, 0, 0] }}\n"
        '[solver]\nmethod = "rk4"\nstep = 1e-2\n[output]\nrate = 100\n',
        "scene.toml",
    )
    call(capsys, "simulate", scene, "-o", tmp_path / "run.csv")
    first = {name: column[0] for name, column in read_table(without_remarks(tmp_path / "run.csv")).items()}
    assert [first[f"{root}/pose/{axis}"] for axis in "xyz"] == [0.1, 0.0, 0.5]
    assert first[f"{root}/velocity/x"] == pytest.approx(0.3, rel=1e-12)
    assert first[f"{robot.motors[0]}/position"] == pytest.approx(0.1, rel=1e-12)
    assert first[f"{robot.motors[1]}/position"] == pytest.approx(0.0, abs=1e-12)
