"""Find the files that state a robot's shapes: its URDF, expanded, and the meshes that it names."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote


def urdf_root(
    file: str, xacro_args: Mapping[str, object], package_dirs: Sequence[str | os.PathLike[str]]
) -> Any:
    """Read a URDF or xacro file.

    Returns:
        The lxml element of the robot, or None for a file of another format.
    """
    from .reading import open_robot

    root = open_robot(file, xacro_args, package_dirs)
    return root.xml if root.tag == "robot" else None


class MissingMeshError(Exception):
    """A shape cannot be loaded."""


class MeshFiles:
    """Finds the files of meshes."""

    def __init__(self, folder: Path, package_dirs: Sequence[str | os.PathLike[str]]) -> None:
        from .urdf.xacro import _share_dirs

        self.folder = folder
        shares = [Path(place) for place in _share_dirs()]
        examples = [place / "example-robot-data" / "robots" for place in shares]
        above = [folder.resolve(), *folder.resolve().parents][:4]
        self.roots = [*(Path(place) for place in package_dirs), *shares, *examples, *above]

    def __call__(self, name: str) -> Path:
        """Find the file of a mesh.

        Args:
            name: A path, or a `package://`, `model://` or `file://` address.

        Raises:
            MissingMeshError: There is no such file.
        """
        name = unquote(name)
        for prefix in ("package://", "model://"):
            if name.startswith(prefix):
                inside = name.removeprefix(prefix)
                places = [root / inside for root in self.roots]
                # The root may be the package's own folder, or hold its files without the package's name.
                places += [root / inside.partition("/")[2] for root in self.roots]
                break
        else:
            places = [self.folder / name.removeprefix("file://")]
        for place in places:
            if place.is_file():
                return place
        raise MissingMeshError(f"no file '{name}'")
