"""No mutation of a robot's files ends in a traceback, a hang or a robot that lost a loop.

Seeded mutations of small valid URDF, xacro, YAML and TOML files. Each must be read or refused with a
`ModelError` of one line; a robot that is read has every joint, closure and coupling that still stands in its
text, and no number that is not finite.
"""

import random
import re
from pathlib import Path

import pytest

from hybridyn.description import Description, read
from tests.description.reading import finite, mutated
from tests.mutations import FLAT, TREE
from tests.robot_texts import LOOP, robot, save

CASES = 60  # per seed and file

FRAMES = (
    '<link name="end_a"/><joint name="end_a_frame" type="fixed">'
    '<parent link="coupler"/><child link="end_a"/></joint>\n'
    '<link name="end_b"/><joint name="end_b_frame" type="fixed">'
    '<parent link="rocker"/><child link="end_b"/></joint>\n'
)
URDF = robot(
    LOOP,
    FRAMES,
    '<loop name="u" type="universal"><predecessor link="coupler"><origin xyz="1 2 3"/></predecessor>'
    '<successor link="end_b"/><axis xyz="1 0 0"/><axis2 xyz="0 1 0"/></loop>',
    '<loop name="r" type="rows" rows="tx ty rx ry">'
    '<predecessor link="crank"/><successor link="end_b"/></loop>',
    '<constraint name="c" type="revolute"><parent link="end_a"/><parent_axis xyz="0 0 1"/>'
    '<child link="end_b"/><child_axis xyz="0 0 1"/></constraint>',
    '<loop_joint name="lj" type="spherical"><link1 link="crank" xyz="0 0 0" rpy="0 0 0"/>'
    '<link2 link="rocker" xyz="0 0 0" rpy="0 0 0"/></loop_joint>',
    '<coupling name="gear"><predecessor link="coupler"/><successor link="rocker"/>'
    '<ratio value="-2"/></coupling>',
    '<link name="tip"/><joint name="tip_joint" type="prismatic"><parent link="rocker"/><child link="tip"/>'
    '<mimic joint="drive" multiplier="0.5" offset="0.1"/></joint>',
    '<transmission name="t"><joint name="drive"/><actuator name="m">'
    "<mechanicalReduction>50</mechanicalReduction></actuator></transmission>",
    '<gazebo reference="drive"><provideFeedback>true</provideFeedback></gazebo>',
)
MATES = "".join(
    f'<link name="closing_tip_{end}"/><joint name="closing_tip_{end}_frame" type="fixed">'
    f'<parent link="{link}"/><child link="closing_tip_{end}"/><origin xyz="1 0 {z}"/></joint>\n'
    for end, link, z in (
        ("1", "coupler", 0),
        ("2", "rocker", 0),
        ("1_z", "coupler", 0.1),
        ("2_z", "rocker", 0.1),
    )
)
DIALECTS = robot(
    MATES,
    '<drake:ball_constraint><drake:ball_constraint_body_A name="coupler"/>'
    '<drake:ball_constraint_body_B name="rocker"/><drake:ball_constraint_p_AP value="1.5 0 0"/>'
    '<drake:ball_constraint_p_BQ value="1 0 0"/></drake:ball_constraint>',
    '<gazebo><joint name="E" type="universal"><parent>coupler</parent><child>rocker</child>'
    '<pose relative_to="crank">1 0 0 0 0.1 0</pose><axis><xyz expressed_in="__model__">0 0 1</xyz></axis>'
    "<axis2><xyz>1 0 0</xyz></axis2></joint></gazebo>",
)
SUBMECHANISMS = """submechanisms:
- type: NUMERICAL
  jointnames_active: [drive]
  jointnames_spanningtree: [drive, elbow, swing]
  loop_constraints:
  - cut_joint: elbow
    predecessor_body: coupler
    successor_body: rocker
    constraint_axes: [{axis: [0., 0., 0., 1., 0., 0.]}, {axis: [0, 0, 0, 0, 1, 0]}]
"""
SIDE_CAR = """closed_loop: [[end_a, end_b]]
type: ['6d']
name_mot: [drive]
joint_name: [swing]
joint_type: [SPHERICAL]
"""
MODEL = """motors = ["drive"]
[home]
drive = 0.5
elbow = [0.6, 0.8]
[joints.drive]
rotor_inertia = 3e-5
gear_ratio = 100.0
"""
XACRO = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="n" default="2"/><xacro:property name="length" value="${0.5 * 2}"/>
<link name="ground"/>
<xacro:macro name="bar" params="name parent x:=0">
  <link name="${name}"/>
  <joint name="${name}_joint" type="continuous"><origin xyz="${x} 0 0"/><parent link="${parent}"/>
    <child link="${name}"/><axis xyz="0 0 1"/></joint>
</xacro:macro>
<xacro:bar name="crank" parent="ground"/>
<xacro:bar name="coupler" parent="crank" x="${length}"/>
<xacro:bar name="rocker" parent="ground" x="1.5"/>
<xacro:if value="$(arg n)"><loop name="pin" type="revolute"><predecessor link="coupler"/>
<successor link="rocker"><origin xyz="${length} 0 0"/></successor><axis xyz="0 0 1"/></loop></xacro:if>
</robot>
"""


def check(description: Description, text: bytes) -> None:
    """Check that a robot that was read has all its loops."""
    plain = re.sub(rb"<!--.*?-->", b"", text, flags=re.DOTALL)
    closures = len(re.findall(rb"<(?:loop|constraint|loop_joint)\b", plain))
    couplings = len(re.findall(rb"<(?:coupling|mimic)\b", plain))
    idle = sum("<mimic> has no effect" in note for note in description.notes)
    assert len(description.closures) >= closures, text
    assert len(description.couplings) + idle >= couplings, text
    assert len(description.joints) >= len(re.findall(rb"<joint\b[^<>]*\btype=", plain)), text


def test_the_files_are_good_as_they_stand(tmp_path: Path) -> None:
    side_car = SIDE_CAR.replace("joint_name: [swing]\njoint_type: [SPHERICAL]\n", "")
    save(tmp_path, side_car, "r.yaml")
    save(tmp_path, MODEL, "r.model.toml")
    description = read(save(tmp_path, URDF, "r.urdf"))
    assert (len(description.closures), len(description.couplings)) == (6, 2)
    check(description, URDF.encode())
    finite(description, URDF)


@pytest.mark.parametrize("seed", range(3))
def test_urdf(tmp_path: Path, seed: int) -> None:
    draw = random.Random(seed)
    mutated(tmp_path / "r.urdf", lambda: draw.choice(TREE)(URDF, draw), CASES * 2, check)


@pytest.mark.parametrize("name", ["r.yaml", "r.model.toml"])
def test_files_beside(tmp_path: Path, name: str) -> None:
    draw = random.Random(name)
    urdf = robot(FRAMES, LOOP)
    original = SIDE_CAR if name == "r.yaml" else MODEL

    def judge(description: Description, text: bytes) -> None:
        check(description, urdf.encode())
        if re.search(rb"^closed_loop: \[\[.+\]\]$", text, re.MULTILINE):
            assert len(description.closures) == 2, text

    path = save(tmp_path, urdf, "r.urdf")
    mutated(path, lambda: draw.choice(FLAT)(original, draw), CASES, judge, path.with_name(name))


def test_xacro(tmp_path: Path) -> None:
    draw = random.Random(2)
    mutated(tmp_path / "r.urdf.xacro", lambda: draw.choice(TREE)(XACRO, draw), 10, lambda *_: None)


def test_dialects(tmp_path: Path) -> None:
    draw = random.Random(4)

    def judge(description: Description, text: bytes) -> None:
        plain = re.sub(rb"<!--.*?-->", b"", text, flags=re.DOTALL)
        stated = len(re.findall(rb"<drake:ball_constraint\b", plain))
        stated += len(re.findall(rb'<joint name="[^"]*" type="universal"', plain))
        stated += all(b'"closing_tip_%d"' % end in plain for end in (1, 2))
        assert len(description.closures) >= stated, text

    mutated(tmp_path / "r.urdf", lambda: draw.choice(TREE)(DIALECTS, draw), CASES * 2, judge)


def test_submechanisms(tmp_path: Path) -> None:
    draw = random.Random(5)

    def judge(description: Description, text: bytes) -> None:
        if re.search(rb"^  - cut_joint", text, re.MULTILINE):
            assert len(description.closures) == 1, text

    path, file = save(tmp_path, robot(), "r.urdf"), tmp_path / "submechanisms.yml"
    mutated(path, lambda: draw.choice(FLAT)(SUBMECHANISMS, draw), CASES, judge, file)
