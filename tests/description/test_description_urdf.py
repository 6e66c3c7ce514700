"""Links, joints, limits and rotors of URDF, and one tree with known names; what is misspelt is an error."""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from tests.description.reading import refused
from tests.robot_texts import FOUR_BAR, INERTIAL, TREE, line_of, read_text, robot, save

ROUNDING = 1e-15  # placements are products of two sines: a few units in the last place


def test_a_joint_says_all_that_its_file_says(tmp_path: Path) -> None:
    drive = read_text(tmp_path, FOUR_BAR).joints[0]
    assert (drive.name, drive.kind, drive.parent, drive.child) == ("drive", "revolute", "ground", "crank")
    assert (drive.lower, drive.upper, drive.velocity, drive.effort) == (-3, 3, 5, 10)
    assert (drive.damping, drive.friction, drive.rotor_inertia, drive.gear_ratio) == (0.1, 0.2, 0, 1)
    expected = [[math.cos(0.4), -math.sin(0.4)], [math.sin(0.4), math.cos(0.4)]]
    np.testing.assert_allclose(drive.placement[:2, :2], expected, atol=ROUNDING)
    assert drive.line == line_of(FOUR_BAR, '<joint name="drive"')


def test_absent_limits_are_infinite(tmp_path: Path) -> None:
    elbow = read_text(tmp_path, FOUR_BAR).joints[1]
    assert (elbow.lower, elbow.upper, elbow.velocity, elbow.effort) == (
        -math.inf,
        math.inf,
        math.inf,
        math.inf,
    )


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


def test_quaternions_of_urdf_1_1(tmp_path: Path) -> None:
    half = math.sqrt(0.5)
    text = FOUR_BAR.replace('rpy="0 0 0.4"', f'quat_xyzw="0 0 {half} {half}"')
    placement = read_text(tmp_path, text).joints[0].placement
    np.testing.assert_allclose(placement[:2, :2], [[0, -1], [1, 0]], atol=ROUNDING)


def test_limits_that_lie_are_noted(tmp_path: Path) -> None:
    text = FOUR_BAR.replace('lower="-3" upper="3" velocity="5"', 'lower="3" upper="-3" velocity="-1"')
    description = read_text(tmp_path, text)
    drive = description.joints[0]
    assert (drive.lower, drive.upper, drive.velocity) == (-math.inf, math.inf, math.inf)
    assert any("both ignored" in note for note in description.notes)
    assert any("negative velocity" in note for note in description.notes)


def test_other_attributes_and_tags_pass(tmp_path: Path) -> None:
    text = FOUR_BAR.replace('velocity="5"', 'velocity="5" gear_velocity="10" jerk="3"').replace(
        '<link name="ground"/>',
        '<link name="ground"><visual><geometry><mesh filename="package://nowhere/a.stl"/></geometry></visual></link>'
        '<material name="red"/><gazebo reference="drive"><provideFeedback>true</provideFeedback></gazebo>',
    )
    assert len(read_text(tmp_path, text).joints) == 3


def test_kinds_that_pinocchio_has(tmp_path: Path) -> None:
    for kind in ("fixed", "revolute", "continuous", "prismatic", "floating", "planar"):
        text = f"""<robot name="r"><link name="a"/><link name="b">{INERTIAL}</link>
        <joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 0 1"/></joint>
        </robot>"""
        assert read_text(tmp_path, text).joints[0].kind == kind


def test_a_link_and_a_joint_may_share_a_name(tmp_path: Path) -> None:
    description = read_text(tmp_path, FOUR_BAR.replace('"drive"', '"crank"'))
    assert description.joints[0].name == description.joints[0].child == "crank"


TRANSMISSION = """<transmission name="t"><type>transmission_interface/SimpleTransmission</type>
  <joint name="drive"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
  <actuator name="m"><mechanicalReduction>50</mechanicalReduction>
  <drake:rotor_inertia value="1e-4"/></actuator></transmission>"""


def test_transmissions_give_rotor_and_ratio(tmp_path: Path) -> None:
    drive = read_text(tmp_path, robot(TRANSMISSION)).joints[0]
    assert (drive.gear_ratio, drive.rotor_inertia) == (50, 1e-4)


MIMIC = robot().replace(
    '<origin xyz="1 0 0"/><parent link="crank"/>',
    '<mimic joint="drive" multiplier="-2" offset="0.3"/><origin xyz="1 0 0"/><parent link="crank"/>',
)


def test_mimic_is_a_coupling(tmp_path: Path) -> None:
    (coupling,) = read_text(tmp_path, MIMIC).couplings
    assert coupling.name == "elbow"
    assert coupling.terms == (("elbow", 1.0), ("drive", 2.0))
    assert coupling.offset == 0.3


def test_mimic_on_a_fixed_joint_is_noted(tmp_path: Path) -> None:
    text = robot(
        '<link name="x"/><joint name="f" type="fixed"><parent link="rocker"/><child link="x"/>'
        '<mimic joint="drive"/></joint>'
    )
    description = read_text(tmp_path, text)
    assert not description.couplings
    assert any("<mimic> has no effect" in note for note in description.notes)


def test_what_other_readers_ignore_is_noted(tmp_path: Path) -> None:
    """An axis with angles, as old exporters wrote it; a joint on the world, which Drake and Gazebo have."""
    text = FOUR_BAR.replace('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1" rpy="0 0 0.3"/>', 1)
    fixed = '<joint name="stand" type="fixed"><parent link="world"/><child link="ground"/></joint></robot>'
    found = read_text(tmp_path, text.replace("</robot>", fixed))
    wanted = read_text(tmp_path, FOUR_BAR)
    assert [link.name for link in found.links] == ["world", *(link.name for link in wanted.links)]
    np.testing.assert_array_equal(found.joints[0].axis, wanted.joints[0].axis)
    notes = "\n".join(found.notes)
    for words in ("'rpy' of the <axis> of joint", "a link 'world' that the file does not state"):
        assert words in notes


AXIS = '<axis xyz="0 0 1"/>\n    <limit'
DRIVE = 'type="revolute">\n    <origin'
PLANAR = f"""<robot name="r"><link name="a"/><link name="b">{INERTIAL}</link>
<joint name="j" type="planar"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/></joint></robot>"""
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
    (FOUR_BAR, DRIVE, 'type="spherical">\n    <origin', "does not exist in URDF"),
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
    (PLANAR, "", "", "x-y plane"),
]


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
        (links("a", "b"), "2 links have no parent joint: 'a', 'b'"),
        (links(*(f"l{i}" for i in range(20))), "'l7' and 12 more"),
    ],
)
def test_is_refused(tmp_path: Path, body: str, message: str) -> None:
    refused(save(tmp_path, f'<robot name="r">{body}</robot>'), message)


def test_a_long_chain_is_read_without_recursion(tmp_path: Path) -> None:
    count = 6000
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


def test_a_mass_without_inertia_is_a_point(tmp_path: Path) -> None:
    text = FOUR_BAR.replace(INERTIAL, '<inertial><mass value="2"/></inertial>', 1)
    description = read_text(tmp_path, text)
    assert description.links[1].mass == 2
    assert not description.links[1].inertia.any()
    assert any("point mass" in note for note in description.notes)


def test_couplings_need_joints_with_one_freedom(tmp_path: Path) -> None:
    free = '<link name="x"/><joint name="f" type="floating"><parent link="rocker"/><child link="x"/></joint>'
    mimic = TREE.replace('<origin xyz="1 0 0"/>', '<origin xyz="1 0 0"/><mimic joint="f"/>')
    refused(save(tmp_path, f'<robot name="r">{mimic}{free}</robot>'), "joint 'f' is floating")
