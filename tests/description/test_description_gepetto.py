"""gepetto.py: closures, retyped joints and motors of a side-car equal those of Gepetto's own loader.

yaml_file.py: numbers are those of YAML 1.2, and every trap of YAML is an error that names its line.
"""

from pathlib import Path

import numpy as np
import pytest

from hybridyn.description import read
from hybridyn.description.placement import placement_from
from hybridyn.description.side_cars.yaml_file import read_yaml
from hybridyn.errors import ModelError
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots.robot_texts import robot
from tests.support import comparing

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


OPEN = robot(FRAMES)


def beside(yaml: str, text: str = OPEN) -> dict[str, str]:
    """Return the files of the open four-bar with two closing frames and a side-car."""
    return {"four_bar.urdf": text, "robot.yaml": yaml}


def of_type(stated: str) -> str:
    """Return a side-car that states another type of closure."""
    return SIDE_CAR.replace("['6d']", stated)


#: Two revolute joints for a universal one, which stand in the place of "swing".
UNIVERSAL = {
    f"a universal joint {first}{second} becomes two revolutes": (
        beside(SIDE_CAR.replace("SPHERICAL", f"UJOINT_{first}{second}")),
        {
            "joints": {
                f"swing_{first}": {
                    "kind": "revolute", "parent": "ground", "child": f"swing_{first}",
                    "axis": np.eye(3)["XYZ".index(first)],
                    "placement": placement_from(np.eye(3), np.array([1.5, 0, 0])),
                },
                f"swing_{second}": {
                    "kind": "revolute", "parent": f"swing_{first}", "child": "rocker",
                    "axis": np.eye(3)["XYZ".index(second)], "placement": np.eye(4),
                },
            },
            "links": {f"swing_{first}": {"mass": 0}},
        },
    )
    for first, second in ("XY", "YZ", "ZX", "ZY")
}  # fmt: skip
#: The files of a robot, and what is read.
READ: dict[str, tuple[dict[str, str], dict[str, object]]] = {
    "a side-car closes, retypes and drives": (beside(SIDE_CAR), {
        "closures": [{
            "link_a": "closedloop1_A", "link_b": "closedloop1_B", "translations": (0, 1, 2),
            "rotation": "fixed", "kind": "6d", "frame_a": np.eye(4),
        }],
        "joints": {"swing": {
            "kind": "spherical", "placement": placement_from(np.eye(3), np.array([1.5, 0, 0])),
        }},
        "motors": ("drive",), "motors_from": "name_mot of robot.yaml",
    }),
    "the side-car named as the robot comes first": (
        {"four_bar.urdf": OPEN, "robot.yaml": "name_mot: [swing]", "four_bar.yaml": SIDE_CAR},
        {"motors": ("drive",)},
    ),
    "a 3d pair is a point": (beside(of_type("['3d']")), {"closures": [{"rotation": "free"}]}),
    "a 3D pair is a point": (beside(of_type("['3D']")), {"closures": [{"rotation": "free"}]}),
    "one type for all": (beside(of_type("3d")), {"closures": [{"rotation": "free"}]}),
    "no type": (
        beside(SIDE_CAR.replace("type: ['6d']\n", "")),
        {"closures": [{"rotation": "fixed"}], "notes": {"no closure type"}},
    ),
    "a joint stands for its child link": (
        beside(SIDE_CAR.replace("'closedloop1_A'", "'elbow'")), {"closures": [{"link_a": "coupler"}]},
    ),
    "fixed stays at zero": (
        beside(SIDE_CAR.replace("SPHERICAL", "FIXED")), {"joints": {"swing": {"kind": "fixed"}}},
    ),
    **UNIVERSAL,
    "the first of two revolutes is followed by the second": (
        beside(SIDE_CAR.replace("SPHERICAL", "UJOINT_ZY")),
        {"joints": ["drive", "elbow", "swing_Z", "swing_Y", "closedloop1_A_frame", "closedloop1_B_frame"]},
    ),
    "motor names that stand for several joints": (
        beside(SIDE_CAR.replace("['drive']", "w").replace("SPHERICAL", "UJOINT_XY")),
        {"motors": ("elbow", "swing_X", "swing_Y"), "notes": {"stands for"}},
    ),
    "files of other tools": (
        beside("controller:\n  gains: !include x.yaml\n", robot()),
        {"closures": (), "notes": {"is not a side-car"}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, expected = READ[name]
    holds(read(save_all(tmp_path, texts)), expected)


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
        ("name_mot:", "name_closedloop: x\nname_mot:", 3, "unknown key 'name_closedloop'"),
        ("name_mot:", "type: ['3d']\nname_mot:", 3, "stated twice"),
    ],
)
def test_mistakes_name_file_and_line(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    error = refused(save_all(tmp_path, beside(SIDE_CAR.replace(old, new))), message)
    assert error.line == line or "1 types" in message
    assert error.file == str(tmp_path / "robot.yaml")


@pytest.mark.parametrize(
    ("texts", "messages"),
    [
        (beside("closed_lop: [[a, b]]\n", robot()), ["did you mean 'closed_loop'"]),
        (
            {"four_bar.urdf": OPEN.replace('="closedloop1_A', '="other')},
            [
                "'closedloop1_B_frame' looks like the end of a closed loop",
                "side-car robot.yaml",
            ],
        ),
    ],
)
def test_what_pairs_nothing_is_refused(texts: Texts, messages: list[str], tmp_path: Path) -> None:
    refused(save_all(tmp_path, texts), *messages)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1.0e-10", 1e-10),
        ("1e-10", 1e-10),  # text for PyYAML, a number for those who write it
        ("1.", 1.0),
        ("12", 12),
        ("true", True),
        ("null", None),
        ("'12'", "12"),
        ("[a, [1, 2.5]]", ["a", [1, 2.5]]),
        ("{a: 1, b: {c: d}}", {"a": 1, "b": {"c": "d"}}),
        ("a: &x [1]\nb: *x", {"a": [1], "b": [1]}),
        ("", None),
    ],
)
def test_values(text: str, value: object) -> None:
    read = read_yaml(text.encode(), "f.yaml").data
    assert read == value
    assert type(read) is type(value)


BOMB = "a: &a [x]\n" + "".join(
    f"{chr(98 + i)}: &{chr(98 + i)} [{', '.join(['*' + chr(97 + i)] * 10)}]\n" for i in range(9)
)


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("a: 1\nb: 2\na: 3", 3, "the key is stated twice"),
        ("a: 1\nb: [1, 2", 2, "not readable as YAML"),
        ("a: !!python/object:os.system x", 1, "is not allowed"),
        ("a:\n  - !thing x", 2, "is not allowed"),
        ("[a, b]: 1", 1, "a key must be a plain word"),
        ("a: *nothing", 1, "undefined alias"),
        ("a: 1\n--- \nb: 2", 2, "not readable as YAML"),
        (BOMB, None, "are aliases nested"),
        ("a: &a [*a]", None, "nested too deeply"),
        ("[" * 5000, None, "nested too deeply"),
        ("a: \x07", None, "not readable as YAML"),
        ("\tb: 1", 1, "not readable as YAML"),
        (b"a: \xff", None, "UTF-8"),
        ("a: " + "x" * 2**20, None, "larger than 1 MiB"),
        ("a: 1\nb: 012", 2, "no number to the base ten"),  # ten for PyYAML
        ("a: [0, 1:30]", 1, "no number to the base ten"),
    ],
)
def test_traps(text: str | bytes, line: int | None, message: str) -> None:
    caught = comparing.refused(
        lambda: read_yaml(text if isinstance(text, bytes) else text.encode(), "f.yaml"), ModelError, ""
    )
    assert message in str(caught)
    assert line is None or caught.line == line
