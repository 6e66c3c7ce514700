"""What hybridyn cannot say of an MJCF file is refused by name; its files stay in the robot's folders."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import hybridyn
from hybridyn.description import read
from tests.description.reading import Texts, holds, refused, save_all
from tests.robots.mjcf_texts import BAR, HEAD, loops, mjcf
from tests.robots.robot_texts import line_of
from tests.support.extras import needs
from tests.support.files import save

mujoco = needs("mjcf")

BALL = '<body name="a"><joint name="j" type="ball" {}/>' + BAR.format(x=0.1, m=1) + "</body>"
HINGE = '<body name="a" {1}><joint name="j" {0}/>' + BAR.format(x=0.1, m=1) + '<site name="s"/></body>'
TENDON = '<tendon><fixed name="t" {}><joint joint="j" coef="1"/></fixed></tendon>'
CABLE = '<tendon><spatial name="t"><site site="s"/><site site="g"/></spatial></tendon>'
GROUND = '<site name="g" pos="0 0 2"/>'


def hinge(joint: str = "", body: str = "") -> str:
    return GROUND + HINGE.format(joint, body)


MOCAP = '<body name="m" mocap="true"/>'
MANY = '<replicate count="1000">'

LINK = '<body name="{0}"><joint name="j{0}"/>' + BAR.format(x=0.1, m=1) + "{1}</body>"
PART = "<mujocoinclude>\n\n{}\n</mujocoinclude>"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SHAPE = '<body name="a"><joint name="j"/><geom type="mesh" mesh="part"/>{}</body>'
ASSET = '<asset><mesh name="part" file="part.obj"/></asset>'


def meshed(mesh: str) -> dict[str, str]:
    """Return the files of a robot whose mass is that of a mesh."""
    asset = f'<asset><mesh name="part" file="{mesh}"/></asset>'
    return {"robot/robot.xml": mjcf(asset, world=SHAPE.format("")), "part.obj": TETRAHEDRON,
            "robot/broken.obj": "nonsense"}  # fmt: skip


def including(part: str, name: str = "b.xml") -> dict[str, str]:
    """Return the files of a robot that includes a part."""
    world = f'<include file="{name}"/>' + LINK.format("a", "")
    return {"robot/robot.xml": mjcf(world=world), f"robot/{name}": part}


CASES: dict[str, tuple[Texts, str]] = {
    "couples nothing": (loops('<joint name="x" joint1="a1" joint2="a1" polycoef="0 1 0 0 0"/>'), ""),
    "cable equality": (
        mjcf(CABLE, '<equality><tendon name="x" tendon1="t"/></equality>', world=hinge()),
        "tendon 't' is spatial",
    ),
    "disabled": (
        loops('<weld name="x" body1="a" body2="b"/>').replace("<flag ", '<flag equality="disable" '),
        'remove equality="disable"',
    ),
    "armature of an actuator that is no motor": (
        mjcf(
            '<actuator><motor name="m" joint="j" gear="1 0 0" damping="1"/></actuator>', world=BALL.format("")
        ),
        "damping",  # before MuJoCo 4, actuators have none
    ),
    "mocap": (
        mjcf('<equality><weld body1="a" body2="m"/></equality>', world=hinge() + MOCAP),
        "body 'm': a program moves a mocap body",
    ),
    "plugin": (mjcf(world=hinge('/><plugin plugin="mujoco.elasticity.cable"')), "a plugin"),
    "plugin that makes mass": (
        mjcf(world='<body name="a"><joint name="j"/><geom type="sdf"><plugin plugin="x"/></geom></body>'),
        "a plugin",
    ),
    "flex": (
        mjcf(world=hinge() + '<body name="c"><flexcomp name="f" type="grid" count="3 3 1"/></body>'),
        "a deformable body",
    ),
    "attach": (
        mjcf(world=hinge() + '<body name="c"><attach model="x" prefix="p"/></body>'),
        "MuJoCo: could not find model 'x'",
    ),
    "a model that is not there": (
        mjcf('<asset><model name="x" file="x.xml"/></asset>', world=hinge()),
        "model 'x.xml' cannot be read: No such file",
    ),
    "nan": (mjcf(world=hinge('pos="0 nan 1"')), "attribute 'pos': 'nan' is not a finite number"),
    "infinite": (mjcf(world=hinge('ref="inf"')), "attribute 'ref': 'inf' is not a finite number"),
    "huge": (mjcf(world=hinge('pos="0 1e200 1"')), "too large"),
    "many": (
        mjcf(world=f"{MANY * 2}<body>{BAR.format(x=0, m=1)}</body></replicate></replicate>"),
        "with its replicas, the file has more than 50,000",
    ),
    "no body": (mjcf(), "no <body> stands in <worldbody>"),
    "no mass": (
        mjcf(world='<body name="a"><joint name="j"/></body>'),
        "element 'a': MuJoCo: mass and inertia.*; give the body a geom with mass, or <inertial>",
    ),
    "misspelt": (mjcf(world=hinge('dumping="1"')), "MuJoCo: .*unrecognized attribute: 'dumping'"),
    "a part of a file": ("<mujocoinclude><body/></mujocoinclude>", "name the file that includes it"),
    "an include that is missing": (
        mjcf(world='<include file="b.xml"/>'),
        "include 'b.xml' cannot be read: No such file",
    ),
    "an include of itself": (including(PART.format('<include file="b.xml"/>')), "included twice"),
    "an include of a robot": (including("<robot/>"), "instead of <mujocoinclude>"),
    "a broken include": (including("<mujocoinclude>"), "not well-formed"),
    "entities": (including('<!DOCTYPE a [<!ENTITY b "c">]><mujocoinclude/>'), "DOCTYPE is not allowed"),
    "hidden": (including(PART.format(LINK.format("b", "")), ".hidden.xml"), "is hidden"),
    "a mesh that is missing": (
        meshed("part.obj"),
        "mesh 'part.obj' cannot be read: No such file.*body 'a'.*<inertial>",
    ),
    "a mesh outside": (meshed("../part.obj"), "is outside the robot's folders.*body 'a'"),
    "a mesh of another kind": (meshed("part.dae"), "is none of .stl, .obj, .msh.*body 'a'"),
    "a broken mesh": (meshed("broken.obj"), "MuJoCo: "),
    "two names": (mjcf(world=hinge() + HINGE.format('name2=""', "").replace("name2", "margin")), "MuJoCo: "),
}


@pytest.mark.parametrize("name", CASES)
def test_refused_by_name(name: str, tmp_path: Path) -> None:
    texts, message = CASES[name]
    file = save_all(tmp_path, texts, "robot.xml")
    error = refused(file, *message.split(".*"))
    assert "freejoint" not in str(error)
    # MuJoCo's version decides whether what couples nothing compiles.
    assert Path(str(error.file)).parent == file.parent or name == "couples nothing"


NO_MOTORS = {
    "ball": (BALL.format(""), '<motor name="m" joint="j" gear="1 0 0"/>', "", "drives joint 'j', which has"),
    "thruster": (hinge(), '<motor name="m" site="s"/>', "", "drives no joint"),
    "cable": (hinge(), '<motor name="m" tendon="t"/>', CABLE, "pulls a spatial tendon"),
    "muscle": (hinge(), '<muscle name="m" tendon="t" lengthrange="1 2"/>', CABLE, "pulls a spatial tendon"),
}


@pytest.mark.parametrize("name", NO_MOTORS)
def test_actuators_that_are_no_motors_are_left_out(name: str, tmp_path: Path) -> None:
    """The robot opens with the motors that it has, and the inverse model says which are missing."""
    world, actuator, tendon, reason = NO_MOTORS[name]
    arm = '<body name="b" pos="0 1 0"><joint name="k"/>' + BAR.format(x=0.1, m=1) + "</body>"
    motors = f'<actuator>{actuator}<motor joint="k"/></actuator>'
    file = save(tmp_path, mjcf(tendon, motors, world=world + arm), "robot.xml")
    holds(read(file), {"motors": ("k",), "notes": {"no motors here", f"'m' {reason}"}})
    robot = hybridyn.load(file)
    with pytest.raises(hybridyn.ActuationError, match=r"actuators 'm' are no motors here"):
        hybridyn.idm(robot, robot.home, np.zeros(robot.nv), np.ones(robot.nv))
    if name != "ball":
        assert read(file, motors=["j"]).motors == ("j",)


def test_forces_of_a_fluid_and_plugins_of_shapes_are_noted(tmp_path: Path) -> None:
    shape = '<geom type="sdf" mesh="p"><plugin plugin="mujoco.sdf.torus"/></geom>'
    pid = '<plugin name="m" joint="j" plugin="mujoco.pid" ctrlrange="-1 1" forcerange="-7 7"/>'
    sections = [
        '<extension><plugin plugin="mujoco.sdf.torus"/><plugin plugin="mujoco.pid"/></extension>',
        '<asset><mesh name="p"><plugin plugin="mujoco.sdf.torus"/></mesh></asset>',
        f"<actuator>{pid}</actuator>",
    ]
    world = shape + hinge().replace('<site name="s"/>', shape + '<site name="s"/>')
    file = save(tmp_path, mjcf(*sections, world=world, head='<option density="1.2"/>'), "robot.xml")
    holds(read(file), {
        "links": [{"mass": 0}, {"mass": 1}], "joints": [{"effort": 7}], "motors": ("j",),
        "notes": {"of <option> 'density'", "robot.xml:", "<plugin> in <geom>", "actuators 'm' have a servo"},
    })  # fmt: skip


def test_lines_are_those_of_the_file(tmp_path: Path) -> None:
    head = HEAD + "\n<!-- a comment\n of two lines -->\n"
    content = mjcf(world=HINGE.format('axis="0 0 0"', ""), head=head)
    line = line_of(content, "<joint")
    assert refused(save(tmp_path, content, "robot.xml"), "axis too small").line == line


def test_without_mujoco_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    file = save(tmp_path, mjcf(world=hinge()), "robot.xml")
    refused(file, "needs the package mujoco; ", "'.[mjcf]'")


# -------------------- includes and meshes


def test_includes_stand_where_they_are_named(tmp_path: Path) -> None:
    save(tmp_path / "parts", PART.format(LINK.format("b", '<include file="c.xml"/>')), "b.xml")
    save(tmp_path / "parts", PART.format(LINK.format("c", "")), "c.xml")
    file = save(tmp_path, mjcf(world=LINK.format("a", '<include file="parts/b.xml"/>')), "robot.xml")
    found, names = read(file), ["world", "a", "b", "c"]
    holds(found, {"links": names})
    assert [link.line is None for link in found.links] == [True, False, True, True]
    m = mujoco.MjModel.from_xml_path(str(file))
    assert [m.body(number).name for number in range(m.nbody)] == names


def test_an_error_in_an_included_file_names_that_file(tmp_path: Path) -> None:
    part = save(tmp_path, PART.format('<body name="b"><joint axis="0 0 0"/><geom size="1"/></body>'), "b.xml")
    file = save(tmp_path, mjcf(world='<include file="b.xml"/>'), "robot.xml")
    error = refused(file, "axis too small")
    assert os.path.samefile(str(error.file), part)
    assert error.line == 3


def test_files_outside_the_folders_of_the_robot(tmp_path: Path) -> None:
    outside = save(tmp_path / "elsewhere", PART.format(LINK.format("b", "")), "b.xml")
    file = save(tmp_path / "robot", mjcf(world=f'<include file="{outside}"/>'), "robot.xml")
    refused(file, "is outside the robot's folders")
    assert read(file, package_dirs=[outside.parent]).joints


def test_a_robot_in_a_folder_of_files_reads_the_meshes_beside_it(tmp_path: Path) -> None:
    save(tmp_path / "meshes", TETRAHEDRON, "part.obj")
    head = HEAD.replace("<compiler", '<compiler meshdir="../meshes"')
    file = save(tmp_path / "mjcf", mjcf(ASSET, world=SHAPE.format(""), head=head), "robot.xml")
    found, m = read(file), mujoco.MjModel.from_xml_path(str(file))
    (_, link) = found.links
    np.testing.assert_allclose([link.mass, *link.com], [m.body_mass[1], *m.body_ipos[1]], rtol=0, atol=1e-15)
    np.testing.assert_allclose(
        sorted(np.linalg.eigvalsh(link.inertia)), sorted(m.body_inertia[1]), rtol=1e-12
    )


def test_meshes_are_not_read_where_inertia_is_stated(tmp_path: Path) -> None:
    """Neither a missing nor a broken mesh matters, nor textures, terrains and skins."""
    visuals = (
        '<asset><texture name="t" type="2d" file="none.png"/><material name="m" texture="t"/>'
        '<hfield file="h.png" size="1 1 1 1"/><mesh file="part.obj" scale="2 2 2"/></asset>'
    )
    world = SHAPE.format(BAR.format(x=0.1, m=1)).replace("<geom", '<geom material="m"')
    world = '<geom type="hfield" hfield="h"/><geom type="plane" size="1 1 1" material="m"/>' + world
    file = save(tmp_path, mjcf(visuals, world=world), "robot.xml")
    holds(read(file), {"links": [{"mass": 0}, {"mass": 1}]})
    save(tmp_path, "nonsense", "part.obj")
    holds(read(file), {"links": [{"mass": 0}, {"mass": 1}]})
