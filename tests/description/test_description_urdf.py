"""Links, joints, limits and rotors of URDF, and one tree with known names; what is misspelt is an error.

motors.py: the first source that names motors is used and reported; wrong names are never dropped.
"""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from hybridyn.description import read
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots.robot_texts import FOUR_BAR, INERTIAL, LOOP, line_of, read_text, robot, save

ROUNDING = 1e-15  # placements are products of two sines: a few units in the last place


INF = math.inf


def about_z(x: float) -> object:
    """Return the placement of a frame that is turned about z."""
    c, s = math.cos(x), math.sin(x)
    return pytest.approx(
        np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), rel=1e-7, abs=ROUNDING
    )


TRANSMISSION = """<transmission name="t"><type>transmission_interface/SimpleTransmission</type>
  <joint name="drive"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
  <actuator name="m"><mechanicalReduction>50</mechanicalReduction>
  <drake:rotor_inertia value="1e-4"/></actuator></transmission>"""
MIMIC = robot().replace(
    '<origin xyz="1 0 0"/><parent link="crank"/>',
    '<mimic joint="drive" multiplier="-2" offset="0.3"/><origin xyz="1 0 0"/><parent link="crank"/>',
)
FREE = '<link name="x"/><joint name="f" type="{}"><parent link="rocker"/><child link="x"/>{}</joint>'
#: An axis with angles, as old exporters wrote it; a joint on the world, which Drake and Gazebo have.
IGNORED = FOUR_BAR.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1" rpy="0 0 0.3"/>', 1).replace(
    "</robot>",
    '<joint name="stand" type="fixed"><parent link="world"/><child link="ground"/></joint></robot>',
)
#: A text, and what is read.
READ: dict[str, tuple[str, dict[str, object]]] = {
    "a joint says all that its file says": (FOUR_BAR, {"joints": {"drive": {
        "kind": "revolute", "parent": "ground", "child": "crank", "lower": -3, "upper": 3, "velocity": 5,
        "effort": 10, "damping": 0.1, "friction": 0.2, "rotor_inertia": 0, "gear_ratio": 1,
        "placement": about_z(0.4), "line": line_of(FOUR_BAR, '<joint name="drive"'),
    }}}),
    "absent limits are infinite": (
        FOUR_BAR, {"joints": {"elbow": {"lower": -INF, "upper": INF, "velocity": INF, "effort": INF}}},
    ),
    "quaternions of URDF 1.1": (
        FOUR_BAR.replace('rpy="0 0 0.4"', f'quat_xyzw="0 0 {math.sqrt(0.5)} {math.sqrt(0.5)}"'),
        {"joints": {"drive": {"placement": about_z(math.pi / 2)}}},
    ),
    "limits that lie": (
        FOUR_BAR.replace('lower="-3" upper="3" velocity="5"', 'lower="3" upper="-3" velocity="-1"'),
        {"joints": {"drive": {"lower": -INF, "upper": INF, "velocity": INF}},
         "notes": {"both ignored", "negative velocity"}},
    ),
    "other attributes and tags": (
        FOUR_BAR.replace('velocity="5"', 'velocity="5" gear_velocity="10" jerk="3"').replace(
            '<link name="ground"/>',
            '<link name="ground"><visual><geometry><mesh filename="package://nowhere/a.stl"/></geometry>'
            '</visual></link><material name="red"/>'
            '<gazebo reference="drive"><provideFeedback>true</provideFeedback></gazebo>',
        ),
        {"joints": ["drive", "elbow", "swing"]},
    ),
    **{
        f"a {kind} joint": (robot(FREE.format(kind, "")), {"joints": {"f": {"kind": kind}}})
        for kind in ("fixed", "revolute", "continuous", "prismatic", "floating")
    },
    "a planar joint": (
        robot(FREE.format("planar", '<axis xyz="0 0 1"/>')), {"joints": {"f": {"kind": "planar"}}},
    ),
    "a link and a joint may share a name": (
        FOUR_BAR.replace('"drive"', '"crank"'), {"joints": {"crank": {"child": "crank"}}},
    ),
    "transmissions give rotor and ratio": (
        robot(TRANSMISSION), {"joints": {"drive": {"gear_ratio": 50, "rotor_inertia": 1e-4}}},
    ),
    "mimic is a coupling": (MIMIC, {"couplings": [
        {"name": "elbow", "terms": (("elbow", 1.0), ("drive", 2.0)), "offset": 0.3},
    ]}),
    "mimic on a fixed joint": (
        robot(FREE.format("fixed", '<mimic joint="drive"/>')),
        {"couplings": (), "notes": {"<mimic> has no effect"}},
    ),
    "what other readers ignore": (IGNORED, {
        "links": ["world", "ground", "crank", "coupler", "rocker"],
        "joints": {"drive": {"axis": np.array([0, 0, 1])}},
        "notes": {"'rpy' of the <axis> of joint", "a link 'world' that the file does not state"},
    }),
    "a mass without inertia is a point": (
        FOUR_BAR.replace(INERTIAL, '<inertial><mass value="2"/></inertial>', 1),
        {"links": {"crank": {"mass": 2, "inertia": np.zeros((3, 3))}}, "notes": {"point mass"}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    text, expected = READ[name]
    holds(read_text(tmp_path, text), expected)


def test_orientation_and_inertia_are_those_of_pinocchio(tmp_path: Path) -> None:
    text = """<robot name="one"><link name="a"/><link name="b"><inertial>
      <origin xyz="0.1 -0.2 0.3" rpy="0.5 -1.1 2.3"/><mass value="3"/>
      <inertia ixx="0.3" ixy="0.01" ixz="-0.02" iyy="0.4" iyz="0.03" izz="0.5"/></inertial></link>
      <joint name="j" type="prismatic"><origin xyz="1 2 3" rpy="-0.7 0.9 -2.5"/>
      <parent link="a"/><child link="b"/>
      <axis xyz="1 2 2"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
    ours = read_text(tmp_path, text)
    model = pin.buildModelFromXML(text)
    np.testing.assert_allclose(ours.joints[0].placement, model.jointPlacements[1].homogeneous, atol=ROUNDING)
    np.testing.assert_allclose(ours.links[1].inertia, model.inertias[1].inertia, atol=ROUNDING)
    np.testing.assert_allclose(ours.links[1].com, model.inertias[1].lever, atol=0)
    np.testing.assert_allclose(ours.joints[0].axis, np.array([1, 2, 2]) / 3, atol=ROUNDING)


AXIS = '<axis xyz="0 0 1"/>\n    <limit'
DRIVE = 'type="revolute">\n    <origin'
#: A text, what is changed in it, and what is told.
WRONG = [
    (FOUR_BAR, "inertial>", "inertail>", "did you mean <inertial>"),
    (FOUR_BAR, AXIS, '<axsi xyz="0 0 1"/>\n    <limit', "did you mean <axis>"),
    (FOUR_BAR, AXIS, '<axis xzy="0 0 1"/>\n    <limit', "did you mean 'xyz'?"),
    (FOUR_BAR, 'rpy="0 0 0.4"', 'ryp="0 0 0.4"', "(did you mean 'rpy'?)"),
    (FOUR_BAR, 'effort="10"', 'efort="10"', "did you mean 'effort'"),
    (FOUR_BAR, "<mass value", "<mas value", "did you mean <mass>"),
    (
        FOUR_BAR,
        '<parent link="ground"/><child link="crank"/>',
        '<child link="crank"/>',
        "<parent> is missing",
    ),
    (FOUR_BAR, DRIVE, 'type="revolut">\n    <origin', "did you mean 'revolute'"),
    (FOUR_BAR, DRIVE, 'type="sphere">\n    <origin', "does not exist in URDF"),
    (FOUR_BAR, DRIVE, ">\n    <origin", "attribute 'type' is missing"),
    (FOUR_BAR, 'name="drive"', 'name=""', "attribute 'name' is empty"),
    (FOUR_BAR, '<mass value="2"/>', '<mass value="-2"/>', "negative mass"),
    (FOUR_BAR, '<mass value="2"/>', '<mass value="2"/><mass value="2"/>', "stated twice"),
    (FOUR_BAR, 'damping="0.1"', 'damping="-0.1"', "negative damping"),
    (FOUR_BAR, AXIS, '<axis xyz="0 0 0"/>\n    <limit', "the axis is zero"),
    (FOUR_BAR, 'rpy="0 0 0.4"', "quat_xyzw='0 0 0 0'", "origin"),
    (FOUR_BAR, 'rpy="0 0 0.4"', "rpy='0 0 0' quat_xyzw='0 0 0 1'", "origin"),
    (FOUR_BAR, 'rpy="0 0 0.4"', "quat_xyzw='0 0 1'", "origin"),
    (robot(TRANSMISSION), ">50<", ">fifty<", ""),
    (robot(TRANSMISSION), ">50<", ">0<", ""),
    (robot(TRANSMISSION), '"1e-4"', '"-1"', ""),
    (robot(TRANSMISSION), ">50<", "><", ""),
    (MIMIC, 'joint="drive" m', 'joint="driv" m', "did you mean 'drive'"),
    (MIMIC, 'joint="drive" m', 'joint="elbow" m', "mimic itself"),
    (MIMIC, "multiplier", "multiplyer", "did you mean 'multiplier'"),
    (robot(FREE.format("planar", '<axis xyz="1 0 0"/>')), "", "", "x-y plane"),
    (
        robot(FREE.format("floating", "")), '<origin xyz="1 0 0"/>',
        '<origin xyz="1 0 0"/><mimic joint="f"/>', "joint 'f' is floating",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("text", "old", "new", "message"), WRONG)
def test_mistakes_are_named_with_their_line(
    tmp_path: Path, text: str, old: str, new: str, message: str
) -> None:
    assert refused(save(tmp_path, text.replace(old, new)), message).line is not None


# -------------------- one tree


def joint(name: str, parent: str, child: str, kind: str = "fixed") -> str:
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/></joint>'


def links(*names: str) -> str:
    return "".join(f'<link name="{name}"/>' for name in names)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("", "the robot has no link"),
        (links("a", "a"), "link 'a' is stated twice (first in line 1)"),
        (links("a", "b", "c") + joint("j", "a", "b") + joint("j", "a", "c"), "joint 'j' is stated twice"),
        (links("a", "base") + joint("j", "bas", "a"), "unknown parent link 'bas' (did you mean 'base'?)"),
        (links("a", "b") + joint("j", "a", "x"), "unknown child link 'x'"),
        (links("a", "b") + joint("j", "a", "a"), "joins link 'a' to itself"),
        (
            links("a", "b", "c") + joint("j", "a", "c") + joint("k", "b", "c"),
            "already the child of joint 'j'",
        ),
        (
            links("a", "b") + joint("j", "a", "b") + joint("k", "b", "a"),
            "form a cycle and no link is the root",
        ),
        (
            links("r", "a", "b") + joint("j", "a", "b") + joint("k", "b", "a"),
            "links 'a', 'b' form a cycle of joints apart from the root 'r'",
        ),
        (links("a", "b"), "2 links have no parent joint: 'a' (nothing on it), 'b' (nothing on it)"),
        (links(*(f"l{i}" for i in range(20))), "'l7' (nothing on it) and 12 more"),
    ],
)
def test_is_refused(tmp_path: Path, body: str, message: str) -> None:
    refused(save(tmp_path, f'<robot name="r">{body}</robot>'), message)


def test_a_long_chain_is_read_without_recursion(tmp_path: Path) -> None:
    count = 1500
    body = links(*(f"l{i}" for i in range(count)))
    body += "".join(joint(f"j{i}", f"l{i}", f"l{i + 1}", "continuous") for i in range(count - 1))
    assert len(read_text(tmp_path, f'<robot name="r">{body}</robot>').joints) == count - 1


@pytest.mark.parametrize(
    ("moments", "physical"),
    [
        ("ixx='1' iyy='1' izz='1'", True),
        ("ixx='1' iyy='1' izz='2.001'", True),
        ("ixx='0' iyy='0' izz='1'", False),
        ("ixx='1' iyy='1' izz='2.1'", False),
        ("ixx='1' iyy='1' izz='-1'", False),
        ("ixx='1' iyy='1' izz='1' ixy='1.5'", False),
        ("ixx='0' iyy='0' izz='0'", True),
    ],
)
def test_unphysical_inertia_is_noted(tmp_path: Path, moments: str, physical: bool) -> None:
    inertial = f"<inertial><mass value='1'/><inertia {moments}/></inertial>"
    description = read_text(tmp_path, f'<robot name="r"><link name="a">{inertial}</link></robot>')
    assert any("unphysical inertia" in note for note in description.notes) != physical


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
MOTORS_READ: list[tuple[Texts, list[str] | None, dict[str, object]]] = [
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
    (robot(transmission("drive"), LOOP), None, {"notes": ()}),
    (robot(WRIST), None, {"motors": ("drive", "elbow")}),
]  # fmt: skip


@pytest.mark.parametrize(("texts", "motors", "expected"), MOTORS_READ)
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
