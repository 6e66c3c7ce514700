"""`info` tells of hinges that can never turn and of loops stated twice, and is quiet of sound mechanisms."""

from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from hybridyn.description.records import Description
from hybridyn.description.shipped import shipped_robots
from hybridyn.studies.check.axes import check_axes, check_same_loops
from hybridyn.studies.check.finding import Finding
from hybridyn.studies.check.subject import Subject
from tests.robots.any_mechanism import any_mechanism
from tests.robots.generated import generated
from tests.robots.mechanisms import random_mechanism
from tests.robots.mjcf_texts import mjcf
from tests.robots.robot_texts import DOOR, INERTIAL, LOOP, SECOND_HINGE, robot, save
from tests.support.extras import needs

MOTOR = '<transmission name="t"><joint name="drive"/></transmission>'


def bar(name: str, parent: str, xyz: str, axis: str = "0 0 1", kind: str = "continuous") -> str:
    """Return a link on a joint of its name."""
    limit = '<limit lower="-1" upper="1" effort="0" velocity="0"/>' if kind == "prismatic" else ""
    return (
        f'<link name="{name}">{INERTIAL}</link><joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{name}"/><origin xyz="{xyz}"/><axis xyz="{axis}"/>{limit}</joint>'
    )


def pin(first: str, second: str, name: str, axis: str = '<axis xyz="0 0 1"/>', kind: str = "revolute") -> str:
    """Return a loop of a name between two links, each with the place of its end."""
    (a, xa), (b, xb) = first.split("@"), second.split("@")
    return (
        f'<loop name="{name}" type="{kind}"><predecessor link="{a}"><origin xyz="{xa}"/></predecessor>'
        f'<successor link="{b}"><origin xyz="{xb}"/></successor>{axis}</loop>'
    )


def four_bar(**axes: str) -> str:
    """Return a parallelogram of bars of length 1; `axes` replace those of its hinges."""
    a, b, c = (axes.get(name, "0 0 1") for name in "abc")
    closing = axes.get("p", '<axis xyz="0 0 1"/>')
    parts = bar("a", "base", "0 0 0", a), bar("b", "a", "0 1 0", b), bar("c", "base", "1 0 0", c)
    return (
        '<robot name="r"><link name="base"/>' + "".join(parts) + pin("b@1 0 0", "c@0 1 0", "p", closing)
        + '<transmission name="t"><joint name="a"/></transmission></robot>'
    )  # fmt: skip


#: Plane mechanisms with one wrong axis: the hinge that is named, and what else the message says.
WRONG = {
    "a closure without an axis": (four_bar(p=""), "closure 'p'", "1 freedom, not 0 (1 motor)"),
    "a closure across": (four_bar(p='<axis xyz="0 1 0"/>'), "closure 'p'", "90 degrees to those of 'b', 'a'"),
    "a closure askew": (four_bar(p='<axis xyz="0 1 10"/>'), "closure 'p'", "5.71 degrees"),
    "the first joint": (four_bar(a="1 0 0"), "joint 'a'", "1 freedom, not 0 (1 motor)"),
    "a joint in between": (four_bar(b="1 0 0"), "joint 'b'", "1 freedom"),
    "the other leg": (four_bar(c="1 0 0"), "joint 'c'", "1 freedom"),
    "a slider-crank": (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0") + bar("b", "a", "0.6 0.8 0")
        + bar("s", "base", "1 0 0", "1 0 0", "prismatic") + pin("b@1 0 0", "s@0.6 0.8 0", "p", "")
        + '<transmission name="t"><joint name="a"/></transmission></robot>',
        "closure 'p'", "1 freedom, not 0 (1 motor)",
    ),
    "a five-bar": (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0") + bar("b", "a", "0 1 0")
        + bar("c", "base", "2 0 0") + bar("d", "c", "0 1 0") + pin("b@1 0 0", "d@-1 0 0", "p", "")
        + "".join(f'<transmission name="{x}"><joint name="{x}"/></transmission>' for x in "ac") + "</robot>",
        "closure 'p'", "2 freedoms, not 1 (2 motors)",
    ),
}  # fmt: skip


def told(d: Description) -> list[Finding]:
    """Return what the checks of axes and loops say of a description alone."""
    from lxml import etree

    from hybridyn.description.urdf.xml_node import XmlNode

    subject = Subject(XmlNode(etree.Element("robot"), "r.urdf"), d)
    return [*check_axes(subject), *check_same_loops(subject)]


@pytest.mark.parametrize("case", WRONG)
def test_a_hinge_that_can_never_turn_is_told(case: str, tmp_path: Path) -> None:
    text, element, part = WRONG[case]
    found = [one for one in hybridyn.check(save(tmp_path, text)) if one.code == "axis-across"]
    assert [one.element for one in found] == [element]
    assert all(part in one.message for one in found), found


def sphere(axis: str, second: str = "0 1 0") -> str:
    """Return a spherical four-bar about the origin: the axes of its hinges meet there."""
    return (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "1 0 0", "1 0 0")
        + bar("b", "a", "-1 1 0", second) + bar("c", "base", "0 0 1", "0 0 1")
        + pin("b@1 0 1", "c@1 1 0", "p", axis) + MOTOR.replace("drive", "a") + "</robot>"
    )  # fmt: skip


def sarrus(axis: str, second: str = "1 0 0", motors: str = "a") -> str:
    """Return a Sarrus linkage: three hinges about x and three about y."""
    return (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0", "1 0 0")
        + bar("b", "a", "0 1 1", second) + bar("top", "b", "0 -1 1", "1 0 0")
        + bar("c", "base", "1 0 0", "0 1 0") + bar("d", "c", "1 0 1", "0 1 0")
        + pin("top@1 0 0", "d@-1 0 1", "p", axis)
        + "".join(f'<transmission name="{x}"><joint name="{x}"/></transmission>' for x in motors) + "</robot>"
    )  # fmt: skip


Y = '<axis xyz="0 1 0"/>'
#: Space mechanisms with one wrong axis, which their motors tell: the hinge that is named, and its right axis.
TOO_FEW = {
    "a spherical four-bar without an axis": (sphere(""), "closure 'p'", "0.57735 0.57735 0.57735"),
    "a spherical four-bar with a joint askew": (
        sphere('<axis xyz="1 1 1"/>', "0 1 0.5"),
        "joint 'b'",
        "0 1 0",
    ),
    "a Sarrus linkage across": (sarrus('<axis xyz="0 0 1"/>'), "closure 'p'", "0 1 0"),
    "a Sarrus linkage with a joint across": (sarrus(Y, "0 0 1"), "joint 'b'", "1 0 0"),
}


@pytest.mark.parametrize("case", TOO_FEW)
def test_an_axis_that_takes_a_freedom_from_a_motor_is_told(case: str, tmp_path: Path) -> None:
    text, element, right = TOO_FEW[case]
    (found,) = [one for one in hybridyn.check(save(tmp_path, text)) if one.code == "axis-across"]
    assert "it has 0 freedoms for 1 motor, and one for each motor if one axis is turned" in found.message
    assert f"of {element}: {right};" in found.mend.replace("-", "")


@pytest.mark.parametrize("text", [sphere('<axis xyz="1 1 1"/>'), sarrus(Y), sarrus(Y, motors="ac")])
def test_redundant_motors_of_a_sound_mechanism_are_no_sign_of_a_wrong_axis(text: str, tmp_path: Path) -> None:
    assert [one for one in hybridyn.check(save(tmp_path, text)) if one.code == "axis-across"] == []


@pytest.mark.parametrize("seed", range(6))
def test_the_axis_that_is_asked_for_is_that_of_the_frame(seed: int, tmp_path: Path) -> None:
    """Turned frames: with the axis that is asked for nothing is told, and the mobility is that stated."""
    rng = np.random.default_rng(seed)
    rpy = " ".join(map(str, rng.uniform(-3, 3, 3)))
    text = four_bar(p="")
    for at, end in (("1 0 0", "predecessor"), ("0 1 0", "successor")):
        text = text.replace(f'"{at}"/></{end}>', f'"{at}" rpy="{rpy}"/></{end}>')
    (found,) = [one for one in hybridyn.check(save(tmp_path, text)) if one.code == "axis-across"]
    axis = found.mend.partition("own frame: ")[2].partition(";")[0]
    mended = save(tmp_path, text.replace("</successor>", f'</successor><axis xyz="{axis}"/>'))
    assert [one for one in hybridyn.check(mended) if one.code == "axis-across"] == []
    assert hybridyn.load(mended).mobility == 1
    assert "1 freedom, not 0" in found.message


#: Sound mechanisms with hinges that are not parallel.
SOUND = {
    "a four-bar": four_bar(),
    "a door": f'<robot name="door">{DOOR}{SECOND_HINGE}</robot>',
    "a spherical four-bar": (  # all axes meet in the origin
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0", "1 0 0")
        + bar("b", "a", "0 0 0", "0 1 0") + bar("c", "base", "0 0 0", "0 0 1")
        + pin("b@0 0 0", "c@0 0 0", "p", '<axis xyz="1 1 1"/>') + "</robot>"
    ),
    "a Sarrus linkage": (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0", "1 0 0")
        + bar("b", "a", "0 1 1", "1 0 0") + bar("top", "b", "0 -1 1", "1 0 0")
        + bar("c", "base", "1 0 0", "0 1 0") + bar("d", "c", "1 0 1", "0 1 0")
        + pin("top@1 0 0", "d@-1 0 1", "p", '<axis xyz="0 1 0"/>') + "</robot>"
    ),
    "a crank and a cylinder": (  # the piston may turn, but the pin keeps it from it
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0") + bar("b", "a", "0 1 0")
        + bar("s", "base", "1 1 0", "1 0 0", "prismatic") + bar("t", "s", "0 0 0", "1 0 0")
        + pin("b@1 0 0", "t@0 0 0", "p") + "</robot>"
    ),
    "a crank whose closure slides": (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0") + bar("b", "a", "0 1 0")
        + pin("b@1 0 0", "base@1 1 0", "p", '<axis xyz="1 0 0"/>', "cylindrical") + "</robot>"
    ),
    "a ball": (
        '<robot name="r"><link name="base"/>' + bar("a", "base", "0 0 0") + bar("b", "a", "0 1 0", "1 0 0")
        + bar("c", "base", "1 0 0") + pin("b@1 0 0", "c@0 1 0", "p", "", "spherical") + "</robot>"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SOUND)
def test_sound_mechanisms_are_quiet(case: str, tmp_path: Path) -> None:
    assert told(read(save(tmp_path, SOUND[case]))) == []


@pytest.mark.parametrize("name", shipped_robots())
def test_shipped_robots_are_quiet(name: str) -> None:
    assert told(read(shipped_robots()[name].file)) == []


def test_random_mechanisms_are_quiet() -> None:
    for seed in range(10):
        for description in (random_mechanism(seed), generated(seed).description, any_mechanism(seed)[0]):
            assert told(description) == []


TWIN = LOOP.replace('"pin"', '"twin"')
SWAPPED = (
    '<loop name="twin" type="revolute"><predecessor link="rocker"><origin xyz="1 0 0"/></predecessor>'
    '<successor link="coupler"><origin xyz="1.5 0 0"/></successor><axis xyz="0 0 1"/></loop>'
)
ON_FRAME = (
    '<link name="tip"/><joint name="tip_weld" type="fixed"><parent link="coupler"/><child link="tip"/>'
    '<origin xyz="1.5 0 0" rpy="0 0 1"/></joint>'
    + TWIN.replace('link="coupler"><origin xyz="1.5 0 0" rpy="0 0 0"/>', 'link="tip"><origin xyz="0 0 0"/>')
)
#: Second loops, and whether they are the first once more.
TWICE = {
    "copied": (TWIN, True),
    "the other way round": (SWAPPED, True), "on a frame of the link": (ON_FRAME, True),
    "elsewhere": (TWIN.replace('xyz="1 0 0"', 'xyz="1 0 0.1"').replace("1.5 0 0", "1.5 0 0.1"), False),
    "of another kind": (TWIN.replace('"revolute"', '"cylindrical"'), False),
    "between other links": (TWIN.replace('link="rocker"', 'link="ground"'), False),
}  # fmt: skip


@pytest.mark.parametrize("case", TWICE)
def test_a_loop_under_two_names_is_told(case: str, tmp_path: Path) -> None:
    text, same = TWICE[case]
    found = told(read(save(tmp_path, robot(LOOP, text, MOTOR))))
    assert [one.element for one in found if one.code == "same-loop"] == ["closure 'twin'"] * same


def test_hinges_of_other_formats_are_told(tmp_path: Path) -> None:
    needs("mjcf")
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia=".01 .01 .01"/>'
    text = mjcf(
        world=f'<body name="a"><joint name="a" axis="0 1 0"/>{inertial}<body name="b" pos="0 0 1">'
        f'<joint name="b" axis="1 0 0"/>{inertial}</body></body><body name="c" pos="1 0 0">'
        f'<joint name="c" axis="0 1 0"/>{inertial}<body name="d" pos="0 0 1"><joint name="d" axis="0 1 0"/>'
        f"{inertial}</body></body>"
    ).replace("</mujoco>", '<equality><weld body1="b" body2="d"/></equality></mujoco>')
    (found,) = told(read(save(tmp_path, text, "r.xml")))
    assert found.element == "joint 'b'"
