"""Robots by name: from Python, on the command line, from a clone and from what a wheel installs."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description import shipped
from hybridyn.description.shipped import find_robot, main_names, shipped_robots
from tests import ROOT
from tests.description.reading import save_all
from tests.support.command_line import call
from tests.support.comparing import refused

PARTS_OF_AN_ARM = {"stewart_ur5": 6, "scara_delta": 4}  # each joint of a serial arm is a module of its own


def test_every_file_of_a_robot_is_in_the_catalogue() -> None:
    files = {path.name.partition(".")[0] for path in (ROOT / "urdf").glob("*.urdf*")}
    assert set(main_names()) == files
    others = {path.name.partition(".")[0] for path in (ROOT / "urdf" / "benchmarks").glob("*.urdf*")}
    assert set(shipped_robots()) == files | others
    for name in main_names():
        robot = shipped_robots()[name]
        assert robot.trajectory is not None
        assert robot.scene in robot.scenes, "'hybridyn simulate NAME' plays the robot's own scene"
        assert robot.source


@pytest.mark.parametrize("name", main_names())
def test_the_catalogue_tells_the_truth(name: str) -> None:
    robot, facts = hybridyn.load(name), shipped_robots()[name]
    assert robot.name == name
    assert (len(robot.modules), len(robot.motors)) == (facts.modules, facts.motors)
    assert sum(not module.closures for module in robot.modules) == PARTS_OF_AN_ARM.get(name, 0)


def test_a_path_that_exists_wins(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "lx4").write_text('<robot name="mine"><link name="a"/></robot>')
    monkeypatch.chdir(tmp_path)
    assert find_robot("lx4") == "lx4"
    assert hybridyn.load("lx4").name == "mine"
    assert Path(find_robot("delta")).samefile(ROOT / "urdf" / "delta.urdf.xacro")


def test_a_wrong_name_is_told_the_nearest() -> None:
    refused(
        lambda: hybridyn.load("fivebar"),
        hybridyn.ModelError,
        r"no shipped robot of that name .did you mean 'five_bar'",
    )
    refused(lambda: hybridyn.load("zebra"), hybridyn.ModelError, "the shipped robots are lx4, tanev")
    refused(lambda: hybridyn.load("zebra.urdf"), hybridyn.ModelError, r"zebra\.urdf")  # a path stays one


def test_a_robot_moves_by_its_own_trajectory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    paths = ROOT / "urdf/five_bar.urdf.xacro", ROOT / "models/five_bar/traj.csv"
    by_name, *others = (
        call(capsys, "idm", *words, "-q").out
        for words in (["five_bar"], ["five_bar", "five_bar/traj.csv"], paths)
    )
    assert others == [by_name, by_name]


def test_a_scene_by_its_robots_name(capsys: pytest.CaptureFixture[str]) -> None:
    by_name, by_path = (
        call(capsys, "simulate", name, "--until", "0.01", "-q").out
        for name in ("five_bar", "five_bar/swing.toml")
    )
    assert by_name == by_path
    assert by_name.startswith("time,")


def test_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "--robots")
    assert [line.split()[0] for line in said.out.splitlines()[1 : len(main_names()) + 1]] == main_names()
    facts = json.loads(call(capsys, "--robots=json").out)
    assert [fact["name"] for fact in facts] == list(shipped_robots())
    assert all(Path(fact["file"]).is_file() for fact in facts)


@pytest.fixture
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder beside which the package looks for its data, which is empty."""
    monkeypatch.setattr(shipped, "PACKAGE", tmp_path / "hybridyn")
    shipped_robots.cache_clear()
    yield tmp_path
    monkeypatch.undo()
    shipped_robots.cache_clear()


@pytest.mark.usefixtures("elsewhere")
def test_without_data_the_list_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    call(capsys, "--robots", status=2, says="urdf/ and models/ are missing")
    refused(lambda: hybridyn.load("lx4"), hybridyn.ModelError, "no shipped robot of that name")


def test_benchmark_mechanisms_are_listed_as_such(elsewhere: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A file in urdf/benchmarks is found by its name; the list of robots says what it is."""
    text = '<robot name="rest"><link name="a"/></robot>'
    stated = '[rest]\nwhat = "A link that rests"\n'
    save_all(elsewhere, {"urdf/benchmarks/rest.urdf": text, "models/robots.toml": stated})
    assert hybridyn.load("rest").name == "rest"
    last = call(capsys, "--robots").out.splitlines()[-1]
    assert last.endswith("  A link that rests  benchmark mechanism")
