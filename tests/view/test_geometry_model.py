"""The shapes of the links as Pinocchio's GeometryModel: where the links' own poses put them."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from lxml import etree

import hybridyn
from hybridyn.description.shape_files import urdf_root
from hybridyn.errors import ModelError
from tests.robots.robot_texts import FOUR_BAR, save
from tests.support.comparing import ROUNDING, refused
from tests.support.extras import needs, robots_of_others, skip

BOX = '<visual><origin xyz="0.1 0.2 0.3"/><geometry><box size="1 2 3"/></geometry></visual>'


def test_placements_are_those_of_pinocchios_own_loader() -> None:
    """Its URDF reader knows the spanning tree alone, in the same coordinates."""
    robot = hybridyn.load("delta")
    text = etree.tostring(urdf_root(robot.description.source, {}, ())).decode()
    own = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdfString(own, text, pin.GeometryType.VISUAL)
    q, _, _ = hybridyn.assemble(robot, motors={m: 0.1 * i for i, m in enumerate(robot.motors)})
    placed = []
    for model, geometry in ((own, shapes), (robot.model, hybridyn.geometry_model(robot))):
        data = geometry.createData()
        pin.updateGeometryPlacements(model, model.createData(), geometry, data, q)
        placed.append({x.name: at for x, at in zip(geometry.geometryObjects, data.oMg, strict=True)})
    assert placed[0].keys() == placed[1].keys()
    assert len(placed[0]) == 11
    assert all(at.isApprox(placed[1][name], ROUNDING) for name, at in placed[0].items())


def test_a_stated_origin_is_read(tmp_path: Path) -> None:
    path = save(tmp_path, FOUR_BAR.replace('<link name="crank">', f'<link name="crank">{BOX}', 1))
    robot = hybridyn.load(path)
    (shape,) = hybridyn.geometry_model(robot).geometryObjects
    frame = robot.model.frames[robot.model.getFrameId("crank")]
    assert frame.placement.actInv(shape.placement).translation == pytest.approx([0.1, 0.2, 0.3])
    assert (2 * shape.geometry.halfSide == np.array([1, 2, 3])).all()
    assert not len(hybridyn.geometry_model(robot, "collision").geometryObjects)


def test_meshes_are_found() -> None:
    if not robots_of_others():
        skip("robots")
    robot = hybridyn.load("stewart_ur5")
    shapes = hybridyn.geometry_model(robot).geometryObjects
    meshes = [Path(shape.meshPath) for shape in shapes if shape.meshPath and "/" in shape.meshPath]
    assert meshes
    assert all(path.is_file() for path in meshes)


def test_a_missing_mesh_is_named_with_its_line(tmp_path: Path) -> None:
    mesh = '<visual><geometry>\n<mesh filename="package://nowhere/part.stl"/></geometry></visual>'
    text = FOUR_BAR.replace('<link name="crank">', f'<link name="crank">{mesh}', 1)
    line = text[: text.index("<mesh")].count("\n") + 1
    robot = hybridyn.load(save(tmp_path, text))
    refused(
        lambda: hybridyn.geometry_model(robot),
        ModelError,
        r"package://nowhere/part.stl.*package_dirs",
        line=line,
    )


def test_other_kinds_and_formats_are_refused(tmp_path: Path) -> None:
    refused(
        lambda: hybridyn.geometry_model(hybridyn.load("five_bar"), "mesh"),
        hybridyn.TrajectoryError,
        "kind must be 'visual' or 'collision'",
    )
    needs("mjcf")
    path = save(
        tmp_path,
        '<mujoco model="arm"><worldbody><body name="a"><joint name="j"/><geom size="0.1"/></body></worldbody>'
        "</mujoco>",
        "arm.xml",
    )
    refused(lambda: hybridyn.geometry_model(hybridyn.load(path)), ModelError, "URDF and xacro files only")
