"""`hybridyn.check`: one wrong robot per finding, and sound robots without findings."""

import math
import sys
from pathlib import Path

import pytest
from lxml import etree

import hybridyn
from hybridyn.description.reading import open_robot
from hybridyn.errors import install_advice
from hybridyn.studies.check.check import CODES, Finding
from hybridyn.studies.check.masses import unit_guess
from tests import ROOT
from tests.robots.mjcf_texts import mjcf
from tests.robots.robot_texts import LOOP, TREE, robot, save
from tests.support.extras import needs

BALL = (
    '<inertial><mass value="2"/>'
    '<inertia ixx="0.02" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def link(name: str, inside: str = "") -> str:
    return f'<link name="{name}">{inside}</link>'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", inside: str = "", **limits: float
) -> str:
    stated = {"lower": -1, "upper": 1, "effort": 5, "velocity": 2} | limits
    limit = " ".join(f'{key}="{value}"' for key, value in stated.items())
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0 0"/><axis xyz="0 0 1"/><limit {limit}/>{inside}</joint>'
    )


def arm(*parts: str, kind: str = "revolute", inside: str = BALL, **limits: float) -> str:
    """Return a robot of one moving link, with other elements."""
    return (
        f'<robot name="arm">{link("base")}{link("arm", inside)}{joint("turn", "base", "arm", kind, **limits)}'
        + "".join(parts)
        + "</robot>"
    )


def inertial(mass: float, ixx: float, iyy: float, izz: float, com: str = "0 0 0") -> str:
    return (
        f'<inertial><origin xyz="{com}"/><mass value="{mass}"/>'
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def boxed(mass: float, inertia: float, size: str = "0.2 0.2 0.2", com: str = "0 0 0") -> str:
    shape = f'<visual><geometry><box size="{size}"/></geometry></visual>'
    return inertial(mass, inertia, inertia, inertia, com) + shape


def motors(*names: str) -> str:
    return "".join(
        f'<transmission name="t_{name}"><joint name="{name}"/><actuator name="m"/></transmission>'
        for name in names
    )


def four_bar(*names: str, loop: str = LOOP, tree: str = TREE) -> str:
    return f'<robot name="four_bar">{tree}{loop}{motors(*names)}</robot>'


ON_AXIS, BESIDE = (inertial(1, 1, 1, 1, com) for com in ("1 0 0", "1 0.1 0"))


def crank_and_slide(*names: str, rod: str = ON_AXIS) -> str:
    """Return a crank that pushes a slide by a rod with a ball at either end."""

    def joint(name: str, kind: str, parent: str, child: str, xyz: str, axis: str, rpy: str = "0 0 0") -> str:
        return (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            '<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'
        )

    return (
        '<robot name="r">' + link("ground") + link("crank", inertial(1, 1, 1, 1))
        + link("slide", inertial(1, 1, 1, 1)) + link("rod", rod)
        + '<link name="roll"/><link name="pitch"/>'
        + joint("drive", "revolute", "ground", "crank", "0 0 0", "0 1 0")
        + joint("rail", "prismatic", "ground", "slide", "2.2 0 0", "1 0 0")
        + joint("ball_x", "revolute", "crank", "roll", "0 0 0.5", "1 0 0", "0 0.2 0.1")
        + joint("ball_y", "revolute", "roll", "pitch", "0 0 0", "0 1 0")
        + joint("ball_z", "revolute", "pitch", "rod", "0 0 0", "0 0 1")
        + '<loop name="pin" type="spherical"><predecessor link="rod"><origin xyz="2 0 0"/></predecessor>'
        '<successor link="slide"/></loop>' + motors(*names) + "</robot>"
    )  # fmt: skip


ALPHA = math.acos(0.875)  # cosine rule with sides 2, 1.5, 1: crank and coupler, both 1 m, in line
BETA = math.atan2(2.0 * math.sin(ALPHA), 2.0 * math.cos(ALPHA) - 1.5)
DEAD = TREE.replace('rpy="0 0 0.4"', f'rpy="0 0 {ALPHA!r}"').replace(
    '<origin xyz="1.5 0 0"/><parent link="ground"/>',
    f'<origin xyz="1.5 0 0" rpy="0 0 {BETA!r}"/><parent link="ground"/>',
)
DEAD_LOOP = LOOP.replace("1.5 0 0", "1 0 0")
SLIDE = link("foot", BALL) + joint("height", "rocker", "foot", "prismatic").replace("0.3 0 0", "1 0 0")


def tilted(by: float) -> str:
    """Return the four-bar's tree with one axis tilted out of the plane."""
    elbow = '<origin xyz="1 0 0"/><parent link="crank"/>'
    return TREE.replace(elbow, elbow.replace("/>", f' rpy="{by} 0 0"/>', 1))


#: Cranks of 1 m stand upright on a base of 1.5 m.
UPRIGHT = (
    TREE.replace("0 0 0.4", f"0 0 {math.pi / 2!r}")
    .replace('<origin xyz="1 0 0"/><parent', f'<origin xyz="1 0 0" rpy="0 0 {-math.pi / 2!r}"/><parent')
    .replace('<origin xyz="1.5 0 0"/><parent', f'<origin xyz="1.5 0 0" rpy="0 0 {math.pi / 2!r}"/><parent')
)
FLAT = TREE.replace('rpy="0 0 0.4"', 'rpy="0 0 0"')  # base 1.5 + crank 1 = crank 1 + coupler 1.5: all in line
MESH = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
TWO_ARMS = link("other", BALL) + joint("follow", "arm", "other", inside='<mimic joint="turn" {}/>')
SIMILAR_HEXAGONS = (
    (ROOT / "urdf/gough_stewart.urdf.xacro")
    .read_text()
    .replace('platform_half_angle" default="48"', 'platform_half_angle" default="12"')
    .replace('filename="modules/', f'filename="{ROOT}/urdf/modules/')
)


WRONG: dict[str, tuple[str, str]] = {
    # code: (robot, element that must be named)
    "dropped": (arm('<gazebo reference="arm"><gravity>0</gravity></gazebo>'), ""),
    "reader": (arm(effort=-5), ""),
    "negative-inertia": (arm(inside=inertial(2, -0.02, 0.02, 0.02)), "link 'arm'"),
    "triangle-inequality": (arm(inside=inertial(2, 0.01, 0.01, 0.05)), "link 'arm'"),
    "inertia-without-mass": (arm(inside=inertial(0, 0.01, 0.01, 0.01)), "link 'arm'"),
    "missing-inertial": (
        arm(
            link("tip", BALL),
            joint("wrist", "arm", "tip"),
            inside='<visual><geometry><sphere radius="0.1"/></geometry></visual>',
        ),
        "link 'arm'",
    ),
    "massless-robot": (arm(inside=""), "link 'arm'"),
    "lost-loops": (arm(link("tip", BALL), joint("wrist", "arm", "tip", effort=0)), "joint 'wrist'"),
    "massless-motion": (crank_and_slide("drive", rod=inertial(1, 0, 0, 0, "1 0 0")), "module "),
    "com-outside": (arm(inside=boxed(2, 0.02, com="0 1 0")), "link 'arm'"),
    "inertia-too-large": (arm(inside=boxed(2, 20_000.0)), "link 'arm'"),
    "inertia-too-small": (arm(inside=boxed(2, 1e-9)), "link 'arm'"),
    "too-dense": (arm(inside=boxed(500, 2.0)), "link 'arm'"),
    "no-mass": (
        four_bar("drive", tree=UPRIGHT, loop=LOOP + link("wheel") + joint("axle", "coupler", "wheel")),
        "module 'wheel'",
    ),
    "millimetres": (arm().replace('xyz="0.3 0 0"', 'xyz="300 0 0"'), "joint 'turn'"),
    "mesh-scale": (arm(inside=BALL + MESH.format("part.stl")), "link 'arm'"),
    "degrees": (arm(lower=-180, upper=180), "joint 'turn'"),
    "broken-shape": (
        arm(inside=BALL + boxed(1, 0.1, size="0.2 0.2").partition("</inertial>")[2]),
        "link 'arm'",
    ),
    "missing-mesh": (arm(inside=BALL + MESH.format("package://nowhere/part.stl")), "link 'arm'"),
    "broken-mesh": (arm(inside=BALL + MESH.format("broken.stl")), "link 'arm'"),
    "unread-meshes": (arm(inside=BALL + MESH.format("part.stl")), ""),
    "limits-crossed": (arm(lower=1, upper=-1), "joint 'turn'"),
    "limits-zero": (arm(effort=0), "joint 'turn'"),
    "home-outside-limits": (arm(lower=0.5, upper=1), "joint 'turn'"),
    "mimic-motor": (arm(TWO_ARMS.format(""), motors("turn", "follow")), "joint 'follow'"),
    "loops-close-nowhere": (four_bar("drive", loop=LOOP.replace("1.5 0 0", "9 0 0")), "module "),
    "rank-in-doubt": (four_bar("drive", tree=tilted(3e-3)), "'rocker'"),
    "no-robot": (
        arm(
            link("frame"),
            joint("weld", "base", "frame", "fixed"),
            LOOP.replace("coupler", "base").replace("rocker", "frame"),
        ),
        "'pin'",
    ),
    "open-at-home": (
        four_bar("drive", tree=UPRIGHT, loop=LOOP.replace("1.5 0 0", "1.2 0 0")),
        "module ",
    ),
    "axis-across": (
        four_bar("drive", tree=UPRIGHT, loop=LOOP.replace('<axis xyz="0 0 1"/>', "")),
        "closure 'pin'",
    ),
    "same-loop": (
        four_bar("drive", tree=UPRIGHT, loop=LOOP + LOOP.replace('"pin"', '"twin"')),
        "closure 'twin'",
    ),
    "locked": (
        four_bar("drive", loop=LOOP.replace('"revolute"', '"fixed"').replace('rpy="0 0 0"', 'rpy="0 0 1"')),
        "module ",
    ),
    "rounded": (four_bar("drive", tree=tilted(1e-6)), "module "),
    "no-motors": (arm().replace("</robot>", motors("fixed") + "</robot>"), ""),
    "motor-cannot-move": (
        four_bar(
            "drive",
            "height",
            loop=SLIDE + LOOP.replace('link="rocker"><origin xyz="1 0 0"', 'link="foot"><origin xyz="0 0 0"'),
        ),
        "joint 'height'",
    ),
    "motors-missing": (crank_and_slide("drive", rod=BESIDE), "module "),
    "motors-opposed": (
        crank_and_slide("drive", "rail", rod=BESIDE)
        .replace('<predecessor link="rod">', '<predecessor link="tip">')
        .replace(
            "<loop",
            link("tip", BESIDE)
            + '<joint name="swivel" type="continuous"><parent link="rod"/><child link="tip"/></joint><loop',
        ),
        "module ",
    ),
    "architectural": (SIMILAR_HEXAGONS, "module "),
    "singular-closures": (four_bar("drive", tree=FLAT), "module "),
    "singular-parallel": (four_bar("swing", tree=DEAD, loop=DEAD_LOOP), "module "),
    "unreadable": ("<robot name='a'>", ""),
}

#: What some of them say.
WORDS = {
    "open-at-home": "its loops are open by 0.15 of its size (2 m) at the home posture",
    "singular-closures": "its closures lose rank at the home posture",
    "singular-parallel": "can still move at the home posture when its motors are locked",
    "no-mass": "none of its bodies has mass",
}
OPTIONS = {"rank-in-doubt": {"closure_tolerance": 1e-2}}


def found(tmp_path: Path, text: str, **options: object) -> list[Finding]:
    (tmp_path / "broken.stl").write_bytes(b"this is no mesh")
    corners = "0 0 0", "900 0 0", "0 900 0"
    vertices = "".join(f"vertex {corner}\n" for corner in corners)
    facet = f"facet normal 0 0 1\nouter loop\n{vertices}endloop\nendfacet\n"
    (tmp_path / "part.stl").write_text(f"solid part\n{facet}endsolid part\n")
    return hybridyn.check(save(tmp_path, text, "wrong.xacro" if "xacro" in text else "wrong.urdf"), **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("code", CODES)
def test_finding(code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text, element = WRONG[code]
    if code in ("mesh-scale", "broken-mesh"):
        needs("view", "trimesh")
    if code == "unread-meshes":
        monkeypatch.setitem(sys.modules, "trimesh", None)
    findings = found(tmp_path, text, **OPTIONS.get(code, {}))
    (finding, *_) = [finding for finding in findings if finding.code == code]
    assert finding.element.startswith(element)
    assert WORDS.get(code, "") in finding.message
    assert finding.severity == CODES[code][0]
    assert finding.file is not None
    assert finding.why
    assert finding.mend
    if element:
        assert finding.line is not None


SOUND = {
    "arm": arm(inside=boxed(2, 0.02)),
    "mimic": arm(TWO_ARMS.format('multiplier="-1"')),
    "a motor on the joint that follows": arm(TWO_ARMS.format('multiplier="50"'), motors("follow")),
    "slide": arm(kind="prismatic"),
    "meshes left alone": arm(inside=BALL + MESH.format("broken.stl")),
    "four-bar": four_bar("drive", tree=UPRIGHT, loop=LOOP),
    "redundant motors": four_bar("drive", "elbow", tree=UPRIGHT, loop=LOOP),
    "four-bar at a dead centre": four_bar("drive", tree=DEAD, loop=DEAD_LOOP),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_robot_has_no_findings(name: str, tmp_path: Path) -> None:
    """At a dead centre, the crank drives the four-bar."""
    assert found(tmp_path, SOUND[name], meshes="left alone" not in name) == []


#: A differential as MuJoCo's tendons state it: two motors turn pitch and roll together.
DIFFERENTIAL = mjcf(
    *(
        f'<tendon><fixed name="{end}"><joint joint="{end}" coef="1"/><joint joint="pitch" coef="-1"/>'
        f'<joint joint="roll" coef="{sign}"/></fixed></tendon><equality><tendon tendon1="{end}"/></equality>'
        f'<actuator><motor joint="{end}"/></actuator>'
        for end, sign in (("m", -1), ("n", 1))
    ),
    world='<body name="m"><joint name="m"/><geom size=".02" mass=".1"/></body>'
    '<body name="n"><joint name="n"/><geom size=".02" mass=".1"/></body>'
    '<body name="a"><joint name="pitch" axis="0 1 0"/><geom size=".1" pos=".2 0 0" mass="1"/>'
    '<body name="b"><joint name="roll" axis="1 0 0"/><geom size=".1" pos="0 .2 0" mass="1"/></body></body>',
)


def test_motors_of_a_differential_follow_no_other_motor(tmp_path: Path) -> None:
    needs("mjcf")
    path = save(tmp_path, DIFFERENTIAL, "differential.xml")
    assert "mimic-motor" not in {finding.code for finding in hybridyn.check(path)}
    assert "mimic-motor" in {finding.code for finding in hybridyn.check(path, motors=["m", "pitch", "roll"])}


def test_the_worst_comes_first(tmp_path: Path) -> None:
    text = arm(inside=inertial(2, -1, 1, 1), effort=0, velocity=-5)
    severities = [finding.severity for finding in found(tmp_path, text)]
    assert severities == ["error", "warning", "note"]


def test_a_line_is_that_of_the_element(tmp_path: Path) -> None:
    text = "\n".join(
        [
            '<robot name="arm">',
            '<link name="base"/>',
            f'<link name="arm">{boxed(500, 2.0)}</link>',
            joint("turn", "base", "arm", lower=3, upper=4),
            "</robot>",
        ]
    )
    assert [(f.code, f.line) for f in found(tmp_path, text)] == [("too-dense", 3), ("home-outside-limits", 4)]


def test_of_xacro_the_line_is_that_of_the_macro(tmp_path: Path) -> None:
    """The line of the link `name="${side}_arm"` is that in the included file."""
    (tmp_path / "part.xacro").write_text(
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
        '<xacro:macro name="part" params="side">\n'
        f'<link name="${{side}}_arm">{boxed(500, 2.0)}</link>\n'
        + joint("${side}_turn", "base", "${side}_arm")
        + "\n</xacro:macro></robot>"
    )
    path = save(
        tmp_path,
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
        '<xacro:include filename="part.xacro"/>\n'
        '<link name="base"/>\n<xacro:part side="left"/>\n</robot>',
        "r.urdf.xacro",
    )
    (finding,) = hybridyn.check(path)
    assert finding.code == "too-dense"
    assert Path(str(finding.file)).name == "part.xacro"
    assert finding.line == 3


def test_equal_modules_are_reported_once() -> None:
    """The third and the fourth module of the LX4 are equal to the second."""
    missing = [f for f in hybridyn.check("lx4", motors=["m1_leg1_slide"]) if f.code == "motors-missing"]
    assert [finding.element for finding in missing] == [f"module 'm{k}_platform'" for k in (1, 2)]


@pytest.mark.parametrize(
    ("ratio", "unit"),
    [(1.2e3 * 0.3, "kg mm^2"), (3.2e4 * 0.3, "g mm^2"), (1e2 * 0.3, "kg cm^2"), (3, "about a point")],
)
def test_the_unit_of_an_inertia_is_guessed(ratio: float, unit: str) -> None:
    """A radius of gyration grows with the root of the inertia; 0.3 of the shape's size is usual."""
    assert unit in unit_guess(ratio)


BOX = '<geometry><box size="1 1 1"/></geometry>'
CONE = '<visual><geometry>\n<cone radius="1"/></geometry></visual>'
SCALED = MESH.format("part.stl").replace("<mesh", '\n<mesh scale="0.001,0.001,0.001"')
PAINTED = MESH.format("nowhere.stl").replace("</visual>", 2 * '<material name="red"/>' + "</visual>")
TWICE = (
    '<xacro:macro name="m" params="n"><link name="l${n}">' + BALL + "<visual><geometry/></visual></link>"
    + joint("j${n}", "arm", "l${n}", "fixed") + '</xacro:macro><xacro:m n="a"/><xacro:m n="b"/>'
)  # fmt: skip
WRITTEN = arm(TWICE).replace("<robot", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"')

#: Files of one finding: its code, its line, and words of its element, message and mend.
ALONE: list[tuple[str, str, int | None, str]] = [
    ("", "unreadable", None, ""),
    ("<robot", "unreadable", 1, ""),
    (arm().replace('mass value="2"', 'mass value="1,5"'), "unreadable", 1, ""),
    ("<robot name='r'>\n<link name='a'/>\n<joint name='j' type='wobbly'/></robot>", "unreadable", 3, ""),
    (robot('<weld link1="crank" link2="rocker"/>'), "unreadable", 19, ""),
    ("<mujoco/>", "unreadable", 1, ""),
    (arm(link("arm")), "unreadable", 1, "link 'arm' is stated twice (first in line 1); rename one"),
    # a cube of 2 kg and 0.2 m: m a^2 / 6 = 0.0133 kg m^2 = 1.33e7 g mm^2
    (arm(inside=boxed(2, 0.2**2 * 2 / 6 * 1e9)), "inertia-too-large", 1, "g mm^2"),
    (arm(inside=BALL + CONE), "broken-shape", 2, "<cone>: not read as a shape; write a box"),
    (arm(inside=BALL + SCALED), "broken-shape", 2, "<mesh>: attribute 'scale' has 1 numbers instead of 3"),
    (arm(inside=BALL + PAINTED), "missing-mesh", 1, ""),  # its materials hide no shape
    (WRITTEN, "broken-shape", 1, "link 'la'"),
    # the first of two joints of a wrist has its mass on the next one
    (
        arm(link("hand", BALL), joint("roll", "arm", "hand").replace("0 0 1", "0 1 0"), inside=""),
        "missing-inertial",
        1,
        "link 'arm'",
    ),
    *(
        (
            arm(inside=f"{BALL}\n<{role}>{inside}</{role}>"),
            "broken-shape",
            2,
            f"its {role} shape cannot be read: {wrong.format(role=role)}",
        )
        for role in ("visual", "collision")
        for inside, wrong in (
            (f'<origin xyz="0 0"/>\n{BOX}', "<origin>: attribute 'xyz' has 2 numbers instead of 3"),
            (f'<origin rpy="0 0 x"/>\n{BOX}', "<origin>: rpy 'x' is not a finite number"),
            (f"<origin/><origin/>\n{BOX}", "<origin>: stated twice in <{role}>; keep one"),
        )
    ),
]


@pytest.mark.parametrize(("text", "code", "line", "words"), ALONE)
def test_a_file_with_one_finding(text: str, code: str, line: int | None, words: str, tmp_path: Path) -> None:
    if "mujoco" in text:
        needs("mjcf")
    (finding,) = found(tmp_path, text)
    file = tmp_path / ("wrong.xacro" if "xacro" in text else "wrong.urdf")
    assert (finding.code, finding.file, finding.line) == (code, str(file), line)
    assert words in f"{finding.element} {finding.message} {finding.mend}"
    assert str(tmp_path) not in finding.message


LEG = """<mujoco model="leg">
  <compiler meshdir="meshes"/>
  <asset><mesh name="shell" file="shell.stl"/><mesh name="sole" file="sole.stl"/></asset>
  <worldbody>
    <body name="thigh">
      <inertial pos="0 0 -0.1" mass="1.2" diaginertia="0.01 0.01 0.002"/>
      <joint name="hip" axis="0 1 0" range="-60 60"/>
      <geom type="mesh" mesh="shell"/>
      <body name="shin" pos="0 0 -0.25">
        <inertial pos="0 0 -0.1" mass="0.6" diaginertia="0.004 0.004 0.001"/>
        <joint name="knee" axis="0 1 0" range="90 -90"/>
        <geom type="mesh" mesh="sole"/>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="h" joint="hip"/><motor name="k" joint="knee"/></actuator>
</mujoco>
"""

SDF_LEG = """<sdf version="1.9"><model name="leg">
  <link name="thigh">
    <inertial><mass>1</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial>
    <visual name="seen"><geometry><mesh><uri>meshes/shell.stl</uri></mesh></geometry></visual>
  </link>
  <link name="shin">
    <pose>0 0 -0.25 0 0 0</pose>
    <inertial><mass>1</mass><inertia><ixx>.01</ixx><iyy>.01</iyy><izz>.01</izz></inertia></inertial>
    <collision name="hit"><geometry><mesh>
      <uri>model://leg/meshes/sole.stl</uri></mesh></geometry></collision>
  </link>
  <joint name="hip" type="revolute">
    <parent>world</parent><child>thigh</child><axis><xyz>0 1 0</xyz></axis></joint>
  <joint name="knee" type="revolute"><parent>thigh</parent><child>shin</child>
    <axis><xyz>0 1 0</xyz><limit><lower>1.5</lower><upper>-1.5</upper></limit></axis>
  </joint>
</model></sdf>
"""


@pytest.mark.parametrize(
    ("name", "text", "places"),
    [
        ("leg.xml", LEG, {"limits-crossed": ("joint 'knee'", 11)}),
        ("leg.sdf", SDF_LEG, {"limits-crossed": ("joint 'knee'", 14)}),
    ],
)
def test_files_of_other_formats_are_checked(
    name: str, text: str, places: dict[str, tuple[str, int]], tmp_path: Path
) -> None:
    if name.endswith(".xml"):
        needs("mjcf")
    findings = hybridyn.check(save(tmp_path, text, name))
    assert {f.code: (f.element, f.line) for f in findings if f.severity != "note"} == places


def test_meshes_that_cannot_be_read_here_are_one_note(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without trimesh; a file that is not there is still missing."""
    monkeypatch.setitem(sys.modules, "trimesh", None)
    meshes = ("part.stl", "part.stl", "broken.stl", "nowhere.stl")
    findings = found(tmp_path, arm(inside=boxed(2, 0.02) + "".join(map(MESH.format, meshes))))
    assert [finding.code for finding in findings] == ["missing-mesh", "unread-meshes"]
    assert "2 mesh files not read: trimesh" in findings[1].message
    assert findings[1].mend == install_advice("view")


def test_a_file_that_is_not_there() -> None:
    (finding,) = hybridyn.check("nowhere.urdf")
    assert finding.code == "unreadable"
    (finding,) = hybridyn.check("fivebar")
    assert "did you mean 'five_bar'" in finding.message


@pytest.mark.parametrize(
    ("name", "link", "alike"), [("gough_stewart", "m1_leg6_rod", 4), ("tanev", "m2_leg3_rod", 2)]
)
def test_one_of_several_equal_closures_that_is_missing_is_a_finding(
    tmp_path: Path, name: str, link: str, alike: int
) -> None:
    root = open_robot(str(ROOT / f"urdf/{name}.urdf.xacro"), {}, ()).xml
    path = tmp_path / "robot.urdf"

    def found() -> list[Finding]:
        path.write_bytes(etree.tostring(root))
        return [one for one in hybridyn.check(path) if one.code == "lost-loops"]

    assert found() == []
    loop = root.findall("loop")[-1]
    loop.getparent().remove(loop)
    (one,) = found()
    assert one.element == f"link '{link}'"
    assert f"(revolute, revolute, prismatic) like those that {alike} closures close" in one.message
