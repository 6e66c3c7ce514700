"""gepetto.py: closures, retyped joints and motors of a side-car equal those of Gepetto's own loader."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hybridyn.description import Description, read
from tests.description.reading import refused
from tests.robot_texts import robot, save

FRAMES = """
  <link name="closedloop1_A"/>
  <joint name="closedloop1_A_frame" type="fixed"><origin xyz="1.5 0 0" rpy="0 0 0.3"/>
    <parent link="coupler"/><child link="closedloop1_A"/></joint>
  <link name="closedloop1_B"/>
  <joint name="closedloop1_B_frame" type="fixed"><origin xyz="1 0 0"/>
    <parent link="rocker"/><child link="closedloop1_B"/></joint>"""

SIDE_CAR = """closed_loop: [['closedloop1_A', 'closedloop1_B']]
type: ['6d']
name_mot: ['drive']
joint_name: ['swing']
joint_type: ['SPHERICAL']
"""


def beside(folder: Path, yaml: str, name: str = "robot.yaml", text: str = robot(FRAMES)) -> Path:
    """Write the open four-bar with two closing frames and a side-car; gives the robot's file."""
    save(folder, yaml, name)
    return save(folder, text)


def load(*given: Any, **more: Any) -> Description:
    return read(beside(*given, **more))


def test_a_side_car_closes_retypes_and_drives(tmp_path: Path) -> None:
    description = load(tmp_path, SIDE_CAR)
    (closure,) = description.closures
    assert (closure.link_a, closure.link_b) == ("closedloop1_A", "closedloop1_B")
    assert (closure.translations, closure.rotation, closure.kind) == ((0, 1, 2), "fixed", "6d")
    np.testing.assert_array_equal(closure.frame_a, np.eye(4))
    swing = next(joint for joint in description.joints if joint.name == "swing")
    assert swing.kind == "spherical"
    assert swing.placement[0, 3] == 1.5
    assert description.motors == ("drive",)
    assert description.motors_from == "name_mot of robot.yaml"


def test_the_side_car_named_as_the_robot_comes_first(tmp_path: Path) -> None:
    save(tmp_path, "name_mot: [swing]", "robot.yaml")
    assert load(tmp_path, SIDE_CAR, "four_bar.yaml").motors == ("drive",)


@pytest.mark.parametrize("word", ["3d", "3D"])
def test_a_3d_pair_is_a_point(tmp_path: Path, word: str) -> None:
    assert load(tmp_path, SIDE_CAR.replace("6d", word)).closures[0].rotation == "free"


def test_a_joint_stands_for_its_child_link(tmp_path: Path) -> None:
    closure = load(tmp_path, SIDE_CAR.replace("'closedloop1_A'", "'elbow'")).closures[0]
    assert closure.link_a == "coupler"


def test_one_type_for_all_and_none(tmp_path: Path) -> None:
    assert load(tmp_path / "a", SIDE_CAR.replace("['6d']", "3d")).closures[0].rotation == "free"
    description = load(tmp_path / "b", SIDE_CAR.replace("type: ['6d']\n", ""))
    assert description.closures[0].rotation == "fixed"
    assert any("no closure type" in note for note in description.notes)


def test_fixed_stays_at_zero(tmp_path: Path) -> None:
    description = load(tmp_path, SIDE_CAR.replace("SPHERICAL", "FIXED"))
    assert next(joint for joint in description.joints if joint.name == "swing").kind == "fixed"


@pytest.mark.parametrize(("kind", "axes"), [("XY", (0, 1)), ("YZ", (1, 2)), ("ZX", (2, 0)), ("ZY", (2, 1))])
def test_a_universal_joint_becomes_two_revolutes(tmp_path: Path, kind: str, axes: tuple[int, int]) -> None:
    description = load(tmp_path, SIDE_CAR.replace("SPHERICAL", f"UJOINT_{kind}"))
    names = [joint.name for joint in description.joints]
    first = description.joints[names.index(f"swing_{kind[0]}")]
    second = description.joints[names.index(f"swing_{kind[1]}")]
    assert names.index(second.name) == names.index(first.name) + 1
    assert (first.parent, first.child, second.parent, second.child) == (
        "ground",
        first.name,
        first.name,
        "rocker",
    )
    assert first.placement[0, 3] == 1.5
    np.testing.assert_array_equal(second.placement, np.eye(4))
    np.testing.assert_array_equal(first.axis, np.eye(3)[axes[0]])
    np.testing.assert_array_equal(second.axis, np.eye(3)[axes[1]])
    between = next(link for link in description.links if link.name == first.child)
    assert between.mass == 0


def test_motor_names_that_stand_for_several_joints(tmp_path: Path) -> None:
    yaml = SIDE_CAR.replace("['drive']", "w")
    description = load(tmp_path, yaml.replace("SPHERICAL", "UJOINT_XY"))
    assert description.motors == ("elbow", "swing_X", "swing_Y")
    assert any("stands for" in note for note in description.notes)


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("'closedloop1_B'", "'closedloop1_C'", 1, "did you mean"),
        (", 'closedloop1_B'", "", 1, "1 frames instead of a pair"),
        ("'closedloop1_B'", "'elbow', 'swing'", 1, "3 frames instead of a pair"),
        ("'closedloop1_B'", "'coupler', 'x'", 1, "3 frames instead of a pair"),
        ("'closedloop1_B'", "5", 1, "string"),
        ("['6d']", "['7d']", 2, "unknown type '7d'"),
        ("['6d']", "['6d', '6d']", 2, "2 types for 1 pairs"),
        ("type:", "typ:", 2, "unknown key 'typ' (did you mean 'type'?)"),
        ("['drive']", "['drv']", 3, "is not a joint of the robot (did you mean 'drive'?)"),
        ("['drive']", "['drive', 'drive', 'swing']", 3, "spherical joint"),
        ("['swing']", "['swng']", 4, "did you mean 'swing'"),
        ("['swing']", "['swing', 'drive']", 5, "1 types for 2 names"),
        ("['swing']", "['swing', 'swing']", 4, "1 types"),
        ("SPHERICAL", "SPHRICAL", 5, "did you mean 'SPHERICAL'"),
        ("SPHERICAL", "UJOINT_XX", 5, "unknown type"),
        ("name_mot:", "name_closedloop: x\nname_mot:", 3, "an early form"),
        ("name_mot:", "type: ['3d']\nname_mot:", 3, "stated twice"),
    ],
)
def test_mistakes_name_file_and_line(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    error = refused(beside(tmp_path, SIDE_CAR.replace(old, new)), message)
    assert error.line == line or "1 types" in message
    assert error.file == str(tmp_path / "robot.yaml")


def test_files_of_other_tools_are_noted(tmp_path: Path) -> None:
    description = load(tmp_path, "controller:\n  gains: !include x.yaml\n", text=robot())
    assert description.closures == ()
    assert any("is not a side-car" in note for note in description.notes)
    refused(beside(tmp_path, "closed_lop: [[a, b]]\n", text=robot()), "did you mean 'closed_loop'")


def test_names_close_loops_where_no_side_car_is(tmp_path: Path) -> None:
    text = robot(FRAMES).replace('"drive"', '"motor_drive"').replace('"swing"', '"spherical_swing"')
    description = read(save(tmp_path, text))
    (closure,) = description.closures
    assert {closure.link_a, closure.link_b} == {"closedloop1_A", "closedloop1_B"}
    assert closure.rotation == "fixed"
    assert description.motors == ("motor_drive",)
    assert [joint.kind for joint in description.joints if joint.name == "spherical_swing"] == ["spherical"]
    assert any("welded pairwise" in note for note in description.notes)


def test_names_that_pair_up_wrongly_are_refused(tmp_path: Path) -> None:
    text = robot(FRAMES.replace("closedloop1_B", "closedloop2_B"))
    refused(save(tmp_path, text), "1 frames are named closedloop1 instead of two", "robot.yaml")
