"""motors.py: the first source that names motors is used and reported; wrong names are never dropped."""

from pathlib import Path

import pytest

from hybridyn.description import Description, read
from tests.description.reading import refused
from tests.robot_texts import FOUR_BAR, LOOP, TREE, read_text, robot, save


def transmission(*names: str) -> str:
    return "".join(
        f'<transmission name="t_{n}"><joint name="{n}"/><actuator name="m_{n}"/></transmission>'
        for n in names
    )


def test_the_order_of_the_sources(tmp_path: Path) -> None:
    dependent = TREE.replace('name="elbow" type', 'name="elbow" independent="false" type').replace(
        'name="swing" type', 'name="swing" independent="false" type'
    )

    def look(
        folder: str, *, transmissions: bool, model: bool, side_car: bool, **options: object
    ) -> Description:
        extra = transmission("swing") if transmissions else ""
        path = save(tmp_path / folder, f'<robot name="r">{dependent}{LOOP}{extra}</robot>', "robot.urdf")
        if model:
            save(tmp_path / folder, 'motors = ["elbow"]', "robot.model.toml")
        if side_car:
            save(tmp_path / folder, "name_mot: [swing, drive]", "robot.yaml")
        return read(path, **options)  # type: ignore[arg-type]

    everything = look("all", transmissions=True, model=True, side_car=True, motors=["elbow", "swing"])
    assert everything.motors == ("elbow", "swing")
    assert everything.motors_from == "the caller (motors=)"
    assert look("a", transmissions=True, model=True, side_car=True).motors == ("swing", "drive")
    assert look("b", transmissions=True, model=True, side_car=False).motors == ("elbow",)
    assert look("c", transmissions=True, model=False, side_car=False).motors == ("swing",)
    last = look("d", transmissions=False, model=False, side_car=False)
    assert last.motors == ("drive",)
    assert "independent" in last.motors_from


def test_without_any_source(tmp_path: Path) -> None:
    assert read_text(tmp_path, robot()).motors == ("drive", "elbow", "swing")
    assert read_text(tmp_path, FOUR_BAR).motors == ("drive",)
    limitless = FOUR_BAR.replace(' effort="10"', "")
    description = read_text(tmp_path, limitless)
    assert description.motors == ()
    assert any("which joints of this closed-loop robot are driven" in note for note in description.notes)


def test_joints_that_mimic_are_not_driven(tmp_path: Path) -> None:
    text = robot().replace('<origin xyz="1 0 0"/>', '<origin xyz="1 0 0"/><mimic joint="drive"/>')
    assert read_text(tmp_path, text).motors == ("drive", "swing")


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["driv"], "did you mean 'drive'"),
        (["zzz"], "joints that can be driven: 'drive', 'elbow', 'swing'"),
        (["drive", "drive"], "stated twice"),
        (["x_joint"], "is a fixed joint"),
    ],
)
def test_wrong_names_are_refused(tmp_path: Path, names: list[str], message: str) -> None:
    fixed = (
        '<link name="x"/><joint name="x_joint" type="fixed"><parent link="rocker"/><child link="x"/></joint>'
    )
    refused(save(tmp_path, robot(fixed)), message, motors=names)


def test_no_motor_at_all_may_be_asked_for(tmp_path: Path) -> None:
    assert read_text(tmp_path, FOUR_BAR, motors=[]).motors == ()


def test_transmissions_of_a_cut_robot(tmp_path: Path) -> None:
    description = read_text(tmp_path, robot(transmission("drive", "elbow", "swing", "gripper_left")))
    assert description.motors == ("drive", "elbow", "swing")
    assert any("'gripper_left'" in note for note in description.notes)
    refused(save(tmp_path, robot(transmission("drive", "elbow", "swong"))), "did you mean 'swing'")


def test_transmissions_that_leave_joints_passive_are_noted(tmp_path: Path) -> None:
    called = robot(transmission("drive"), LOOP).replace(
        'name="swing" type="continuous"', 'name="swing" type="continuous" independent="false"'
    )
    description = read_text(tmp_path, called)
    assert description.motors == ("drive",)
    assert any("leaves these passive: 'elbow'" in note for note in description.notes)
    assert read_text(tmp_path, robot(transmission("drive"), LOOP)).notes == ()


def test_the_transmission_of_a_wrist_names_its_joints_otherwise(tmp_path: Path) -> None:
    wrist = '<transmission name="w"><flexJoint name="drive"/><rollJoint name="elbow"/></transmission>'
    assert read_text(tmp_path, robot(wrist)).motors == ("drive", "elbow")
