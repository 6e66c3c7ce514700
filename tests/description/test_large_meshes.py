"""Meshes are not opened for dynamics: neither a missing nor a huge one keeps a robot from loading."""

import os
from pathlib import Path

import pytest

import hybridyn
from hybridyn.description import read
from tests.extras import needs

#: Size of a mesh file that no test could read [bytes]; the file has no content on the disk.
HUGE = 2**42

INERTIA = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
TEXTS = {
    "r.urdf": '<robot name="r"><link name="base"/><link name="arm"><inertial><mass value="2"/>' + INERTIA
    + '</inertial><visual><geometry><mesh filename="part.stl"/></geometry></visual><collision><geometry>'
    '<mesh filename="package://none/other.dae"/></geometry></collision></link><joint name="j" '
    'type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>',
    "r.sdf": '<sdf version="1.9"><model name="r"><link name="base"/><link name="arm"><inertial><mass>2</mass>'
    "</inertial><visual name='v'><geometry><mesh><uri>part.stl</uri></mesh></geometry></visual><collision "
    "name='c'><geometry><mesh><uri>model://none/other.dae</uri></mesh></geometry></collision></link>"
    '<joint name="hold" type="fixed"><parent>world</parent><child>base</child></joint><joint name="j" '
    'type="revolute"><parent>base</parent><child>arm</child><axis><xyz>0 1 0</xyz></axis></joint></model>'
    '</sdf>',
    "r.xml": '<mujoco><asset><mesh name="part" file="part.stl"/><mesh name="other" file="other.obj"/></asset>'
    '<worldbody><body name="arm"><joint name="j" axis="0 1 0"/><inertial pos="0 0 0" mass="2" '
    'diaginertia=".1 .1 .1"/><geom type="mesh" mesh="part"/><geom type="mesh" mesh="other"/></body>'
    "</worldbody></mujoco>",
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_meshes_are_not_opened(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "r.xml":
        needs("mjcf")
    file, mesh = tmp_path / name, tmp_path / "part.stl"
    file.write_text(TEXTS[name])
    mesh.touch()
    os.truncate(mesh, HUGE)
    description = read(file)
    assert [link.mass for link in description.links if link.name == "arm"] == [2]
    done = hybridyn.convert(file, tmp_path / "out.urdf")
    assert read(done.files[0]).joints[-1].name == "j"
    assert name == "r.urdf" or any(line.startswith("visual shapes") for line in done.losses)
