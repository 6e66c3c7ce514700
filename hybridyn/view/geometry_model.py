"""The shapes of a robot's links as Pinocchio's `GeometryModel`, for collision checks and other viewers."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..description.shape_files import MeshFiles, MissingMeshError, urdf_root
from ..errors import ModelError
from ..structure.robot import HybridRobot
from ..structure.samples import one_of

if TYPE_CHECKING:
    import pinocchio as pin


def geometry_model(
    robot: HybridRobot,
    kind: str = "visual",
    *,
    xacro_args: Mapping[str, object] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> pin.GeometryModel:
    """Read the shapes of a robot's links as Pinocchio's `GeometryModel`, for `robot.model`.

    `pin.updateGeometryPlacements(robot.model, data, geometry, geometry_data, q)` places them at positions q
    of the spanning tree, which `hybridyn.assemble` returns.

    Args:
        robot: A robot from a URDF or xacro file.
        kind: "visual" or "collision".
        xacro_args: Arguments of a xacro file by name, as for `hybridyn.load`.
        package_dirs: Folders in which `package://` searches.

    Returns:
        The shapes; their names and parent frames are those of Pinocchio's own URDF reader.

    Raises:
        ModelError: The robot's file is not a URDF, or a mesh is missing or cannot be read.
        TrajectoryError: `kind` is neither "visual" nor "collision".

    Example:
        >>> robot = hybridyn.load("five_bar")
        >>> hybridyn.geometry_model(robot, "visual").ngeoms
        6
    """
    one_of("kind", kind, "visual", "collision")
    file = robot.description.source
    root = urdf_root(file, xacro_args or {}, package_dirs) if file else None
    if root is None:
        raise ModelError("shapes are read from URDF and xacro files only", file=file)
    _name_files(root, str(file), kind, MeshFiles(Path(str(file)).parent, package_dirs))
    return _shapes_of(robot, root, kind)


def _shapes_of(robot: HybridRobot, root: Any, kind: str) -> pin.GeometryModel:
    """Build the shapes of one kind of a robot from its URDF, by Pinocchio.

    Raises:
        ModelError: A mesh cannot be read.
    """
    import pinocchio as pin
    from lxml import etree

    wanted = pin.GeometryType.VISUAL if kind == "visual" else pin.GeometryType.COLLISION
    try:
        return pin.buildGeomFromUrdfString(robot.unchanged_model, etree.tostring(root).decode(), wanted)
    except ValueError as error:
        raise ModelError(f"its shapes cannot be read: {error}", file=robot.description.source) from error


def _name_files(root: Any, file: str, kind: str, find: MeshFiles) -> None:
    """Replace the addresses of meshes by paths, which Pinocchio opens as they are."""
    for mesh in root.iterfind(f"link/{kind}/geometry/mesh"):
        try:
            mesh.set("filename", str(find(mesh.get("filename", ""))))
        except MissingMeshError as error:
            raise ModelError(
                f"a mesh is missing: {error}; say where its package is (package_dirs)",
                file=file,
                line=mesh.sourceline,
            ) from None
