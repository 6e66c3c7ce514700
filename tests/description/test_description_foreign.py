"""foreign.py: a loop in a form that is not read raises an error naming it; no loop is loaded as a tree."""

from pathlib import Path

import pytest

from hybridyn.description import read
from tests.description.reading import Texts, holds, refused, save_all
from tests.robot_texts import FOUR_BAR, LOOP, TREE, line_of, robot, save

ENDS = '<predecessor link="coupler"/><successor link="rocker"/>'


@pytest.mark.parametrize(
    ("element", "message"),
    [
        (
            "<gazebo><plugin><x><joint name='E'>"
            "<child>rocker</child><parent>coupler</parent></joint></x></plugin></gazebo>",
            "an SDF joint inside <gazebo> (Gazebo)",
        ),
        ('<drake:distance_constraint name="a"/>', "a Drake distance"),
        (
            '<drake:linear_bushing_rpy><drake:bushing_frameA name="a"/></drake:linear_bushing_rpy>',
            "a Drake bushing",
        ),
        ('<drake:weld_constraint body="a"/>', "a Drake weld"),
        ('<drake:joint name="j" type="ball"/>', "a Drake joint"),
        (
            '<loop_constraint name="l"><parent link="a"/><child link="b"/></loop_constraint>',
            "an early form of URDF+",
        ),
        ('<joint_constraint name="l"><gear_ratio value="6"/></joint_constraint>', "an early form of URDF+"),
        (f'<lopp name="l" type="revolute">{ENDS}</lopp>', "did you mean <loop>"),
        (f'<Loop name="l" type="revolute">{ENDS}</Loop>', "did you mean <loop>"),
        ('<couplng name="c"/>', "did you mean <coupling>"),
        ('<jiont name="c"/>', "did you mean <joint>"),
        (f'<pin name="l" type="revolute">{ENDS}</pin>', "an unknown form"),
        ('<pin name="l" link1="a" link2="b"/>', "an unknown form"),
        ('<cut><parent link="a"/><child link="b"/></cut>', "an unknown form"),
        ("<loop_closures/>", "an unknown form"),
        ('<include filename="rest.urdf"/>', "URDF includes no file"),
        ('<equality><connect body1="a" body2="b"/></equality>', "an unknown form"),
        ('<predecessor link="a"/>', "is not read directly below <robot>"),
        ('<mimic joint="drive"/>', "is not read directly below <robot>"),
        ('<part><link name="x"/></part>', "they would be lost"),
        (f"<gazebo>{LOOP}</gazebo>", "inside <gazebo>"),
        (f'<link name="x">{LOOP}</link>', "is not read inside <link>"),
        (f'<link name="x"><visual>{LOOP}</visual></link>', "is not read inside <visual>"),
        ('<link name="x"><mimic joint="drive"/></link>', "is not read inside <link>"),
        ('<joint name="x" type="fixed"><link name="y"/></joint>', "is not read inside <joint>"),
        (
            f'<joint name="x" type="fixed"><robot name="r">{TREE}{LOOP}</robot></joint>',
            "is not read inside <robot>",
        ),
        (
            '<joint name="x" type="fixed"><axis><mimic joint="drive"/></axis></joint>',
            "is not read inside <axis>",
        ),
        ('<transmission><loop name="l"/></transmission>', "is not read inside <transmission>"),
    ],
)
def test_is_refused_by_name(tmp_path: Path, element: str, message: str) -> None:
    text = robot(element)
    start = line_of(text, element)
    assert refused(save(tmp_path, text), message).line in range(start, start + element.count("\n") + 1)


@pytest.mark.parametrize(
    "element",
    [
        '<sensor name="imu" type="imu"><parent link="crank"/><origin xyz="0 0 0"/></sensor>',
        '<ros2_control name="r" type="system"><joint name="drive">'
        '<command_interface name="effort"/></joint></ros2_control>',
        '<frame name="tip" link="rocker" xyz="1 0 0" rpy="0 0 0"/>',
        '<mujoco><compiler meshdir="x"/></mujoco>',
        '<gazebo><plugin filename="libx.so"><joint>drive</joint></plugin></gazebo>',
        "<!-- " + LOOP + " -->",
        '<custom_colour_table><entry value="3"/></custom_colour_table>',
    ],
)
def test_what_closes_nothing_passes(tmp_path: Path, element: str) -> None:
    found = read(save(tmp_path, robot(element)))
    assert any("<custom" in note for note in found.notes) == ("<custom" in element)
    assert found.closures == ()


def frames(*names: str) -> str:
    """Return massless frame links, the first ones on the coupler, the last one on the rocker."""
    return "".join(
        f'<link name="{name}"/><joint name="{name}_frame" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/></joint>'
        for name, parent in zip(names, ["coupler"] * (len(names) - 1) + ["rocker"], strict=True)
    )


CLOSING = frames("fermeture_a", "fermeture_b")
PLUGIN = (
    "<gazebo><plugin filename='libmimic.so'><joint>drive</joint><mimicJoint>{}</mimicJoint></plugin></gazebo>"
)
SECOND = '<joint name="pin" type="revolute"><parent link="coupler"/><child link="rocker"/></joint>'
SIDE_CARS = "loop_closures.yml", "loop_closures.yaml"


@pytest.mark.parametrize(
    ("texts", "messages"),
    [
        (robot(CLOSING), ["nothing says which frames close it"]),
        (robot(SECOND), ["'pin'", "already the child of joint 'swing'", "<loop name"]),
        *(({"four_bar.urdf": robot(), name: "closures: []"}, [name]) for name in SIDE_CARS),
    ],
)
def test_a_loop_that_would_be_lost_is_refused(texts: Texts, messages: list[str], tmp_path: Path) -> None:
    refused(save_all(tmp_path, texts), *messages)


@pytest.mark.parametrize(
    ("texts", "notes"),
    [
        (robot(CLOSING, LOOP), {"named for closing a loop"}),
        (robot(PLUGIN.format("elbow")), {"'elbow' mimic others by a Gazebo plugin"}),
        (robot(PLUGIN.format("stranger")), ()),
        *(({"four_bar.urdf": FOUR_BAR, name: "closures: []"}, {name}) for name in SIDE_CARS),
    ],
)
def test_what_closes_no_more_loops_is_noted(texts: Texts, notes: object, tmp_path: Path) -> None:
    holds(read(save_all(tmp_path, texts)), {"notes": notes})
