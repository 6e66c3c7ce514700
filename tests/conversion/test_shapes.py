"""Visual shapes: what is read of a URDF, and how URDF and MJCF refer to them."""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from hybridyn import convert
from hybridyn.conversion.request import Losses
from hybridyn.conversion.shapes import read_shapes
from hybridyn.description import read
from tests.robots.robot_texts import FOUR_BAR, save
from tests.support.extras import needs

VISUALS = """<visual><origin xyz="0 0 1" rpy="0 0 0.5"/><geometry><box size="1 2 3"/></geometry>
  <material name="red"/></visual>
<visual><geometry><cylinder radius="0.5" length="2"/></geometry></visual>
<visual><geometry><sphere radius="0.25"/></geometry><material name="x">
  <color rgba="0 1 0 0.5"/></material></visual>
<visual><geometry><mesh filename="arm.stl" scale="0.001 0.001 0.001"/></geometry></visual>
<visual><geometry><mesh filename="package://robot/arm.dae"/></geometry></visual>
<visual><geometry><mesh filename="none.stl"/></geometry></visual>
<visual><geometry><mesh filename="text.stl"/></geometry></visual>
<visual><geometry><box size="1 2"/></geometry></visual>"""

#: A tetrahedron: 4 triangles, each a normal and three corners, and two bytes.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype="<f4")
FACES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
STL = bytes(80) + (4).to_bytes(4, "little")
STL += b"".join(bytes(12) + CORNERS[list(face)].tobytes() + bytes(2) for face in FACES)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A robot with shapes, in a folder of its own."""
    head, link, rest = FOUR_BAR.partition('<link name="crank">')
    assert link
    red = '<material name="red"><color rgba="1 0 0 1"/></material>'
    text = head + link + VISUALS + rest.replace("</robot>", red + "</robot>")
    save(tmp_path / "robot", "solid a\nendsolid a\n", "text.stl")
    (tmp_path / "robot" / "arm.stl").write_bytes(STL)
    save(tmp_path / "robot", "", "arm.dae")
    return save(tmp_path / "robot", text)


def test_shapes_are_those_of_the_author(file: Path, tmp_path: Path) -> None:
    losses = Losses()
    shapes = read_shapes(read(file), tmp_path / "out.xml", {}, [tmp_path], losses)
    assert [shape.kind for shape in shapes] == ["box", "cylinder", "sphere", *["mesh"] * 4]
    assert {shape.link for shape in shapes} == {"crank"}
    assert [shape.colour for shape in shapes[:3]] == [(1, 0, 0, 1), None, (0, 1, 0, 0.5)]
    assert [shape.file for shape in shapes[3:]] == [
        "robot/arm.stl",
        "package://robot/arm.dae",
        "none.stl",
        "robot/text.stl",
    ]
    assert [shape.path is None for shape in shapes[3:]] == [False, False, True, False]
    assert shapes[3].size == (0.001, 0.001, 0.001)
    assert losses.lines() == ("visual shapes that cannot be read: 'crank'",)


def test_urdf_writes_the_same_shapes(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.urdf"
    assert convert(file, out, package_dirs=[tmp_path]).losses == (
        "visual shapes that cannot be read: 'crank'",
    )
    ours, theirs = (read_shapes(read(f), tmp_path / "x", {}, [tmp_path], Losses()) for f in (file, out))
    for a, b in zip(ours, theirs, strict=True):
        np.testing.assert_allclose(b.placement, a.placement, atol=1e-15)
        assert (b.kind, b.size, b.file, b.colour) == (a.kind, a.size, a.file, a.colour)


def test_mjcf_writes_shapes_that_mujoco_reads(file: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.xml"
    losses = convert(file, out, package_dirs=[tmp_path]).losses
    (unread,) = (line for line in losses if line.startswith("visual shapes without extent, and meshes"))
    assert unread.endswith(": 'package://robot/arm.dae', 'none.stl', 'robot/text.stl'")
    geoms = ET.parse(out).getroot().findall(".//geom")
    assert [geom.get("size") for geom in geoms] == ["0.5 1 1.5", "0.5 1", "0.25", None]
    model = needs("mjcf").MjModel.from_xml_path(str(out))
    assert model.ngeom == 4
    weight = sum(link.mass for link in read(file).links)
    assert float(model.body_mass.sum()) == pytest.approx(weight, rel=1e-12)
