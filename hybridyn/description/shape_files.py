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
    from .opening import open_robot

    root = open_robot(file, xacro_args, package_dirs)
    return root.xml if root.tag == "robot" else None


class MissingMeshError(Exception):
    """A shape cannot be loaded."""


class MeshFiles:
    """Finds the files of meshes."""

    def __init__(
        self, folder: Path, package_dirs: Sequence[str | os.PathLike[str]], *, named: bool = False
    ) -> None:
        """Find the folders; with `named`, a package's own folder has its name."""
        from .urdf.xacro import share_dirs

        self.folder, self.named = folder, named
        ros = filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep))
        shares = [Path(place) for place in (*ros, *share_dirs())]
        examples = [place / "example-robot-data" / "robots" for place in shares]
        above = [folder.resolve(), *folder.resolve().parents][:5]
        self.roots = [*(Path(place) for place in package_dirs), *shares, *examples, *above]

    def __call__(self, name: str) -> Path:
        """Find the file of a mesh.

        Args:
            name: A path, or a `package://`, `model://` or `file://` address.

        Raises:
            MissingMeshError: There is no such file.
        """
        name = unquote(name)
        scheme, _, inside = name.rpartition("://")
        if scheme in ("package", "model"):
            inside = inside.lstrip("/")  # Gepetto writes package:///NAME
            package, _, rest = inside.partition("/")
            places = [root / inside for root in self.roots]
            # The root may be the package's own folder, or hold its files without the package's name.
            places += [root / rest for root in self.roots if not self.named or root.name == package]
        else:
            places = [self.folder / name.removeprefix("file://")]
        if found := next((place for place in places if place.is_file()), None):
            return found
        raise MissingMeshError(f"no file '{name}'")
