"""The command and the function: which files are written, which loops are closed first, what is said."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn import ModelError, closure_residual, convert
from hybridyn.description import Description, Joint, Link, read
from hybridyn.structure.building import build_robot
from tests import ROOT
from tests.conversion.facts import SINGLE
from tests.conversion.features import closed, coupled, renamed
from tests.conversion.judge import needs_reader
from tests.description.reading import save_all
from tests.robots.robot_texts import CLOSED_FOUR_BAR, FOUR_BAR, save
from tests.support.command_line import call
from tests.support.comparing import refused
from tests.support.snippets import blocks

#: Words of the command, its exit status, what it says, and how the file begins or what stands in it.
COMMANDS = [
    ("out.urdf", ("--strict",), 0, [], "<robot"),
    *(
        ("out.xml", words, status, [
            "lost: speed limits, which MuJoCo does not have: 'drive'", "closures stay within 0.0001 m",
        ], "<mujoco")
        for words, status in (((), 0), (("--strict",), 1))
    ),
    ("out.xml", ("--base", "floating"), 0, [], '<freejoint name="ground:free" />'),
]  # fmt: skip


@pytest.mark.parametrize(("target", "words", "status", "told", "content"), COMMANDS)
def test_the_command_writes_a_robot(
    target: str, words: tuple[str, ...], status: int, told: list[str], content: str, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    file, out = save(tmp_path / "in", CLOSED_FOUR_BAR), tmp_path / target
    said = call(capsys, "convert", file, "-o", out, *words, status=status)
    assert [part for part in (str(out), *told) if part not in said.err] == []
    assert (said.out, sorted(path.name for path in tmp_path.iterdir())) == ("", ["in", target])
    assert content in out.read_text()
    needs_reader(out)
    assert hybridyn.load(out).motors == ("drive",)


def test_losses_are_listed(tmp_path: Path) -> None:
    robot = hybridyn.load(save(tmp_path, CLOSED_FOUR_BAR), base="floating", gravity=(0, 0, -1.62))
    done = convert(robot, tmp_path / "moon.urdf")
    words = ["the base floats", "gravity of 0 0 -1.62 m/s^2"]
    assert [line.partition(",")[0] for line in done.losses] == words


def test_the_page_shows_what_the_command_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (example,) = blocks(ROOT / "docs" / "convert.md", "console")
    command, *shown = example.text.splitlines()
    monkeypatch.chdir(tmp_path)
    assert call(capsys, *command.removeprefix("$ hybridyn ").split()).err.splitlines() == shown


#: The target, options, and what is told.
REFUSED = [
    ("robot.udrf", {}, "unknown ending '.udrf' .did you mean '.urdf'"),
    ("robot", {}, "unknown ending ''"),
    ("none/robot.urdf", {}, "the folder .* does not exist"),
    ("folder.urdf", {}, "is a folder"),
    ("./four_bar.urdf", {}, "is the robot's own file"),
    *(("out.urdf", {"tightness": x}, "tightness") for x in (0.0, -1.0, float("nan"), float("inf"))),
    *(
        (name, {}, f"{name}: exists and is not from convert; move it away")
        for name in ("mine.urdf", "mine.xml", "mine.sdf", "mine.usda", "mine.usd")
    ),
    # Files for other robots are not read, nor replaced.
    ("car.urdf", {}, "car.yaml: .* is not from convert"),
    ("home.urdf", {}, "home.urdf.model.toml: .* is not from convert"),
]


@pytest.mark.parametrize(("target", "options", "message"), REFUSED)
def test_what_is_refused_stays(target: str, options: dict[str, float], message: str, tmp_path: Path) -> None:
    texts = {
        "four_bar.urdf": CLOSED_FOUR_BAR, "four_bar.model.toml": "[home]\ndrive = 0.5\n",
        "car.yaml": "joint_name: [drive]\njoint_type: [SPHERICAL]\n",
        "home.urdf.model.toml": "[home]\ndrive = 1\n",
        **{
            f"mine.{ending}": "<robot>the work of a day</robot>\n"
            for ending in ("urdf", "xml", "sdf", "usda", "usd")
        },
    }  # fmt: skip
    file = save_all(tmp_path, texts)
    (tmp_path / "folder.urdf").mkdir()
    for robot in (file, hybridyn.load(file)):
        refused(lambda robot=robot: convert(robot, tmp_path / target, **options), ModelError, message)
    assert {path.name: path.read_text() for path in tmp_path.iterdir() if path.is_file()} == texts


NAMES = ("", " arm", "arm ", "a\tb", "a\nb", "a\x01b", "a\x7fb", "a\x85b", "a\ud800b", "a\ufffeb")


@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf", ".usda", ".usd"])
@pytest.mark.parametrize("old", ["arm", "two", "loop"])
def test_names_that_no_file_can_hold_are_refused(ending: str, old: str, tmp_path: Path) -> None:
    robot, target = closed("revolute"), tmp_path / f"out{ending}"
    for name in NAMES:
        bad = build_robot(renamed(robot, old, name))
        refused(
            lambda bad=bad: convert(bad, target),
            ModelError,
            re.escape(f"the name {name!r} cannot be written"),
        )
    model = pin.buildSampleModelManipulator()
    model.names[1] = "a\tb"
    wrong = r"name 'a\\tb' cannot be written: .* line break or control character; rename it"
    refused(lambda: convert(hybridyn.from_pinocchio(model), target), ModelError, wrong)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf", ".usda"])
@pytest.mark.parametrize("name", ["a  b", 'a&<">b', "\u00e9", "a::b"])
def test_odd_names_come_back(ending: str, name: str, tmp_path: Path) -> None:
    robot = renamed(renamed(closed("revolute"), "arm", name), "loop", f"{name}2")
    done = convert(build_robot(robot), target := tmp_path / f"out{ending}")
    needs_reader(target)
    found = read(target)
    kept = {one.name for one in (*found.links, *found.closures)} >= {name, f"{name}2"}
    assert kept or any("are changed" in line for line in done.losses)


@pytest.mark.parametrize("ending", [".urdf", ".xml", ".sdf", ".usda", ".usd"])
def test_its_own_files_are_replaced(ending: str, tmp_path: Path) -> None:
    """A model file is removed again, since it would be read with the new robot."""
    needs_reader(Path(f"robot{ending}"))
    file, out = save(tmp_path, CLOSED_FOUR_BAR), tmp_path / f"out{ending}"
    model = save(tmp_path, "[home]\ndrive = 0.5\n", "four_bar.model.toml")
    names = [out.name, *([f"{out.name}.model.toml"] if ending != ".xml" else [])]
    for _ in range(2):
        assert [path.name for path in convert(file, out).files] == names
    model.unlink()
    left = [out.name] if ending in (".urdf", ".xml") else names  # others state motors there
    assert [path.name for path in convert(file, out).files] == left
    assert {path.name for path in tmp_path.iterdir()} == {"four_bar.urdf", *left}
    assert read(out).name == read(file).name


def test_the_model_file_of_another_robot_is_not_read(tmp_path: Path) -> None:
    file = save(tmp_path / "here", CLOSED_FOUR_BAR)
    save(tmp_path, "[home]\ndrive = 0.5\n", "robot.model.toml")
    save(tmp_path, "joint_name: [drive]\njoint_type: [SPHERICAL]\n", "robot.yaml")
    done = convert(file, tmp_path / "robot2.urdf")
    assert [path.name for path in done.files] == ["robot2.urdf", "robot2.yaml"]
    kinds = {joint.kind for joint in hybridyn.load(done.files[0]).description.joints}
    assert kinds == {"continuous", "revolute"}
    (tmp_path / "robot.yaml").unlink()
    done = convert(file, tmp_path / "robot.urdf")
    assert [path.name for path in done.files] == ["robot.urdf", "robot.urdf.model.toml"]
    assert hybridyn.load(done.files[0]).description.home == {}


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


# -------------------- loops that are open at home


#: Residual of a closed posture that went through a file.
CLOSED = 1e-12
#: A coupler that is too short for a drive at 2 rad.
SHORT = FOUR_BAR.replace(
    '<predecessor link="coupler"><origin xyz="1.5', '<predecessor link="coupler"><origin xyz="0.6'
)
OPEN = "'pin' is open at home by "
MEND = "; written closed, with the motors where they are"


def four_bar(folder: Path, text: str, drive: float) -> Path:
    """Write a four-bar whose home states the position of its motor alone."""
    return save_all(folder, {"four_bar.urdf": text, "four_bar.model.toml": f"[home]\ndrive = {drive}\n"})


@pytest.mark.parametrize("ending", [".urdf", ".sdf", ".xml", ".usda"])
def test_open_loops_are_closed_with_the_motors_where_they_are(ending: str, tmp_path: Path) -> None:
    file = four_bar(tmp_path, FOUR_BAR, 0.3)
    before = hybridyn.load(file)
    assert closure_residual(before, before.home) > 0.1
    needs_reader(Path(f"robot{ending}"))
    done = convert(file, tmp_path / f"out{ending}")
    assert [line for line in done.notes if line.startswith(OPEN) and line.endswith(MEND)]
    after, closed = hybridyn.load(done.files[0]), SINGLE if ending == ".usda" else CLOSED
    assert closure_residual(after, after.home) < closed
    # SDF counts positions from the posture in which links stand.
    counted = [line for line in done.losses if line.startswith("positions of joints count from home")]
    home = () if counted else pytest.approx((0.3,), abs=closed)
    assert (bool(counted), after.description.home.get("drive", ())) == (ending == ".sdf", home)


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


@pytest.mark.parametrize("ending", ["sdf", "usda"])
def test_springs_follow_the_new_names_of_their_joints(ending: str, tmp_path: Path) -> None:
    """A link and a joint have one name, which these formats do not allow; the spring was the link's."""
    written = tmp_path / "out" / f"r.{ending}"
    needs_reader(written)
    written.parent.mkdir()
    path = save(
        tmp_path,
        '<robot name="r"><link name="base"/>'
        '<joint name="a" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
        '<link name="a"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>',
    )
    robot = build_robot(replace(read(path), effects=(("spring", {"stiffness": {"a": 5.0}}),)))
    convert(robot, written)
    (spring,) = read(written).springs
    assert (spring.name, spring.stiffness) == (read(written).joints[0].name, pytest.approx(5.0, rel=SINGLE))
