"""No mutation of an SDF file ends in a traceback, a hang or a robot that lost a link, a joint or a coupling.

Each mutated file is read, or refused with a `ModelError` of one line. A robot that is read has every link and
joint that stands in its files, and the masses.
"""

import random
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from hybridyn.description import Description
from tests.description.reading import finite, mutated, outcome
from tests.files import save
from tests.mutations import TREE
from tests.samples import slow
from tests.sdf_texts import WORLD, joint, link, sdf

CASES = 40  # per seed

AXIS = (
    '<axis><xyz expressed_in="__model__">0 1 0</xyz><limit><lower>-1</lower><upper>2.5</upper>'
    "<effort>7</effort><velocity>3</velocity></limit><dynamics><damping>0.1</damping><friction>0.2</friction><spring_stiffness>5"
    "</spring_stiffness><spring_reference>0.3</spring_reference></dynamics>{}</axis>"
)
OLD_AXIS = AXIS.replace(' expressed_in="__model__"', "").format("")
MIMIC = '<mimic joint="turn" axis="axis"><multiplier>2</multiplier><offset>0.1</offset></mimic>'
ARM = sdf(link("arm"), '<frame name="tip"><pose>0.3 0 0 0 0 0.5</pose></frame>', name="part")
MODEL = [
    link("base"), WORLD,
    link("a", '<pose degrees="true">0.1 0 0.2 10 20 30</pose><visual name="v"><geometry/></visual>'),
    link("b", '<pose relative_to="a">0.4 0 0 0 0 0</pose>'),
    link("c", '<pose relative_to="tilted">0 0.3 0 0 0 0</pose>', x=0.2, m=2),
    link("d", '<pose rotation_format="quat_xyzw">0.5 0.2 0.1 0 0 0.6 0.8</pose>', m=0.5),
    '<frame name="tilted" attached_to="a"><pose>0 0 0.1 0 0.2 0</pose></frame>',
    joint("turn", "revolute", "base", "a", AXIS.format(""), axis=""),
    joint("slide", "prismatic", "a", "b", AXIS.format(""), "<pose>0.1 0 0 0 0 0</pose>", axis=""),
    joint("cross", "universal", "tilted", "c", "<axis2><xyz>1 0 0</xyz></axis2>", axis="0 1 0"),
    joint("follow", "continuous", "base", "d", AXIS.format(MIMIC), axis=""),
    joint("loop", "ball", "b", "d", axis=""),
    '<include><uri>part.sdf</uri><name>hand</name><pose relative_to="b">0.1 0 0 0 0 0</pose></include>',
    joint("wrist", "revolute2", "b", "hand::tip", "<axis2><xyz>0 1 0</xyz></axis2>"),
    '<model name="tool"><pose>1 0 0 0 0 0</pose>' + link("bit") + "</model>",
    joint("grip", "fixed", "hand::arm", "tool::bit", axis=""),
    '<plugin name="p" filename="p.so"><joint_name>turn</joint_name></plugin>',
]  # fmt: skip
LOOPS = [
    link("base"), link("p"), link("q"), link("r"), link("s"),
    joint("first", "revolute", "base", "p", axis="0 1 0"),
    joint("second", "revolute", "base", "q", OLD_AXIS, axis=""),
    joint("both", "revolute2", "q", "r", "<axis2><xyz>1 0 0</xyz></axis2>", "<pose>0 .1 0 0 0 0</pose>"),
    joint("rail", "prismatic", "r", "s", OLD_AXIS, axis=""),
    joint("close", "revolute", "p", "s", OLD_AXIS, axis=""),
    joint("hinge", "revolute", "r", "p", "<axis><xyz>0 1 0</xyz></axis>", axis=""),
]  # fmt: skip
TEXTS = (
    sdf(*MODEL),
    sdf(*LOOPS, version="1.6"),
    sdf(*LOOPS, version="1.4").replace("<model", '<world name="w"><gravity>0 0 -9</gravity><model', 1)
    .replace("</model>", '</model><model name="ground"><static>1</static></model></world>'),
)  # fmt: skip


def check(found: Description, text: bytes) -> None:
    """Compare a robot with the names and masses that stand in its text."""
    root = etree.fromstring(text)
    links = [node.get("name").strip() for node in root.iter("link")]
    joints = [node for node in root.iter("joint") if node.find("parent") is not None]
    names = {link.name.rpartition("::")[2] for link in found.links}
    known = {joint.name for joint in found.joints} | {closure.name for closure in found.closures}
    parts = {name.rpartition("::")[2] for name in known}
    if len(root.findall("model")) == 1:  # else the other model is static, and said to be left out
        assert set(links) <= names, text
        for node in joints:
            name = node.get("name").strip()
            ground = node.find("parent").text.strip() == "world" and found.root != "world"
            assert name in parts or f"{name}_1" in parts or f"{name}_closure" in parts or ground, text
        assert len(found.couplings) == sum(1 for _ in root.iter("mimic")), text
    for one in found.joints:
        assert abs(np.linalg.norm(one.axis) - 1) < 1e-12, text


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "part.sdf").write_text(ARM)
    return tmp_path


@pytest.mark.parametrize(("text", "loops", "couplings"), [*zip(TEXTS, (1, 2, 2), (1, 0, 0), strict=True)])
def test_the_files_are_good_as_they_stand(folder: Path, text: str, loops: int, couplings: int) -> None:
    found = outcome(save(folder, text, "r.sdf"), text.encode())
    assert found is not None
    assert (len(found.closures), len(found.couplings)) == (loops, couplings)
    check(found, text.encode())
    finite(found, text)


@pytest.mark.parametrize("seed", [0, *(slow(seed) for seed in range(1, 30))])
def test_mutations(folder: Path, seed: int) -> None:
    draw = random.Random(seed)
    mutated(folder / "r.sdf", lambda: draw.choice(TREE)(draw.choice(TEXTS), draw), CASES, check)
