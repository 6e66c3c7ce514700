"""What a file states twice, with other numbers the second time, is read, refused or noted: none is lost."""

import copy
import re
from pathlib import Path

import pytest
from lxml import etree

from hybridyn.description import Description, read
from hybridyn.errors import ModelError
from tests.description import sdf_texts
from tests.description.test_bushings import BUSHING, FRAMES
from tests.description.test_engine_words import numbers
from tests.robots.robot_texts import INERTIAL, robot
from tests.support.files import save

ACTUATOR = (
    "<actuator name='m'><mechanicalReduction>50</mechanicalReduction><rotor_inertia>0.1</rotor_inertia>"
)
SPRING = "".join(
    f"<drake:linear_spring_damper_{word}/>" for word in (
        "body_A name='ground'", "p_AP value='0 2 0'", "body_B name='rocker'", "p_BQ value='1 0 0'",
        "free_length value='1.5'", "stiffness value='30'", "damping value='4'",
    )
)  # fmt: skip
#: A URDF with most of what is read.
URDF = robot(
    "<joint name='hold' type='fixed'><parent link='world'/><child link='ground'/></joint>"
    f"<link name='tool'>{INERTIAL}</link><joint name='grip' type='prismatic'><origin xyz='1 0 0'/>"
    "<parent link='rocker'/><child link='tool'/><axis xyz='0 0 1'/><limit lower='0' upper='1' effort='3' "
    "velocity='2'/><dynamics damping='0.5'/><rotor_inertia>0.3</rotor_inertia><gear_ratio>3</gear_ratio>"
    "</joint>"
    f"<link name='pad'>{INERTIAL}</link><joint name='slide' type='prismatic'><parent link='tool'/>"
    "<child link='pad'/><axis xyz='0 1 0'/><limit lower='0' upper='1' effort='3' velocity='2'/>"
    "<mimic joint='grip' multiplier='2' offset='0.1'/></joint>"
    f"<transmission name='t'><joint name='drive'/>{ACTUATOR}</actuator></transmission>"
    f"<drake:linear_spring_damper>{SPRING}</drake:linear_spring_damper>"
    "<gazebo reference='elbow'><springStiffness>5</springStiffness><springReference>0.5</springReference>"
    "</gazebo><gazebo><joint name='E' type='ball'><parent>coupler</parent><child>rocker</child>"
    "<pose>1 0 0 0 0 0</pose></joint></gazebo>",
    FRAMES, BUSHING,
)  # fmt: skip
TURNING = (
    "<limit><lower>-1</lower><upper>1</upper><effort>3</effort></limit><dynamics><damping>0.3</damping>"
    "<spring_stiffness>3</spring_stiffness><spring_reference>0.1</spring_reference></dynamics>"
)
SDF = sdf_texts.sdf(
    sdf_texts.link("base"), sdf_texts.WORLD, sdf_texts.link("a", "<pose>0.1 0.2 0 0 0 0</pose>"),
    sdf_texts.link("b", "<pose relative_to='a'>1 0 0 0 0 0</pose>", "<gravity>false</gravity>"),
    sdf_texts.link("c"),
    sdf_texts.joint(
        "j", "revolute", "base", "a", "<drake:rotor_inertia>0.1</drake:rotor_inertia><drake:gear_ratio>10"
        "</drake:gear_ratio><pose>0.1 0 0 0 0 0</pose>",
    ).replace("</xyz>", f"</xyz>{TURNING}"),
    sdf_texts.joint("k", "universal", "a", "b", "<axis2><xyz>0 1 0</xyz></axis2>", axis="1 0 0"),
    sdf_texts.joint("s", "screw", "base", "c", "<screw_thread_pitch>0.2</screw_thread_pitch>"),
    '<frame name="f" attached_to="a"><pose relative_to="b">0.1 0.2 0.3 0.4 0.5 0.6</pose></frame>',
    more=' xmlns:drake="http://drake.mit.edu"',
)  # fmt: skip
FILES = {"robot.urdf": URDF, "robot.sdf": SDF}
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+\.?\d*(?![\w.])")


def changed(element: etree._Element) -> etree._Element:
    """Return a copy of an element with other numbers in it; names stay."""
    out = copy.deepcopy(element)
    for one in out.iter():
        for word, value in one.attrib.items():
            if word != "name":
                one.attrib[word] = _other(value)
        one.text = _other(one.text) if one.text else one.text
    return out


def _other(text: str) -> str:
    return NUMBER.sub(lambda number: f"{1.25 * float(number[0]) + 0.125:g}", text)


def told(robot: Description) -> set[str]:
    """Return the notes without their places."""
    return {re.sub(r"\S*robot\.\w+(:\d+)?", "", note) for note in robot.notes}


def is_lost(plain: Description, file: Path, text: bytes) -> bool:
    """Return whether a file gives the same robot without a word."""
    try:
        found = read(save(file.parent, text, file.name))
    except ModelError:
        return False
    return numbers(found) == numbers(plain) and told(found) <= told(plain)


@pytest.mark.parametrize("name", FILES)
def test_what_is_stated_twice_is_not_lost(name: str, tmp_path: Path) -> None:
    text = FILES[name].encode()
    plain = read(save(tmp_path, text, name))
    lost = []
    for number, element in enumerate(etree.fromstring(text).iter()):
        other = changed(element)
        if number == 0 or etree.tostring(other, with_tail=False) == etree.tostring(element, with_tail=False):
            continue
        for before in (True, False):
            root = etree.fromstring(text)
            here = [*root.iter()][number]
            (here.addprevious if before else here.addnext)(changed(here))
            if is_lost(plain, tmp_path / name, etree.tostring(root)):
                lost.append((before, root.getroottree().getpath(here)))
    assert lost == []


def test_springs_in_several_blocks_are_put_together(tmp_path: Path) -> None:
    """The position without force may stand in another block than the stiffness."""
    block = "<gazebo reference='elbow'><spring{0}>{1}</spring{0}></gazebo>"
    found = read(save(tmp_path, robot(block.format("Reference", 0.3), block.format("Stiffness", 6))))
    (spring,) = found.springs
    assert (spring.name, spring.stiffness, spring.rest) == ("elbow", 6.0, 0.3)
