"""What the SDF reader refuses: one line with file, line, element and the mend."""

from pathlib import Path

import pytest

from tests.description.reading import bound, refused
from tests.description.sdf_texts import WORLD, joint, link, sdf
from tests.support.files import save

BODIES = (link("base"), link("a"), link("b"), WORLD)
QUATERNION = 'rotation_format="quat_xyzw"'
HINGE = joint("j", "revolute", "base", "a")
ROTOR = '<drake:rotor_inertia xmlns:drake="http://drake.mit.edu">0.5</drake:rotor_inertia>'
ABOUT_X = "<axis2><xyz>1 0 0</xyz></axis2>"
REFERENCE = "<gearbox_reference_body>base</gearbox_reference_body>"
AUTO = (
    '<link name="c"><inertial auto="true">{}</inertial><collision name="s"><geometry>{}</geometry>'
    "</collision></link>"
)
SPHERE = "<sphere><radius>1</radius></sphere>"
#: What is refused in a model, and what is told.
PARTS = [
    (joint("j", "piston", "base", "a"), "type 'piston' is not read; write a revolute and a"),
    (joint("j", "revolut", "base", "a"), "unknown joint type 'revolut' (did you mean 'revolute'?)"),
    (joint("j", "revolute", "base", "a", axis=""), "<axis> is missing; a revolute joint has 1"),
    (joint("j", "universal", "base", "a"), "<axis2> is missing; a universal joint has 2"),
    (joint("j", "revolute", "base", "a", axis="0 0 0"), "the axis is zero"),
    (joint("j", "revolute", "base", "c"), "unknown frame 'c'; known: 'base', 'a', 'b'"),
    (joint("j", "revolute", "base", ""), "unknown frame ''; known"),
    (joint("j", "revolute", "a", "a"), "joins link 'a' to itself"),
    (joint("j", "universal", "base", "a", "<axis2><xyz>0 1 1</xyz></axis2>"), "or write revolute2"),
    *(
        (
            joint("j", kind, "base", "a", more + ROTOR, axis=axis),
            f"does not say which axis of a {kind} joint the rotor turns",
        )
        for kind, more, axis in (
            ("universal", "<axis2><xyz>1 0 0</xyz></axis2>", "0 1 0"),
            ("ball", "", ""),
        )
    ),
    (joint("j", "screw", "base", "a", "<thread_pitch>0</thread_pitch>"), "slides without turning"),
    (joint("j", "gearbox", "a", "b", ABOUT_X), "<gearbox_reference_body> is missing"),
    (joint("j", "gearbox", "a", "b", ABOUT_X + REFERENCE), "joint 'a_free' is between the reference body"),
    (
        joint("h", "revolute", "base", "a") + joint("g", "gearbox", "a", "b", ABOUT_X + REFERENCE)
        + joint("k", "revolute", "base", "b", axis="1 0 1"),
        "joint 'k' is between the reference body and a link of the gearbox and does not turn",
    ),
    (f'<model name="in" placement_frame="d">{link("c")}</model>', "unknown frame 'd'; known: 'c'"),
    (f'<model name="in" canonical_link="d">{link("c")}</model>', "unknown frame 'd'; known: 'c'"),
    (link("c", '<pose relative_to="world"/>'), "do not know the frame of the world, as in sdformat"),
    ('<frame name="f" attached_to="world"/>', "do not know the frame of the world, as in sdformat"),
    (joint("j", "revolute", "base", "a", "<pose>1 2 3</pose>"), "text has 3 numbers instead of 6"),
    (joint("j", "revolute", "base", "a", '<pose relative_to="j">1 2 3 0 0 0</pose>'), "in a circle: 'j'"),
    (joint("j", "ball", "base", "a", "<axis><mimic joint='j'/></axis>", axis=""), "<mimic> in an axis"),
    (
        joint("j", "fixed", "base", "a", f"<pose {QUATERNION}>0 0 0 0 0 0 2</pose>", axis=""),
        "its quaternion has length 2",
    ),
    (joint("j", "revolute", "base", "a", "<damping>1</damping>"), "unknown in <joint name=\"j\">"),
    (joint("j", "revolute", "base", "a", "<axiss/>"), "did you mean 'axis'?"),
    (
        joint(
            "j", "revolute", "base", "a",
            "<axis><xyz>0 0 1</xyz><use_parent_model_frame>1</use_parent_model_frame></axis>", axis="",
        ),
        'write <xyz expressed_in="__model__">',
    ),
    (
        joint("j", "revolute", "base", "a", "<axis><xyz>0 0 1</xyz><mimic joint='k'/></axis>", axis=""),
        "unknown joint 'k'",
    ),
    (
        joint("j", "revolute", "base", "a", "<axis><xyz>0 0 1</xyz><mimic joint='j'/></axis>", axis=""),
        "a joint cannot follow itself",
    ),
    (HINGE + HINGE, "is stated twice (first in line"),
    (link("c", "<kinematic>1</kinematic>"), "a program moves a kinematic link"),
    (link("c", "<velocity_decay><linear>.1</linear></velocity_decay>"), "put damping on joints"),
    ('<link name="c"><inertial auto="true"/></link>', "from <collision>s, and the link has none"),
    (AUTO.format("", "<mesh><uri>a.stl</uri></mesh>"), "computes no inertia of <mesh>; write <mass>"),
    (AUTO.format("", "<plane/>"), 'auto="true" computes no inertia of <plane>'),
    (AUTO.format("", ""), "0 shapes; a collision has one"),
    (AUTO.format("", "<sphere/>"), "<radius> is missing"),
    (AUTO.format("", "<box><size>1 0 1</size></box>"), "0 is no size; it must be above 0"),
    (AUTO.format("<density>-2</density>", SPHERE), "-2 is not above 0"),
    (AUTO.format("<mass>0</mass>", SPHERE), "0 is not above 0"),
    (AUTO.format("<pose>1 0 0 0 0 0</pose>", SPHERE), '<pose> beside auto="true", which computes it'),
    (AUTO.format("<inertia/>", SPHERE), '<inertia> beside auto="true", which computes it'),
    ('<frame name="world"/>', "the name 'world' is SDFormat's own; rename it"),
    ('<link name="c"><inertial><mass>-1</mass></inertial></link>', "negative mass"),
    (link("c", '<pose frame="a">0 0 0 0 0 0</pose>'), "frame ended with SDFormat 1.6; write relative_to"),
    (link("c", '<pose relative_to="aa">0 0 0 0 0 0</pose>'), "unknown frame 'aa'"),
    (link("__c__"), "the name '__c__' is SDFormat's own"),
    (link("c", "<colision/>"), "did you mean 'collision'?"),
    (link("c", HINGE), "unknown in <link name=\"c\">"),
    (f"<gazebo>{HINGE}</gazebo>", "is not read inside <gazebo>"),
    (link("c", f"<visual name='v'>{HINGE}</visual>"), "is not read inside <visual>"),
    (f"<plugin name='p'>{HINGE}</plugin>", "is not read inside <plugin>"),
    (link("j") + HINGE + '<frame name="f" attached_to="j"/>', "'j' is the name of a link and a joint"),
    ('<frame name="f" attached_to="g"/><frame name="g" attached_to="f"/>', "in a circle"),
    ("<static>true</static>", "nor do its joints"),
    (f'<model name="in"><static>1</static>{link("c")}</model>', "a static model inside another"),
    ("<include><uri>none.sdf</uri></include>", "'none.sdf' cannot be read: No such file"),
    ("<include><uri>https://x.org/a</uri></include>", "is not a local file"),
    ("<include><uri>../../etc/a.sdf</uri></include>", "outside the robot's folders"),
    ("<include><uri>robot.sdf</uri></include>", "includes itself"),
    ("<include><uri>model://none</uri></include>", "model 'none' is not found"),
    ("<include/>", "<uri> is missing"),
    ("<include><uri>part.sdf</uri></include>", "the root element of 'part.sdf' is <robot>"),
    ("<drake:distance_constraint xmlns:drake='http://drake.mit.edu'/>", "not read in SDF"),
    ("<drake:linear_bushing_rpy xmlns:drake='http://drake.mit.edu'/>", "<drake:bushing_frameA> is missing"),
    ("<hybridyn:motor xmlns:hybridyn='urn:hybridyn'/>", "unknown in <model"),
]  # fmt: skip
#: Texts of files that are refused.
TEXTS = [
    (sdf(*BODIES, version="1.2"), "`gz sdf -p` converts older"),
    (sdf(*BODIES, version="1.13"), "is not read; known: 1.3 to 1.12"),
    (sdf(*BODIES, version="new"), "version 'new'"),
    (sdf(*BODIES).replace(' version="1.9"', ""), "attribute 'version' is missing"),
    ('<sdf version="1.9"/>', "no <model>"),
    ('<sdf version="1.9"><model name="m"/></sdf>', "the model has no <link>"),
    (
        sdf(*BODIES).replace("</sdf>", f'<model name="two">{link("c")}</model></sdf>'),
        "2 models that move: 'robot', 'two'; hybridyn reads one robot",
    ),
    ('<sdf version="1.9"><world name="a"/><world name="b"/></sdf>', "stated twice in <sdf>; keep one"),
    (f'<sdf version="1.9"><world name="a">{link("c")}</world></sdf>', "unknown in <world"),
    (
        '<sdf version="1.9"><world name="a"><include merge="1"><uri>two.sdf</uri></include></world></sdf>',
        "links do not stand in a <world>; remove merge",
    ),
    (
        sdf(*(f'<model name="m{n}">' for n in range(60)), link("c"), *["</model>"] * 60),
        "nested more than 50 deep",
    ),
]


@pytest.mark.parametrize(
    ("text", "message"), [*((sdf(*BODIES, part), message) for part, message in PARTS), *TEXTS]
)
def test_it_is_refused_by_name(text: str, message: str, tmp_path: Path) -> None:
    """With the file that the words are about."""
    save(tmp_path, "<robot/>", "part.sdf")
    save(tmp_path, sdf(link("c")), "two.sdf")
    error = refused(save(tmp_path, text, "robot.sdf"), message)
    assert any(name in str(error) for name in ("robot.sdf", "part.sdf", "two.sdf"))


def test_many_includes_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten files that each include the next ten times would be ten thousand million models."""
    bound(monkeypatch, files=50)
    for n in range(9):
        parts = [f"<include><uri>p{n + 1}.sdf</uri><name>i{k}</name></include>" for k in range(10)]
        (tmp_path / f"p{n}.sdf").write_text(sdf(*parts, name=f"p{n}"))
    (tmp_path / "p9.sdf").write_text(sdf(link("c"), name="p9"))
    refused(tmp_path / "p0.sdf", "more than 50 files")
