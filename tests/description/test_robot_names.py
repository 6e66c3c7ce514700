"""Robots by name: from Python, on the command line, from a clone and from what a wheel installs."""

import json
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description import shipped
from hybridyn.description.shipped import find_robot, main_names, shipped_robots
from tests import ROOT
from tests.command_line import call
from tests.comparing import refused

PARTS_OF_AN_ARM = {"stewart_ur5": 6, "scara_delta": 4}  # each joint of a serial arm is a module of its own


def test_every_file_of_a_robot_is_in_the_catalogue() -> None:
    files = {path.name.partition(".")[0] for path in (ROOT / "urdf").glob("*.urdf*")}
    assert set(main_names()) == files
    for name in main_names():
        robot = shipped_robots()[name]
        assert robot.trajectory is not None
        assert len(robot.scenes) == 1, "'hybridyn simulate NAME' plays the robot's one scene"
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
    with pytest.raises(hybridyn.ModelError, match=r"zebra\.urdf"):  # a path stays one
        hybridyn.load("zebra.urdf")


def test_a_robot_moves_by_its_own_trajectory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    by_name = call(capsys, "idm", "five_bar")
    named_table = call(capsys, "idm", "five_bar", "five_bar/traj.csv", "-q")
    paths = (ROOT / "urdf/five_bar.urdf.xacro", ROOT / "models/five_bar/traj.csv")
    by_path = call(capsys, "idm", *paths, "-q")
    assert by_name.status == by_path.status == named_table.status == 0
    assert by_name.out == by_path.out == named_table.out


def test_a_scene_by_its_robots_name(capsys: pytest.CaptureFixture[str]) -> None:
    by_name = call(capsys, "simulate", "five_bar", "--until", "0.01", "-q")
    by_path = call(capsys, "simulate", "five_bar/swing.toml", "--until", "0.01", "-q")
    assert by_name.out == by_path.out
    assert by_name.out.startswith("# ")


def test_the_list(capsys: pytest.CaptureFixture[str]) -> None:
    said = call(capsys, "robots")
    assert [line.split()[0] for line in said.out.splitlines()[1 : len(main_names()) + 1]] == main_names()
    facts = json.loads(call(capsys, "robots", "--json").out)
    assert [fact["name"] for fact in facts] == list(shipped_robots())
    assert all(Path(fact["file"]).is_file() for fact in facts)


def test_without_data_the_list_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr(shipped, "PACKAGE", tmp_path / "hybridyn")
    shipped_robots.cache_clear()
    try:
        call(capsys, "robots", status=1, says="urdf/ and models/ are missing")
        refused(lambda: hybridyn.load("lx4"), hybridyn.ModelError, "no shipped robot of that name")
    finally:
        monkeypatch.undo()
        shipped_robots.cache_clear()


def test_benchmark_mechanisms_are_listed_apart(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A file in urdf/benchmarks is found by its name; its first comment says what it is."""
    (tmp_path / "urdf" / "benchmarks").mkdir(parents=True)
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "robots.toml").write_text("")
    text = '<!-- A link\n that rests. Not more. --><robot name="rest"><link name="a"/></robot>'
    (tmp_path / "urdf" / "benchmarks" / "rest.urdf").write_text(text)
    monkeypatch.setattr(shipped, "PACKAGE", tmp_path / "hybridyn")
    shipped_robots.cache_clear()
    try:
        assert hybridyn.load("rest").name == "rest"
        assert call(capsys, "robots").out.splitlines()[-2:] == [
            "benchmark mechanisms:",
            "rest  A link that rests",
        ]
    finally:
        monkeypatch.undo()
        shipped_robots.cache_clear()
