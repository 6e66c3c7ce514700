"""Closures of a URDF in the forms of other projects: each is the `<loop>` that has their meaning."""

import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.description.loop_signs import lost_loops
from tests.description.reading import Texts, holds, refused, save_all
from tests.description.test_urdf_dialects import AXIS, GAZEBO, MOTOR, angles, closed, compare, frame, loop
from tests.robots.robot_texts import INERTIAL, robot
from tests.support.files import save
from tests.support.samples import slow

#: urdfdom's proposal: each side has its own origin and its own axis.
CONSTRAINT = """<constraint name="pin" type="{}">
  <parent link="coupler"/><parent_origin xyz="1.5 0 0" rpy="0.5 0 0"/><parent_axis xyz="{}"/>
  <child link="rocker"/><child_origin xyz="1 0 0"/><child_axis xyz="{}"/></constraint>"""
#: The z axis of a frame that stands at rpy 0.5 0 0.
TURNED = f"0 {math.sin(0.5)!r} {math.cos(0.5)!r}"

#: What an exporter of Fusion writes: one point in both links, and the axis in the parent's frame.
FUSION = """<loop_joint name="pin" type="{}">
  <parent link="coupler"/><child link="rocker"/>
  <parent_origin xyz="1.5 0.0 0.0"/><child_origin xyz="1.0 0.0 0.0"/>{}</loop_joint>"""

#: Dojo's, whose joint has damping.
DOJO = """<loop_joint name="pin" type="continuous"><axis xyz="0 0 1"/>
  <link1 link="coupler" rpy="0 0 0" xyz="1.5 0 0"/><link2 link="rocker" rpy="0 0 0" xyz="1 0 0"/>
  <dynamics damping="1.0"/></loop_joint>"""

CROSS = (
    '<loop name="pin" type="universal"><predecessor link="coupler"><origin xyz="1.5 0 0"/></predecessor>'
    '<successor link="rocker"><origin xyz="1 0 0" rpy="{}"/></successor><axis xyz="0 0 1"/><axis2 xyz="{}"/>'
    "</loop>"
)
BALL = loop("spherical", "")


def pair(one: str, other: str, *, high: bool = False) -> str:
    """Return two frames at the tip of the four-bar, and two more 0.1 m above them."""
    frames = frame(one, "coupler", "1.5 0 0") + frame(other, "rocker", "1 0 0")
    above = frame(f"{one}_z", "coupler", "1.5 0 0.1") + frame(f"{other}_z", "rocker", "1 0 0.1")
    return frames + (above if high else "")


#: A robot in the words of another project, and in ours.
SAME: dict[str, tuple[Texts, str]] = {
    "a revolute constraint": (
        robot(MOTOR, CONSTRAINT.format("revolute", TURNED, "0 0 1")), robot(MOTOR, loop("revolute")),
    ),
    "a spherical constraint": (
        robot(MOTOR, CONSTRAINT.format("spherical", "1 0 0", "0 1 0")), robot(MOTOR, BALL),
    ),
    "a universal constraint": (
        robot(MOTOR, CONSTRAINT.format("universal", TURNED, "1 0 0")),
        robot(MOTOR, CROSS.format("0 0 0", "1 0 0")),
    ),
    "a hinge of Fusion": (
        robot(MOTOR, FUSION.format("revolute", '<axis xyz="0 0 1" frame="parent"/>')),
        robot(MOTOR, loop("revolute")),
    ),
    "a ball of Fusion": (robot(MOTOR, FUSION.format("spherical", "")), robot(MOTOR, BALL)),
    "a universal joint of Gazebo": (
        closed(MOTOR, GAZEBO.format("universal", "0 0 0", AXIS + "<axis2><xyz>1 0 0</xyz></axis2>")),
        closed(MOTOR, CROSS.format("0 0 0", "1 0 0")),
    ),
    **{
        f"{one} and {other}": (
            robot(MOTOR, pair(one, other)), robot(MOTOR, pair("x1", "x2"), BALL),
        )
        for one, other in (
            ("loop_tip_1", "loop_tip_2"), ("tip_cut_a", "tip_cut_b"), ("cut_tip_A", "cut_tip_B"),
            ("loop_closure_1_a", "loop_closure_1_b"),
        )
    },
    "a hinge of two pairs": (
        robot(MOTOR, pair("loop_tip_1", "loop_tip_2", high=True)),
        robot(MOTOR, pair("x1", "x2", high=True), loop("revolute")),
    ),
}  # fmt: skip
SLOW = (
    "a spherical",
    "a revolute",
    "a ball",
    "a universal joint",
    "tip_cut",
    "cut_tip",
    "loop_closure",
    "a hinge of two",
)


@pytest.mark.parametrize("name", [slow(name) if name.startswith(SLOW) else name for name in SAME])
def test_the_same_loop_in_their_words(name: str, tmp_path: Path) -> None:
    theirs, ours = SAME[name]
    compare(save_all(tmp_path / "a", theirs), save(tmp_path / "b", ours))


def test_an_axis_of_fusion_is_that_of_the_parent_in_both_links(tmp_path: Path) -> None:
    """The links stand turned about z where all joints are at zero; there the axes of both are one."""
    elbow, swing = angles()
    text = closed(MOTOR, FUSION.format("revolute", '<axis xyz="1 2 3" frame="parent"/>'))
    (closure,) = read(save(tmp_path, text)).closures
    axis, turn = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0), 0.4 + elbow - swing
    rotation = np.array([[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]])
    np.testing.assert_allclose(closure.frame_a[:3, 2], axis, atol=1e-15)
    np.testing.assert_allclose(closure.frame_b[:3, :3], rotation @ closure.frame_a[:3, :3], atol=1e-15)
    of_child = text.replace('frame="parent"', 'frame="child"')
    (closure,) = read(save(tmp_path, of_child)).closures
    np.testing.assert_allclose(closure.frame_b[:3, 2], axis, atol=1e-15)


WELDED = frame("closedloop1_A", "coupler", "1.5 0 0") + frame("closedloop1_B", "rocker", "1 0 0")
NAMED = robot(WELDED).replace('"drive"', '"motor_1"').replace('"elbow"', '"elbow_spherical"')
AXLE = '<axis xyz="0 0 1"/>'
LIMIT = '<limit lower="-1" upper="1" effort="1" velocity="1"/>'
#: What is read of a robot.
READ: dict[str, tuple[Texts, dict[str, object]]] = {
    "a prismatic constraint": (
        robot(CONSTRAINT.format("prismatic", "0 1 0", "0 1 0")),
        {"closures": [{"kind": "prismatic", "translations": (0, 1), "rotation": "fixed"}]},
    ),
    "a damped loop of Dojo stays a joint": (
        closed(MOTOR, DOJO), {"joints": {"pin": {"damping": 1.0}}, "closures": ["pin_closure"]},
    ),
    "a damped loop of Fusion stays a joint": (
        closed(MOTOR, FUSION.format("revolute", AXLE + '<dynamics damping="0.5" friction="0.1"/>')),
        {"joints": {"pin": {"damping": 0.5, "friction": 0.1}}, "closures": ["pin_closure"]},
    ),
    "limits of a loop": (
        robot(MOTOR, FUSION.format("revolute", AXLE + LIMIT)),
        {"closures": ["pin"], "notes": {"the limits of closure 'pin' are not read"}},
    ),
    "frames of Gepetto without a side-car": (
        NAMED,
        {
            "closures": [{"kind": "6d", "rotation": "fixed"}], "motors": ("motor_1",),
            "joints": {"elbow_spherical": {"kind": "spherical"}}, "notes": {"1 joints named spherical"},
        },
    ),
    "a pair beside a loop is none": (robot(pair("loop_tip_1", "loop_tip_2"), BALL), {"closures": ["pin"]}),
    "two frames on one body are no pair": (
        robot(frame("loop_tip_1", "coupler", "1.5 0 0") + frame("loop_tip_2", "coupler", "1 0 0")),
        {"closures": []},
    ),
    "links with a mass are no pair": (
        robot(pair("loop_tip_1", "loop_tip_2").replace('"1e-9"', '"0.5"')), {"closures": []},
    ),
    "a damped universal joint of Gazebo": (
        closed(
            MOTOR,
            GAZEBO.format("universal", "0 0 0", AXIS + "<axis2><xyz>1 0 0</xyz><dynamics><damping>1</damping>"
                          "</dynamics></axis2>"),
        ),
        {"closures": ["pin"], "notes": {"drops 'damping' of closure 'pin'"}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", READ)
def test_what_is_read(name: str, tmp_path: Path) -> None:
    texts, expected = READ[name]
    holds(read(save_all(tmp_path, texts)), expected)


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (CONSTRAINT.format("prismatic", "0 1 0", "0 0 1"), "does not say how they are turned"),
        (CONSTRAINT.format("revolut", "0 1 0", "0 0 1"), "did you mean 'revolute'"),
        (
            CONSTRAINT.format("universal", "0 1 0", "0 0 1").replace('<child_axis xyz="0 0 1"/>', ""),
            "<child_axis> is missing",
        ),
        (FUSION.format("revolute", '<axis xyz="0 0 1" frame="world"/>'), "known: 'parent', 'child'"),
        (FUSION.format("revolute", "<link1/>"), "unknown in <loop_joint"),
        (FUSION.format("revolute", "").replace('<child_origin xyz="1.0 0.0 0.0"/>', ""), "<child_origin>"),
        (FUSION.format("revolute", "").replace('"rocker"', '"rokcer"'), "did you mean 'rocker'"),
    ],
)
def test_is_refused_by_name(tmp_path: Path, element: str, message: str) -> None:
    assert refused(save(tmp_path, robot(element)), message).line is not None


COMMANDED = """<ros2_control name="arm" type="system">
  <hardware><plugin>mock_components/GenericSystem</plugin></hardware>
  <joint name="drive"><command_interface name="effort"/><state_interface name="position"/></joint>
  <joint name="swing"><command_interface name="position"/><param name="gain">3</param></joint>
  <joint name="elbow"{}><state_interface name="position"/></joint>{}
</ros2_control>"""
GRIPPER = '<joint name="finger"><command_interface name="effort"/></joint>'
FOLLOWS = '<joint name="elbow" type="continuous">', (
    '<joint name="elbow" type="continuous"><mimic joint="drive" multiplier="-2"/>'
)  # fmt: skip
#: Blocks of ros2_control, and what is read of the robot.
CONTROLLED: dict[str, tuple[str, dict[str, object]]] = {
    "of a tree": (
        robot(COMMANDED.format("", "")),
        {"motors": ("drive", "swing"), "motors_from": "command interfaces of <ros2_control>"},
    ),
    "of a closed loop": (robot(COMMANDED.format("", ""), BALL), {"motors": ("drive", "swing")}),
    "beside transmissions": (
        robot(COMMANDED.format("", ""), MOTOR), {"motors": ("drive",), "motors_from": "URDF <transmission>"},
    ),
    "of joints that were cut away": (
        robot(COMMANDED.format("", GRIPPER)),
        {"motors": ("drive", "swing"), "notes": {"commands joints that the robot does not have: 'finger'"}},
    ),
    "of nothing that is commanded": (
        robot(COMMANDED.format("", "").replace("command_", "state_")),
        {"motors": ("drive", "elbow", "swing")},
    ),
    "with a follower": (
        robot(COMMANDED.format(' mimic="true"', "")).replace(*FOLLOWS),
        {"motors": ("drive", "swing"), "couplings": ["elbow"], "notes": ()},
    ),
    "with a follower that is none": (
        robot(COMMANDED.format(' mimic="true"', "")), {"notes": {"but follows no joint"}, "couplings": []},
    ),
    "with a follower that is said to be none": (
        robot(COMMANDED.format(' mimic="false"', "")).replace(*FOLLOWS),
        {"notes": {"it follows by its <mimic> here"}, "couplings": ["elbow"]},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CONTROLLED)
def test_command_interfaces_are_motors(name: str, tmp_path: Path) -> None:
    text, expected = CONTROLLED[name]
    holds(read(save(tmp_path, text)), expected)


def test_a_tree_with_a_joint_without_command_is_told(tmp_path: Path) -> None:
    (sign,) = lost_loops(read(save(tmp_path, robot(COMMANDED.format("", "")))))
    assert "<ros2_control> drives 2 joints and leaves these passive: 'elbow'" in sign.message


def test_a_robot_with_two_roots_says_which_and_how_to_weld_them(tmp_path: Path) -> None:
    table = f'<link name="table">{INERTIAL}</link>'
    error = refused(save(tmp_path, robot(table)), "'ground' (3 links on it), 'table' (nothing on it)")
    weld = str(error).partition("write ")[2].partition(";")[0]
    read(save(tmp_path, robot(table, weld.replace("ROOT", "ground").replace("OTHER", "table"))))


SPHERICAL = f"""<robot name="pendulum"><link name="base"/><link name="bob">{INERTIAL}</link>
  <joint name="neck" type="spherical"><parent link="base"/><child link="bob"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"/><dynamics damping="0.25"{{}}/></joint></robot>"""


def test_a_spherical_joint_is_a_ball_whose_damping_is_that_of_each_axis(tmp_path: Path) -> None:
    """PyBullet's `spherical`: Euler's equation of the body about its centre, with -d w about each axis."""
    loaded = hybridyn.load(save(tmp_path, SPHERICAL.format("")))
    (joint,) = loaded.description.joints
    assert (joint.kind, joint.damping, loaded.motors) == ("spherical", 0.25, ())
    half = np.array([0.3, -0.4, 0.5, 0.0]) / 2
    q = np.array([*half[:3], math.sqrt(1 - half[:3] @ half[:3])])
    w = np.array([0.7, -0.2, 1.1])
    found = hybridyn.ddm(loaded, q, w, [], effects="model")
    com, inertia = np.array([0.5, 0.0, 0.0]), np.diag([0.1, 0.2, 0.25])
    inertia = inertia + 2.0 * (com @ com * np.eye(3) - np.outer(com, com))
    down = (pin.rpy.rpyToMatrix(0.3, -0.2, 0.5) @ pin.Quaternion(*q[[3, 0, 1, 2]]).matrix()).T @ [0, 0, -9.81]
    moment = 2.0 * np.cross(com, down) - np.cross(w, inertia @ w) - 0.25 * w
    np.testing.assert_allclose(found, np.linalg.solve(inertia, moment), rtol=1e-12)


def test_a_spherical_joint_has_no_dry_friction(tmp_path: Path) -> None:
    found = read(save(tmp_path, SPHERICAL.format(' friction="0.5"')))
    holds(found, {"joints": {"neck": {"friction": 0.0}}, "notes": {"drops the dry friction of joint 'neck'"}})


def in_root() -> str:
    """Return where the tip of the closed four-bar stands in the root's frame."""
    elbow, _ = angles()
    at = np.array([math.cos(0.4), math.sin(0.4)])
    at = at + 1.5 * np.array([math.cos(0.4 + elbow), math.sin(0.4 + elbow)])
    return f"[{at[0]:.17g}, {at[1]:.17g}, 0.0]"


SOLVED = "dependent: [elbow, swing]\nindependent: [drive]\n"
HINGES = f"closures:\n- axis: [0.0, 0.0, 1.0]\n  link_a: coupler\n  link_b: rocker\n  point: {in_root()}\n"
POINTS = """  - name: pin
    parent: coupler
    child: rocker
    parent_xyz: [1.5, 0.0, 0.0]
    child_xyz: [1.0, 0.0, 0.0]
"""
PINS = f"pin_loops:\n{POINTS}    axis: [0.0, 0.0, 1.0]\nactuated_joints:\n  - drive\n"


@pytest.mark.parametrize(
    ("name", "side_car"),
    [
        ("loop_closures.yaml", HINGES + SOLVED),
        slow("../config/loop_closures.yaml", HINGES + SOLVED),
        slow("../loop_closures.yml", PINS),
    ],
)
def test_hinges_of_loop_closures(name: str, side_car: str, tmp_path: Path) -> None:
    theirs = save(tmp_path / "a" / "urdf", closed())
    save((tmp_path / "a" / "urdf" / name).parent, side_car, Path(name).name)
    compare(theirs, save(tmp_path / "b", closed(MOTOR, loop("revolute"))))


#: Files beside the four-bar, and what is read.
BESIDE: dict[str, tuple[str, str, dict[str, object]]] = {
    "a ball": (
        closed(), f"ball_loops:\n{POINTS}ball_upgrades: [elbow]\nball_limit_deg: 15.0\n",
        {
            "closures": [{"name": "pin", "rotation": "free"}], "joints": {"elbow": {"kind": "spherical"}},
            "notes": {"ball_limit_deg of loop_closures.yaml is not read"},
        },
    ),
    "motors": (closed(), HINGES + SOLVED, {"motors_from": "independent of loop_closures.yaml"}),
    "motors of the robot": (closed(MOTOR), HINGES + SOLVED, {"motors_from": "URDF <transmission>"}),
    "a robot with loops": (
        robot(MOTOR, BALL), HINGES, {"closures": ["pin"], "notes": {"states closures itself; not read"}},
    ),
    "another robot's": (
        robot(), HINGES.replace("coupler", "arm").replace("rocker", "leg"),
        {"closures": [], "notes": {"names no link of this robot"}},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BESIDE)
def test_loop_closures_beside_a_robot(name: str, tmp_path: Path) -> None:
    text, side_car, expected = BESIDE[name]
    holds(read(save_all(tmp_path, {"r.urdf": text, "loop_closures.yaml": side_car})), expected)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("link_b: rocker", "link_b: rokcer", "no link is called 'rokcer' (did you mean 'rocker'?)"),
        ("[0.0, 0.0, 1.0]", "[0.0, 0.0, 0.0]", "is zero, so it has no direction"),
        ("[0.0, 0.0, 1.0]", "[0.0, 1.0]", "at least 3 items"),
        ("[0.0, 0.0, 1.0]", "[0.0, 0.0, .nan]", "should be a finite number"),
        ("link_b: rocker", "link_c: rocker", "'link_b' is missing"),
        ("independent: [drive]", "independent: [drvie]", "no joint is called 'drvie'"),
        ("closures:", "closure:", "states no loop"),
    ],
)
def test_wrong_loop_closures(old: str, new: str, message: str, tmp_path: Path) -> None:
    side_car = (HINGES + SOLVED).replace(old, new)
    error = refused(save_all(tmp_path, {"r.urdf": closed(), "loop_closures.yaml": side_car}), message)
    assert error.file == str(tmp_path / "loop_closures.yaml")


WRIST = """<robot name="wrist"><link name="base"/><link name="cross">{0}</link><link name="hand">{0}</link>
<joint name="pitch" type="revolute"><parent link="base"/><child link="cross"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="10" velocity="5"/></joint>
<joint name="roll" type="revolute"><parent link="cross"/><child link="hand"/><axis xyz="0 0 1"/>
  <limit lower="-2" upper="2" effort="10" velocity="5"/></joint>
<transmission name="wrist_trans"><type>transmission_interface/{1}Transmission</type>
  <actuator name="m2"><role>actuator2</role><mechanicalReduction>50</mechanicalReduction>
    <rotor_inertia>{3}</rotor_inertia></actuator>
  <actuator name="m1"><role>actuator1</role><mechanicalReduction>30</mechanicalReduction>
    <rotor_inertia>{2}</rotor_inertia></actuator>
  <joint name="roll"><role>joint2</role><mechanicalReduction>3</mechanicalReduction></joint>
  <joint name="pitch"><role>joint1</role><mechanicalReduction>2</mechanicalReduction></joint>
</transmission></robot>"""


@pytest.mark.parametrize(
    ("kind", "rates"),
    [
        ("Differential", [[30 * 2, 30 * 3], [50 * 2, -50 * 3]]),
        ("FourBarLinkage", [[30 * 2, 0], [50, 50 * 3]]),
    ],
)
def test_rotors_that_turn_with_two_joints(kind: str, rates: list[list[float]], tmp_path: Path) -> None:
    """Each rotor adds J r r^T to the mass matrix, with r its turns per turn of the joints."""
    loaded = hybridyn.load(save(tmp_path, WRIST.format(INERTIAL, kind, 1e-5, 3e-5)))
    bare = hybridyn.load(save(tmp_path / "bare", WRIST.format(INERTIAL, kind, 0, 0)))
    assert loaded.motors == bare.motors == ("roll", "pitch")
    q = np.array([0.3, -0.4])
    turns = np.array(rates)[:, ::-1]  # of roll, then pitch: the order of the motors
    added = sum(J * np.outer(r, r) for J, r in zip((1e-5, 3e-5), turns, strict=True))
    expected = hybridyn.mass_matrix(bare, q) + added
    at = hybridyn.assemble(loaded, motors={"pitch": (q[0], 0, 0), "roll": (q[1], 0, 0)}, guess=loaded.home)[0]
    found = hybridyn.mass_matrix(loaded, at, effects="model")
    np.testing.assert_allclose(found, expected, rtol=1e-11)
    driven = read(save(tmp_path, WRIST.format(INERTIAL, kind, 1e-5, 3e-5)), motors=["m1", "m2"])
    assert driven.motors == ("m1", "m2")
