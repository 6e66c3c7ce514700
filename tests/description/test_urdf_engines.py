"""Words of other engines in URDF that are read: each gives the numbers that its engine computes."""

import logging
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn import HybridRobot
from tests.robots.robot_texts import INERTIAL, TREE
from tests.support.files import save

#: Relative difference of two ways to compute an effort.
EQUAL = 1e-9
MOTOR = '<transmission name="t"><joint name="drive"/></transmission>'
LOOP_JOINT = (
    '<loop_joint name="pin" type="continuous"><axis xyz="0 0 1"/><link1 link="coupler" xyz="1.5 0 0"/>'
    '<link2 link="rocker" xyz="1 0 0"/>{}</loop_joint>'
)
#: The four-bar of `robot_texts` bent so that its loop is closed where all joints are at zero.
BENT = TREE.replace('<origin xyz="1 0 0"/>', '<origin xyz="1 0 0" rpy="0 0 -0.4"/>').replace(
    '<origin xyz="1.5 0 0"/>', '<origin xyz="1.5 0 0" rpy="0 0 0.4"/>'
)
SDF_JOINT = (
    '<gazebo><joint name="pin" type="revolute"><parent>coupler</parent><child>rocker</child><pose>1 0 0 0 0 0'
    "</pose><axis><xyz>0 0 1</xyz>{}</axis></joint></gazebo>"
)


def load(folder: Path, *parts: str, tree: str = BENT, name: str = "robot.urdf") -> HybridRobot:
    return hybridyn.load(save(folder, f'<robot name="four_bar">{tree}{"".join(parts)}</robot>', name))


def rate(robot: HybridRobot, v: np.ndarray, name: str) -> float:
    return float(v[robot.model.joints[robot.model.getJointId(name)].idx_v])


def angle(robot: HybridRobot, q: np.ndarray, name: str) -> float:
    """Return the position of a joint, also from cosine and sine [rad]."""
    joint = robot.model.joints[robot.model.getJointId(name)]
    at = q[joint.idx_q : joint.idx_q + joint.nq]
    return float(at[0] if joint.nq == 1 else np.arctan2(at[1], at[0]))


@pytest.mark.parametrize(
    ("kept", "law"),
    [
        (LOOP_JOINT.format('<dynamics damping="5"/>'), (5, 0, 0)),
        (LOOP_JOINT.format('<dynamics stiffness="7" spring_mount="0.2"/>'), (0, 7, 0.2)),
        (SDF_JOINT.format("<dynamics><damping>5</damping></dynamics>"), (5, 0, 0)),
        (
            SDF_JOINT.format(
                "<dynamics><spring_stiffness>7</spring_stiffness>"
                "<spring_reference>.2</spring_reference></dynamics>"
            ),
            (0, 7, 0.2),
        ),
    ],
)
def test_forces_of_the_joint_that_closes_the_loop_count(
    kept: str, law: tuple[float, float, float], tmp_path: Path
) -> None:
    """Their power is that of the drive: c w^2 and k (angle - rest) w, with the angle counted from zero."""
    plain = load(tmp_path, MOTOR, LOOP_JOINT.format(""), name="plain.urdf")
    found = load(tmp_path, MOTOR, kept)
    assert found.motors == plain.motors == ("drive",)
    assert found.mobility == 1
    assert found.notes == ()
    of = {"drive": (0.3, 0.9, 0.4)}
    q, v, a = hybridyn.assemble(plain, motors=of, guess=plain.home)
    w = rate(plain, v, "swing") - rate(plain, v, "drive") - rate(plain, v, "elbow")
    turned = angle(plain, q, "swing") - angle(plain, q, "drive") - angle(plain, q, "elbow")
    c, k, rest = law
    power = c * w**2 + k * (turned - rest) * w
    without = hybridyn.idm(plain, q, v, a, effects="model")[0]
    q, v, a = hybridyn.assemble(found, motors=of, guess=found.home)
    with_ = hybridyn.idm(found, q, v, a, effects="model")[0]
    assert with_ == pytest.approx(without + power / 0.9, rel=EQUAL)
    assert hybridyn.idm(found, q, v, a)[0] == pytest.approx(
        hybridyn.idm(plain, *hybridyn.assemble(plain, motors=of, guess=plain.home))[0], rel=EQUAL
    )


SPRING = (
    '<gazebo reference="elbow"><springStiffness>6</springStiffness><springReference>.3</springReference>'
    "</gazebo>"
)
OF_RAISIM = '<child link="coupler"/><dynamics stiffness="6" spring_mount="0.3"/>'


@pytest.mark.parametrize("text", [BENT + SPRING, BENT.replace('<child link="coupler"/>', OF_RAISIM)])
def test_springs_of_gazebo_and_raisim_are_springs(text: str, tmp_path: Path) -> None:
    found = load(tmp_path, MOTOR, tree=text)
    (spring,) = found.description.springs
    assert (spring.name, spring.stiffness, spring.rest) == ("elbow", 6, 0.3)


def test_an_armature_is_the_inertia_at_the_joint_whatever_the_gear(tmp_path: Path) -> None:
    reduction = '<actuator name="m"><mechanicalReduction>9</mechanicalReduction></actuator></transmission>'
    geared = MOTOR.replace("</transmission>", reduction)
    text = BENT.replace('damping="0.1" friction="0.2"', 'armature="0.5"')
    found = load(tmp_path, geared, tree=text)
    (drive,) = (joint for joint in found.description.joints if joint.name == "drive")
    assert (drive.gear_ratio, drive.armature) == (9, pytest.approx(0.5, rel=1e-15))


WRIST = f"""<link name="base"/><link name="cross">{INERTIAL}</link><link name="hand">{INERTIAL}</link>
<joint name="pitch" type="revolute"><parent link="base"/><child link="cross"/><axis xyz="0 1 0"/></joint>
<joint name="roll" type="revolute"><parent link="cross"/><child link="hand"/><axis xyz="0 0 1"/></joint>
<transmission name="wrist"><type>transmission_interface/DifferentialTransmission</type>
<actuator name="m1"><mechanicalReduction>50</mechanicalReduction><rotor_inertia>1e-5</rotor_inertia>
</actuator><actuator name="m2"><mechanicalReduction>{{}}</mechanicalReduction>
<rotor_inertia>{{}}</rotor_inertia></actuator>
<joint name="pitch"><mechanicalReduction>2</mechanicalReduction></joint>
<joint name="roll"><mechanicalReduction>3</mechanicalReduction></joint></transmission>"""


def test_equal_rotors_of_a_differential_are_those_of_its_joints(tmp_path: Path) -> None:
    """The rotors turn with 50 (2 pitch + 3 roll) and 25 (2 pitch - 3 roll), the second with J four times."""
    found = load(tmp_path, tree=WRIST.format(25, 4e-5))
    turns = np.array([[100.0, 150.0], [50.0, -75.0]])
    rotors = turns.T @ np.diag([1e-5, 4e-5]) @ turns
    q = np.array([0.3, 0.4])
    added = hybridyn.mass_matrix(found, q, effects="model") - hybridyn.mass_matrix(found, q)
    np.testing.assert_allclose(added, rotors, rtol=1e-12, atol=1e-15)
    assert found.notes == ()


def test_rotors_that_couple_joints_are_noted(tmp_path: Path) -> None:
    (note,) = load(tmp_path, tree=WRIST.format(50, 3e-5).replace("Differential", "Other")).notes
    assert "drops the rotors of 'm1', 'm2'" in note


def test_a_detachable_joint_is_a_weld_where_all_joints_are_at_zero(tmp_path: Path) -> None:
    ends = (
        '<link name="x"/><joint name="px" type="revolute"><parent link="rocker"/><child link="x"/>'
        '<origin xyz="1 0 0"/><axis xyz="0 0 1"/></joint>'
        '<link name="y"/><joint name="py" type="fixed"><parent link="coupler"/><child link="y"/>'
        '<origin xyz="1.5 0 0"/></joint>'
    )
    plugin = (
        '<gazebo><plugin filename="gz-sim-detachable-joint-system" name="gz::sim::systems::DetachableJoint">'
        "<parent_link>y</parent_link><child_model>four_bar</child_model><child_link>x</child_link></plugin>"
        "</gazebo>"
    )
    found = load(tmp_path, MOTOR, ends, plugin)
    plain = load(tmp_path, MOTOR, LOOP_JOINT.format(""), name="plain.urdf")
    assert found.mobility == 1
    of = {"drive": (0.3, 0.9, 0.4)}
    efforts = [
        hybridyn.idm(one, *hybridyn.assemble(one, motors=of, guess=one.home))[0] for one in (found, plain)
    ]
    assert efforts[0] == pytest.approx(efforts[1], rel=EQUAL)


def test_followers_of_plugins_and_of_ros2_control_are_couplings(tmp_path: Path) -> None:
    numbers = "<multiplier>-2</multiplier><offset>.1</offset>"
    joints = "<joint>drive</joint><mimicJoint>elbow</mimicJoint>"
    plugin = f'<gazebo><plugin filename="m.so">{joints}{numbers}</plugin></gazebo>'
    control = (
        '<ros2_control name="s" type="system"><joint name="elbow"><param name="mimic">drive</param>'
        '<param name="multiplier">-2</param><param name="offset">0.1</param></joint></ros2_control>'
    )
    for text in (plugin, control, plugin + control):
        (coupling,) = load(tmp_path, text).description.couplings
        assert (coupling.terms, coupling.offset) == ((("elbow", 1.0), ("drive", 2.0)), 0.1)


def test_load_tells_what_is_dropped(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING, "hybridyn"):
        load(
            tmp_path, MOTOR, '<gazebo reference="rocker"><gravity>0</gravity></gazebo>', LOOP_JOINT.format("")
        )
    assert "drops <gravity> in <gazebo> of 'rocker'" in caplog.text
