"""Commands of the pages and the README: they run, print what is shown, and write the files they name."""

import re
import shlex
import tomllib
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest
import yaml

import hybridyn
from hybridyn.cli import COMMANDS
from hybridyn.studies.cost import runs
from hybridyn.studies.sweep.reading import read_study
from tests import ROOT
from tests.pages.console import run_commands, shown
from tests.support.command_line import call
from tests.support.extras import needs
from tests.support.samples import slow
from tests.support.snippets import blocks, run_python, stand_where_a_user_does

DOCS = ROOT / "docs"
#: Number of commands of each page that has some: none is passed over.
COUNTS = {
    "check.md": 1, "workspace-and-sizing.md": 3, "joint-map.md": 2, "compiled.md": 1, "cost.md": 3,
    "sweeps.md": 4, "view-and-plot.md": 6,
}  # fmt: skip
#: Extras that the commands of a page need, with a module of them; robots with meshes need the viewer's.
EXTRAS = {"check.md": ["view"], "sweeps.md": ["sweep"], "view-and-plot.md": ["view"]}
FILE = re.compile(r"[\w.]+\.(png|svg|pdf|html|mp4|csv)")


@pytest.fixture
def as_a_user(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stand where a user does, before a terminal of 90 columns."""
    monkeypatch.setenv("COLUMNS", "90")
    stand_where_a_user_does(tmp_path, monkeypatch)


def write_studies() -> None:
    """Write the files of the page on sweeps."""
    run_python(DOCS / "sweeps.md")
    for block in blocks(DOCS / "sweeps.md", "toml"):
        Path(block.facts.get("file", "study.toml")).write_text(block.text)


@pytest.mark.usefixtures("as_a_user")
@pytest.mark.parametrize("page", [page if page == "check.md" else slow(page) for page in COUNTS])
def test_commands_print_what_is_shown(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    needs("view", "trimesh")  # the first page checks a robot with meshes
    for extra in EXTRAS.get(page, ()):
        needs(extra)
    if page == "sweeps.md":
        write_studies()
    if page == "cost.md":
        monkeypatch.setattr(runs, "FACTORS", (4.0,))
        monkeypatch.setattr(runs, "TOLERANCES", (1e-7,))
    text = shown(DOCS / page)
    assert text.count("$ hybridyn ") == COUNTS[page]
    if page == "view-and-plot.md":  # it shows a part of what is printed
        text = "\n".join(re.findall(r"^\$ .*$", text, re.MULTILINE))
    said = run_commands(text, capsys, whole=page in ("check.md", "workspace-and-sizing.md", "joint-map.md"))
    for word in re.findall(r"\S+", "\n".join(re.findall(r"^\$ hybridyn (.*)$", text, re.MULTILINE))):
        assert not FILE.fullmatch(word) or Path(word).stat().st_size > 500, word
    if page == "compiled.md":
        kinds = {path.suffix or path.name for path in (tmp_path / "five_bar_c").iterdir()}
        assert {".h", ".c", "Makefile", ".md"} <= kinds
        assert said.out == ""
    if page == "cost.md":
        assert said.out.startswith("# ")
        assert tomllib.loads(said.out)["solver"]["method"]


def test_the_study_of_the_page_is_right(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_studies()
    assert len(read_study("study.toml").columns) == 4
    assert read_study("falls.toml").columns == ["landing", "speed", "braking"]


def test_commands_that_are_only_shown_exist() -> None:
    only = [
        block.text for block in blocks(DOCS / "view-and-plot.md", "sh") if block.text.startswith("hybridyn")
    ]
    assert [text.split()[1] for text in only] == ["view"]
    assert "view" in COMMANDS


def test_the_tutorial_runs_from_its_first_to_its_last_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "90")
    names: dict[str, object] = {"__name__": "__page__"}
    robot, page = Path("five.urdf"), DOCS / "tutorial.md"
    for block in blocks(page):
        if "file" in block.facts:
            assert block.facts["file"] == robot.name
            robot.write_text(block.text)
        elif "before" in block.facts:
            head, found, tail = robot.read_text().partition(block.facts["before"])
            assert found
            robot.write_text(head + block.text + found + tail)
        elif block.language == "console":
            run_commands(block.text, capsys)
        elif block.language == "python":
            block.run(names)
    assert {path.name for path in tmp_path.glob("*.csv")} == {
        "wave.csv", "torques.csv", "with_friction.csv", "motors.csv", "tool.csv", "hand_torques.csv"
    }  # fmt: skip
    assert Path("torques.png").stat().st_size > 1000
    five = names["robot"]
    assert isinstance(five, hybridyn.HybridRobot)
    assert five.motors == ("left_drive", "right_drive")
    swing = names["swing"]
    assert np.ptp(swing.energy) < 1e-4 * swing.kinetic.max()  # type: ignore[attr-defined]  # rtol 1e-6, ten steps


#: The robots of the page on formats: language of the block, its motors and the extra that reads it.
ROBOTS = {
    "five_bar.xml": ("xml", ("motor_left", "motor_right"), "mjcf"),
    "five_bar.usda": ("usda", ("motor_left", "motor_right"), "usd"),
    "four_bar.sdf": ("xml", ("motor",), None),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_the_robot_of_the_page_is_read(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the page says is what hybridyn reads; lines break where the terminal ends."""
    language, motors, extra = ROBOTS[name]
    if extra:
        needs(extra)
    monkeypatch.chdir(tmp_path)
    (example,) = (b for b in blocks(DOCS / "formats.md", language) if name.partition(".")[0] in b.facts)
    Path(name).write_text(example.text)
    robot = hybridyn.load(name)
    assert (robot.motors, robot.mobility) == (motors, len(motors))
    assert hybridyn.closure_residual(robot, robot.home) < 1e-12
    told, _, _ = call(capsys, "info", name).out.partition("\n\n")
    if name == "five_bar.xml":
        assert " ".join(told.split()) in " ".join((DOCS / "formats.md").read_text().split())
    assert "error" not in call(capsys, "info", name).out
    if name == "four_bar.sdf":
        assert robot.description.root == "frame"
        assert "lost:" not in call(capsys, "convert", name, "-o", "other.sdf").err
        files = ["four_bar.sdf", "other.sdf", "other.sdf.model.toml"]
        assert sorted(path.name for path in tmp_path.iterdir()) == files
    else:
        efforts = [joint.effort for joint in robot.description.joints if joint.name in motors]
        assert (efforts, robot.description.notes) == ([50, 50], ())


# -------------------------------------------------------------------- the README


README = ROOT / "README.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())


@pytest.mark.slow
@pytest.mark.usefixtures("as_a_user")
def test_python_runs() -> None:
    run_python(README)


@pytest.mark.slow
@pytest.mark.usefixtures("as_a_user")
def test_commands_of_the_readme_print_what_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the order of the page: a later command reads what an earlier one wrote; no model is built yet."""
    monkeypatch.setenv("HYBRIDYN_CACHE", str(tmp_path / "cache"))
    run_commands(shown(README), capsys)
    run_commands(shown(ROOT / "docs" / "command-line.md"), capsys, whole=True)


@pytest.mark.parametrize("block", blocks(README, "sh"), ids=str)
def test_setup_command_names_what_exists(block) -> None:
    for is_and, group in groupby(shlex.split(block.text), key="&&".__eq__):
        if is_and:
            continue
        program, *words = group
        name = Path(program).name
        assert name in ("python3", "pip", "pytest", "hybridyn")
        if name == "pip":
            (extras,) = re.fullmatch(r"\.(?:\[(.*)\])?", words[-1]).groups()
            extras = set(extras.split(",")) if extras else set()
            assert extras <= PROJECT["project"]["optional-dependencies"].keys()
        if name == "hybridyn":
            assert words[0] in COMMANDS
            assert all((ROOT / word).is_file() for word in words[1:])


@pytest.mark.parametrize("marker", ["main job", "tests"])
def test_ci_finds_the_setup_commands(marker: str) -> None:
    assert README.read_text().count(f"<!-- {marker} -->\n```sh\n") == 1
    assert f'readme_command "{marker}"' in (ROOT / ".ci" / "run").read_text()


def test_version_and_paper_are_stated_alike() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert PROJECT["project"]["version"] == hybridyn.__version__ == citation["version"]
    assert PROJECT["project"]["license"] == citation["license"]
    assert citation["preferred-citation"]["doi"] == "10.1016/j.mechmachtheory.2009.11.007"
    assert citation["preferred-citation"]["doi"] in README.read_text()
