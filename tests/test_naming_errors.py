"""What commands take for granted and say beside their numbers; messages name what they speak of."""

import csv
import json
import os
import pickle
import re
import resource
import sys
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import hybridyn
from hybridyn.description.bounds import BOUNDS
from hybridyn.description.side_cars.toml_file import MOST_PARTS, line_of, parse_toml
from hybridyn.errors import (
    AT_SAMPLE,
    LONGEST,
    HybridynError,
    ModelError,
    SingularityError,
    TrajectoryError,
    install_advice,
)
from hybridyn.scenes.scene_file import read_scene
from hybridyn.simulation.result import SimulationResult
from hybridyn.streams.one_pass import samples_counted_from
from hybridyn.tables.opening import read_columns
from tests.support.command_line import call, read_table
from tests.support.comparing import refused
from tests.support.extras import needs
from tests.support.files import save


@pytest.fixture
def no_room(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let files have 200 bytes at most, which stands for a full disk.

    The robot is known before, and no bytecode is written: what is cut short would stay so for later tests.
    """
    hybridyn.load("five_bar")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("idm", "efforts.csv"), ("idm", "efforts.parquet"), ("idm", "share.svg"),
        pytest.param("convert", "five_bar.h", marks=pytest.mark.slow),
        pytest.param("cost", "points.csv", marks=pytest.mark.slow),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("no_room")
def test_a_disk_without_room_names_the_file(
    command: str, file: str, run: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if file.endswith("parquet"):
        needs("io")
    option = "--plot" if file.endswith("svg") else "-o"
    target = "." if command == "convert" else file
    own = {"convert": ["--c"], "--plot": ["--by-effect"]}
    own_words = own.get(command, own.get(option, []))
    monkeypatch.chdir(tmp_path)
    said = run(command, "five_bar", *own_words, option, target, status=1)
    (line,) = [line for line in said.err.splitlines() if line.startswith("error: ")]
    assert file in line
    assert "File too large" in line
    assert "bug" not in line
    assert [*tmp_path.iterdir()] == []


def test_a_full_device_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "idm", "five_bar", "-o", "/dev/full", "-q", status=1)
    assert said.err == "error: /dev/full: No space left on device\n"


def test_the_extra_that_installs_a_package_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hybridyn.description.urdf.xacro.share_dirs", list)
    refused(lambda: hybridyn.load("stewart_ur5"), ModelError, f", or {re.escape(install_advice('robots'))}")
    call(capsys, "info", "stewart_ur5", status=1, says="name the folder that holds it with --package-dir, or")


@pytest.mark.parametrize("wrong", ["fast", 10**400], ids=["a word", "too large"])
def test_what_is_no_number_is_named(wrong: Any) -> None:
    robot = hybridyn.load("five_bar")
    motor, link = robot.motors[0], "m1_tool"
    v = np.zeros(robot.nv)
    calls: dict[str, Callable[[], object]] = {
        "q is": lambda: hybridyn.idm(robot, np.array([wrong] * robot.nq, dtype=object), v, v),
        "time is": lambda: hybridyn.idm(robot, robot.home, v, v, time=wrong),
        f"wrench on '{link}' is": lambda: hybridyn.idm(
            robot, robot.home, v, v, wrenches={link: np.array([wrong] * 6)}
        ),
        f"joint '{motor}' is": lambda: hybridyn.assemble(robot, motors={motor: (0.0, wrong)}),
        f"the pose of '{link}' is": lambda: hybridyn.assemble(robot, platforms={link: ([wrong] * 7,)}),
        f"coordinate 'x' of '{link}' is": lambda: hybridyn.assemble(robot, platforms={link: {"x": wrong}}),
        "guess is": lambda: hybridyn.assemble(robot, guess=np.array([wrong] * robot.nq)),
    }
    for name, run in calls.items():
        refused(run, TrajectoryError, f"{name} not an array of numbers")
    refused(
        lambda: hybridyn.assemble(robot, platforms={link: {"x": np.zeros((2, 2))}}),
        TrajectoryError,
        f"coordinate 'x' of '{link}' needs finite numbers of shape",
    )


def test_the_sentence_of_an_error_is_composed_of_its_data() -> None:
    def says(error: HybridynError) -> str:
        return str(pickle.loads(pickle.dumps(error)))  # as a pool of processes hands it on

    error = SingularityError(f"module 'a{{b}}': its legs lose rank{AT_SAMPLE} (limit 1)", sample=3)
    assert says(error) == "module 'a{b}': its legs lose rank at sample 3 (limit 1)"
    with pytest.raises(SingularityError) as caught, samples_counted_from(100):
        raise error
    assert caught.value.sample == 103
    assert says(error) == "module 'a{b}': its legs lose rank at sample 103 (limit 1)"
    error.advice += ", or more"
    error.within("t.csv, row 104", row_named=True)
    error.within("scene.toml:7")
    assert error.message == "module 'a{b}': its legs lose rank (limit 1), or more"
    assert says(error) == f"scene.toml:7: t.csv, row 104: {error.message}"


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

    def measured(study: object, load: object, trajectory: str, *_: object, **__: object) -> None:
        asked.append(trajectory)
        raise ModelError("enough")

    monkeypatch.setattr("hybridyn.cli.cost._measure", measured)
    assert call(capsys, "cost", "lx4", status=1).err == "error: enough\n"
    assert [Path(name).parts[-2:] for name in asked] == [("lx4", "traj.csv")]


def test_no_error_is_longer_than_a_few_lines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "n" * 1900
    text = f'<robot name="r"><link name="{name}"/><link name="{name}x"/><link name="{name}y"/></robot>'
    robot = save(tmp_path, text, "robot.urdf")
    said = call(capsys, "info", robot, status=1)
    assert said.err.startswith(f"error: {robot}")
    assert said.err.endswith("remove the links of the others\n")
    assert len(said.err) < LONGEST + 20
    caught = refused(lambda: hybridyn.load(robot), ModelError, "")
    assert len(str(caught)) <= LONGEST
    assert len(call(capsys, "info", "x" * 5000, status=2).err) < LONGEST + 20


def test_a_film_knows_how_many_pictures_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    from hybridyn.view import film
    from hybridyn.view.run import ShownMotion

    for name in ("render", "labelled", "camera_around", "corners_of", "place_bodies"):
        monkeypatch.setattr(film, name, lambda *_, **__: None)
    run = ShownMotion(np.linspace(0.0, 2.5, 11), np.zeros((11, 1)), None, "")
    count, speed = film.pictures_of(run)
    assert (count, speed) == (round(2.5 * film.RATE), 1.0)
    shot = film.Shot(hybridyn.load("five_bar"), None, (2, 2))  # type: ignore[arg-type]
    assert len([*film.frames_of_run(shot, run)]) == count
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
    first = {name: column[0] for name, column in read_table((tmp_path / "run.csv").read_text()).items()}
    assert [first[f"{root}/pose/{axis}"] for axis in "xyz"] == [0.1, 0.0, 0.5]
    assert first[f"{root}/velocity/x"] == pytest.approx(0.3, rel=1e-12)
    assert first[f"{robot.motors[0]}/position"] == pytest.approx(0.1, rel=1e-12)
    assert first[f"{robot.motors[1]}/position"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", ["r.urdf", "r.urdf.xacro", "s.toml", "r.state", "t.csv"])
def test_a_pipe_is_not_waited_for(tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / name
    os.mkfifo(file)
    monkeypatch.setattr("builtins.open", lambda *_, **__: pytest.fail("it was opened, and waited for"))
    readers = {
        ".urdf": hybridyn.load, ".xacro": hybridyn.load, ".toml": read_scene, ".state": SimulationResult.load,
        ".csv": lambda file: read_columns(file, ["time"]),
    }  # fmt: skip
    caught = refused(lambda: readers[file.suffix](str(file)), hybridyn.HybridynError, "is not a regular file")
    assert name in str(caught)


def dotted(parts: int) -> str:
    return ".".join(["a"] * parts)


@pytest.mark.parametrize("text", ["{} = 1", "[{}]", "x = {{ {} = 1 }}", "[[{}]]", "x = [1, {{{} = 2}}]"])
def test_a_key_of_many_parts_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    parse_toml(text.format(dotted(MOST_PARTS)).encode(), "f.toml")
    monkeypatch.setattr(tomllib, "loads", lambda text: pytest.fail("it was read, which takes 8 GB"))
    for key in (dotted(40_000), dotted(MOST_PARTS + 1), " . ".join(['"a"', "'b'"] * 9)):
        refused(
            partial(parse_toml, f"\n{text.format(key)}".encode(), "f.toml"),
            hybridyn.ModelError,
            r"f\.toml:2: .*a key has more than 16 parts",
        )


@pytest.mark.parametrize(
    "text",
    [
        f'x = "{dotted(40)}"',
        f"x = '{dotted(40)}'  # {dotted(40)}",
        f'x = """\n{dotted(40)} " {dotted(40)}"""',
        f"x = '''\n{dotted(40)} ' {dotted(40)}'''",
        f'x = "a\\"b" # {dotted(40)}\ny = [1.5, 2.5]\n',
        "x = [" + "1.5, " * 100 + "]",
    ],
)
def test_dots_in_texts_and_comments_are_no_parts(text: str) -> None:
    assert parse_toml(text.encode(), "f.toml")[1] == tomllib.loads(text)


def test_texts_that_do_not_end_or_are_large_are_refused_at_once() -> None:
    most = BOUNDS["side-car"].most
    large = partial(parse_toml, b"#" * (most + 1), "f.toml")
    refused(large, hybridyn.ModelError, "is larger than 1 MiB")
    for text in (
        '"""' + '\\"""' * 50_000,
        "'''" + "''" * 50_000 + "'",
        '"' * 100_001,
        "a" * most,
    ):
        refused(partial(parse_toml, text.encode(), "f.toml"), hybridyn.ModelError, "not readable as TOML")


def test_a_line_without_an_assignment_is_soon_passed() -> None:
    """A long word is no key where no '=' follows; the search must not try each way to cut it."""
    text = 'x = """\n' + "a" * 5000 + '!\n"""\na."b c".d = 1\n'
    assert line_of(text, ("a", "b c", "d")) == 4
