"""The command and the function: which files are written, which loops are closed first, what is said."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import ModelError, closure_residual, convert
from hybridyn.description import Description, Joint, Link, read
from hybridyn.structure.building import build_robot
from tests import ROOT
from tests.command_line import call
from tests.comparing import refused
from tests.conversion.facts import SINGLE
from tests.conversion.features import coupled
from tests.extras import needs
from tests.robot_texts import CLOSED_FOUR_BAR, FOUR_BAR, save
from tests.snippets import blocks


def test_the_command_writes_a_robot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out" / "robot.urdf"
    out.parent.mkdir()
    said = call(capsys, "convert", save(tmp_path, CLOSED_FOUR_BAR), "-o", out, "--strict")
    assert said.out == ""
    assert str(out) in said.err
    assert [path.name for path in out.parent.iterdir()] == ["robot.urdf"]
    assert hybridyn.load(out).motors == ("drive",)


def test_losses_are_listed(tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, CLOSED_FOUR_BAR), base="floating", gravity=(0, 0, -1.62))
    done = convert(robot, tmp_path / "moon.urdf")
    assert [line.partition(",")[0] for line in done.losses] == [
        "the base floats",
        "gravity of 0 0 -1.62 m/s^2",
    ]


def test_strict_has_an_exit_status(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = save(tmp_path, CLOSED_FOUR_BAR), tmp_path / "out.xml"
    for words, status in (((), 0), (("--strict",), 1)):
        said = call(capsys, "convert", file, "-o", out, *words, status=status)
        for told in (
            "lost: speed limits, which MuJoCo does not have: 'drive'",
            "closures stay within 0.0001 m",
        ):
            assert told in said.err
    assert out.read_text().startswith("<mujoco")


def test_the_base_may_float(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out.xml"
    call(capsys, "convert", save(tmp_path, CLOSED_FOUR_BAR), "-o", out, "--base", "floating")
    assert '<freejoint name="ground:free" />' in out.read_text()


def test_the_page_shows_what_the_command_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (example,) = blocks(ROOT / "docs" / "convert.md", "console")
    command, *shown = example.text.splitlines()
    monkeypatch.chdir(tmp_path)
    assert call(capsys, *command.removeprefix("$ hybridyn ").split()).err.splitlines() == shown


def test_its_own_file_is_never_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = save(tmp_path, CLOSED_FOUR_BAR)
    call(capsys, "convert", file, "-o", tmp_path / "." / file.name, status=1, says="is the robot's own file")
    assert file.read_text() == CLOSED_FOUR_BAR
    refused(lambda: convert(hybridyn.load(file), file), ModelError, "own file")


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("robot.udrf", "unknown ending '.udrf' .did you mean '.urdf'"),
        ("robot", "unknown ending ''"),
        ("none/robot.urdf", "the folder .* does not exist"),
        ("folder.urdf", "is a folder"),
    ],
)
def test_a_wrong_target_is_refused(target: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "folder.urdf").mkdir()
    refused(lambda: convert(save(tmp_path, CLOSED_FOUR_BAR), tmp_path / target), ModelError, message)


def test_model_files_of_others_stay(tmp_path: Path) -> None:
    file, out = save(tmp_path, CLOSED_FOUR_BAR), tmp_path / "other.urdf"
    save(tmp_path, "[home]\ndrive = 0.5\n", "four_bar.model.toml")
    (beside,) = convert(file, out).files[1:]
    assert beside.name == "other.urdf.model.toml"
    assert convert(file, out).files[1:] == (beside,)  # its own are replaced
    (tmp_path / "four_bar.model.toml").unlink()
    assert convert(file, out).files == (out,)
    assert not beside.exists()  # and removed, since they would be read with the new robot
    beside.write_text("[home]\ndrive = 1\n")
    assert convert(file, out).files == (out,)
    save(tmp_path, "[home]\ndrive = 0.5\n", "four_bar.model.toml")
    refused(lambda: convert(file, out), ModelError, "is not from convert")
    assert beside.read_text() == "[home]\ndrive = 1\n"


def test_files_of_other_outputs_stay(tmp_path: Path) -> None:
    """The side-car of a URDF has the name that the URDF of another ending would have beside it."""
    links = tuple(Link(name, 1.0, np.zeros(3), np.eye(3)) for name in ("base", "arm"))
    ball = Joint("ball", "spherical", "base", "arm", np.eye(4), np.array([0.0, 0.0, 1.0]))
    source = tmp_path / "first.urdf"
    robot = hybridyn.load(save(tmp_path, CLOSED_FOUR_BAR))
    convert(replace(robot, description=Description("ball", links, (ball,))), source)
    car = source.with_suffix(".yaml")
    before = {file: file.read_bytes() for file in (source, car)}
    for ending in (".sdf", ".xml", ".usda"):
        convert(source, source.with_suffix(ending))
        assert {file: file.read_bytes() for file in before} == before
    assert read(source).joints[0].kind == "spherical"
    link = tmp_path / "other.yaml"
    link.symlink_to(car)  # even as the side-car of another URDF, it is not from that conversion
    refused(
        lambda: convert(source, tmp_path / "other.urdf"), ModelError, r"other.yaml: .* is not from convert"
    )
    assert car.read_bytes() == before[car]


@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf", ".usda", ".usd"])
def test_outputs_that_convert_did_not_write_stay(ending: str, tmp_path: Path) -> None:
    extra = {".xml": "mjcf", ".usda": "usd", ".usd": "usd"}.get(ending)
    if extra is not None:
        needs(extra)
    file, out = save(tmp_path, CLOSED_FOUR_BAR), tmp_path / f"out{ending}"
    out.write_text("<robot>the work of a day</robot>\n")
    refused(
        lambda: convert(file, out), ModelError, rf"out{ending}: exists and is not from convert; move it away"
    )
    assert out.read_text() == "<robot>the work of a day</robot>\n"
    out.unlink()
    convert(file, out)
    convert(file, out)  # its own is replaced
    assert read(out).name == read(file).name


def test_files_for_other_robots_are_not_read(tmp_path: Path) -> None:
    file, out = save(tmp_path / "here", CLOSED_FOUR_BAR), tmp_path / "robot.urdf"
    save(tmp_path, "[home]\ndrive = 0.5\n", "robot.model.toml")
    save(tmp_path, "joint_name: [drive]\njoint_type: [SPHERICAL]\n", "robot.yaml")
    refused(lambda: convert(file, out), ModelError, r"robot.yaml: .* is not from convert")
    done = convert(file, tmp_path / "robot2.urdf")
    assert [path.name for path in done.files] == ["robot2.urdf", "robot2.yaml"]
    assert {joint.kind for joint in hybridyn.load(done.files[0]).description.joints} == {
        "continuous",
        "revolute",
    }
    (tmp_path / "robot.yaml").unlink()
    assert [path.name for path in convert(file, out).files] == ["robot.urdf", "robot.urdf.model.toml"]
    assert hybridyn.load(out).description.home == {}


@pytest.mark.parametrize("tightness", [0.0, -1.0, float("nan"), float("inf")])
def test_tightness_is_a_length(tightness: float, tmp_path: Path) -> None:
    refused(
        lambda: convert(save(tmp_path, CLOSED_FOUR_BAR), tmp_path / "out.urdf", tightness=tightness),
        ModelError,
        "tightness",
    )


def test_names_that_no_file_can_hold_are_refused(tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, CLOSED_FOUR_BAR))
    robot = replace(robot, description=replace(robot.description, name="four\0bar"))
    refused(
        lambda: convert(robot, tmp_path / "out.urdf"),
        ModelError,
        r"the name 'four.x00bar' is empty, or has characters",
    )


# -------------------- loops that are open at home


#: Residual of a closed posture that went through a file.
CLOSED = 1e-12
#: A coupler that is too short for a drive at 2 rad.
SHORT = FOUR_BAR.replace(
    '<predecessor link="coupler"><origin xyz="1.5', '<predecessor link="coupler"><origin xyz="0.6'
)
OPEN = "'pin' is open at home by "


def four_bar(folder: Path, text: str, drive: float) -> Path:
    """Write a four-bar whose home states the position of its motor alone."""
    save(folder, f"[home]\ndrive = {drive}\n", "four_bar.model.toml")
    return save(folder, text)


@pytest.mark.parametrize("ending", [".urdf", ".sdf", ".xml", ".usda"])
def test_open_loops_are_closed_with_the_motors_where_they_are(ending: str, tmp_path: Path) -> None:
    if ending in (".xml", ".usda"):
        needs({".xml": "mjcf", ".usda": "usd"}[ending])
    file = four_bar(tmp_path, FOUR_BAR, 0.3)
    before = hybridyn.load(file)
    assert closure_residual(before, before.home) > 0.1
    done = convert(file, tmp_path / f"out{ending}")
    (note,) = (line for line in done.notes if "open at home" in line)
    assert note.startswith(OPEN)
    assert note.endswith("; written closed, with the motors where they are")
    after = hybridyn.load(done.files[0])
    closed = SINGLE if ending == ".usda" else CLOSED
    assert closure_residual(after, after.home) < closed
    if ending == ".sdf":  # which counts positions from the posture in which links stand
        assert any(line.startswith("positions of joints count from home") for line in done.losses)
        assert after.description.home == {}
    else:
        assert after.description.home["drive"] == pytest.approx((0.3,), abs=closed)


def test_a_home_that_is_closed_stays(tmp_path: Path) -> None:
    done = convert(save(tmp_path, CLOSED_FOUR_BAR), tmp_path / "out.urdf")
    assert not any("open at home" in note for note in done.notes)
    assert hybridyn.load(done.files[0]).description.home == {}


def test_couplings_are_closed(tmp_path: Path) -> None:
    """Joint "two" turns twice as far as "one", which is at 0.3 rad, plus half a radian."""
    robot = build_robot(coupled("two", ("two", 1.0), ("one", -2.0), offset=0.5))
    done = convert(robot, tmp_path / "out.urdf")
    assert any(note.startswith("'two' is open at home by 0.55 ") for note in done.notes)
    home = hybridyn.load(done.files[0]).description.home
    assert (*home["one"], *home["two"], *home["rail"]) == pytest.approx((0.3, 1.1, 0.1), abs=CLOSED)


def test_loops_that_cannot_be_closed_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = four_bar(tmp_path, SHORT, 2.0), tmp_path / "out.xml"
    refused(lambda: convert(file, out), ModelError, OPEN, element="pin")
    mend = "state a closed home posture: [home] in model.toml"
    says = ["no posture near home closes it with the motors where they are", mend]
    call(capsys, "convert", file, "-o", out, status=1, says=says)
    assert not out.exists()
