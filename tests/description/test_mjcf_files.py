"""Files that an MJCF file names: includes and meshes, read only from the robot's folders."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from hybridyn.description import read
from tests.description.reading import refused
from tests.extras import needs
from tests.files import save
from tests.mjcf_texts import BAR, HEAD, mjcf

mujoco = needs("mjcf")

LINK = '<body name="{0}"><joint name="j{0}"/>' + BAR.format(x=0.1, m=1) + "{1}</body>"
PART = "<mujocoinclude>\n\n{}\n</mujocoinclude>"
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
SHAPE = '<body name="a"><joint name="j"/><geom type="mesh" mesh="part"/>{}</body>'
ASSET = '<asset><mesh name="part" file="part.obj"/></asset>'


def test_includes_stand_where_they_are_named(tmp_path: Path) -> None:
    save(tmp_path / "parts", PART.format(LINK.format("b", '<include file="c.xml"/>')), "b.xml")
    save(tmp_path / "parts", PART.format(LINK.format("c", "")), "c.xml")
    file = save(tmp_path, mjcf(world=LINK.format("a", '<include file="parts/b.xml"/>')), "robot.xml")
    found = read(file)
    assert [link.name for link in found.links] == ["world", "a", "b", "c"]
    assert [link.line is None for link in found.links] == [True, False, True, True]
    m = mujoco.MjModel.from_xml_path(str(file))
    assert [m.body(number).name for number in range(m.nbody)] == ["world", "a", "b", "c"]


def test_an_error_in_an_included_file_names_that_file(tmp_path: Path) -> None:
    part = save(tmp_path, PART.format('<body name="b"><joint axis="0 0 0"/><geom size="1"/></body>'), "b.xml")
    file = save(tmp_path, mjcf(world='<include file="b.xml"/>'), "robot.xml")
    error = refused(file, "axis too small")
    assert os.path.samefile(str(error.file), part)
    assert error.line == 3


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({}, "file 'b.xml' cannot be read: No such file"),
        ({"b.xml": PART.format('<include file="b.xml"/>')}, "included twice"),
        ({"b.xml": "<robot/>"}, "instead of <mujocoinclude>"),
        ({"b.xml": "<mujocoinclude>"}, "not well-formed"),
        ({"b.xml": '<!DOCTYPE a [<!ENTITY b "c">]><mujocoinclude/>'}, "DOCTYPE is not allowed"),
    ],
)
def test_includes_that_are_refused(files: dict[str, str], message: str, tmp_path: Path) -> None:
    for name, content in files.items():
        save(tmp_path, content, name)
    file = save(tmp_path, mjcf(world='<include file="b.xml"/>' + LINK.format("a", "")), "robot.xml")
    refused(file, *message.split(".*"))


def test_files_outside_the_folders_of_the_robot(tmp_path: Path) -> None:
    outside = save(tmp_path / "elsewhere", PART.format(LINK.format("b", "")), "b.xml")
    named = mjcf(world=f'<include file="{outside}"/>')
    file = save(tmp_path / "robot", named, "robot.xml")
    refused(file, "is outside the robot's folders")
    assert read(file, package_dirs=[outside.parent]).joints
    save(tmp_path / "robot", PART.format(LINK.format("b", "")), ".hidden.xml")
    save(file.parent, mjcf(world='<include file=".hidden.xml"/>'), file.name)
    refused(file, "is hidden")


def test_a_robot_in_a_folder_of_files_reads_the_meshes_beside_it(tmp_path: Path) -> None:
    save(tmp_path / "meshes", TETRAHEDRON, "part.obj")
    head = HEAD.replace("<compiler", '<compiler meshdir="../meshes"')
    file = save(tmp_path / "mjcf", mjcf(ASSET, world=SHAPE.format(""), head=head), "robot.xml")
    found, m = read(file), mujoco.MjModel.from_xml_path(str(file))
    (link,) = (link for link in found.links if link.name == "a")
    assert link.mass == m.body_mass[1]
    np.testing.assert_allclose(link.com, m.body_ipos[1], atol=1e-15)
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
    assert [link.mass for link in read(file).links] == [0, 1]
    save(tmp_path, "nonsense", "part.obj")
    assert [link.mass for link in read(file).links] == [0, 1]


@pytest.mark.parametrize(
    ("asset", "message"),
    [
        (ASSET, "mesh 'part.obj' cannot be read: No such file.*body 'a'.*<inertial>"),
        (ASSET.replace("part.obj", "../part.obj"), "is outside the robot's folders.*body 'a'"),
        (ASSET.replace("part.obj", "part.dae"), "is none of .stl, .obj, .msh.*body 'a'"),
        (ASSET.replace("part.obj", "broken.obj"), "MuJoCo: "),
    ],
)
def test_meshes_that_are_needed_must_be_there(asset: str, message: str, tmp_path: Path) -> None:
    save(tmp_path, TETRAHEDRON, "part.obj")
    save(tmp_path / "robot", "nonsense", "broken.obj")
    file = save(tmp_path / "robot", mjcf(asset, world=SHAPE.format("")), "robot.xml")
    refused(file, *message.split(".*"))
