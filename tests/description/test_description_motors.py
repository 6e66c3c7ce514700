"""motors.py: the first source that names motors is used and reported; wrong names are never dropped."""

from pathlib import Path

import pytest

from hybridyn.description import read
from tests.description.reading import Texts, holds, refused, save_all
from tests.robot_texts import FOUR_BAR, LOOP, robot


def transmission(*names: str) -> str:
    return "".join(
        f'<transmission name="t_{n}"><joint name="{n}"/><actuator name="m_{n}"/></transmission>'
        for n in names
    )


def dependent(text: str, *joints: str) -> str:
    """Return a robot some joints of which are said to depend on others."""
    for name in joints:
        text = text.replace(f'name="{name}" type', f'name="{name}" independent="false" type')
    return text


DEPENDENT = dependent(robot(LOOP), "elbow", "swing")
BOTH = dependent(robot(LOOP, transmission("swing")), "elbow", "swing")
MODEL, SIDE_CAR = 'motors = ["elbow"]', "name_mot: [swing, drive]"
WITH_MODEL = {"robot.urdf": BOTH, "robot.model.toml": MODEL}
ALL = WITH_MODEL | {"robot.yaml": SIDE_CAR}
FIXED = '<link name="x"/><joint name="x_joint" type="fixed"><parent link="rocker"/><child link="x"/></joint>'
WRIST = '<transmission name="w"><flexJoint name="drive"/><rollJoint name="elbow"/></transmission>'
#: The text of a robot, or the texts of its files, which motors a caller asks for, and what is read.
READ: list[tuple[Texts, list[str] | None, dict[str, object]]] = [
    (ALL, ["elbow", "swing"], {"motors": ("elbow", "swing"), "motors_from": "the caller (motors=)"}),
    (ALL, None, {"motors": ("swing", "drive")}),
    (WITH_MODEL, None, {"motors": ("elbow",)}),
    (BOTH, None, {"motors": ("swing",)}),
    (DEPENDENT, None, {"motors": ("drive",), "motors_from": 'URDF+ joints with independent="true"'}),
    (robot(), None, {"motors": ("drive", "elbow", "swing")}),
    (FOUR_BAR, None, {"motors": ("drive",)}),
    (  # joints with several freedoms cannot have motors: all others may
        FOUR_BAR.replace('type="continuous"', 'type="floating"'), None, {"motors": ("drive",)},
    ),
    (
        FOUR_BAR.replace(' effort="10"', ""), None,
        {"motors": (), "notes": {"which joints of this closed-loop robot are driven"}},
    ),
    (
        robot().replace('<origin xyz="1 0 0"/>', '<origin xyz="1 0 0"/><mimic joint="drive"/>'), None,
        {"motors": ("drive", "swing")},
    ),
    (FOUR_BAR, [], {"motors": ()}),
    (
        robot(transmission("drive", "elbow", "swing", "gripper_left")), None,
        {"motors": ("drive", "elbow", "swing"), "notes": {"'gripper_left'"}},
    ),
    (
        dependent(robot(transmission("drive"), LOOP), "swing"), None,
        {"motors": ("drive",), "notes": {"leaves these passive: 'elbow'"}},
    ),
    (robot(transmission("drive"), LOOP), None, {"notes": ()}),
    (robot(WRIST), None, {"motors": ("drive", "elbow")}),
]  # fmt: skip


@pytest.mark.parametrize(("texts", "motors", "expected"), READ)
def test_what_is_driven(
    texts: Texts, motors: list[str] | None, expected: dict[str, object], tmp_path: Path
) -> None:
    holds(read(save_all(tmp_path, texts), motors=motors), expected)


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["driv"], "did you mean 'drive'"),
        (["zzz"], "joints that can be driven: 'drive', 'elbow', 'swing'"),
        (["drive", "drive"], "stated twice"),
        (["x_joint"], "is a fixed joint"),
        (None, "did you mean 'swing'"),
    ],
)
def test_wrong_names_are_refused(tmp_path: Path, names: list[str] | None, message: str) -> None:
    stated = transmission("drive", "elbow", "swong") if names is None else ""
    refused(save_all(tmp_path, robot(FIXED, stated)), message, motors=names)
