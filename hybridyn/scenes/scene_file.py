"""Read scene files: one TOML file states robot, start, controller, effects and duration of a simulation.

    duration = 2.0
    [robot]
    file = "../../urdf/five_bar.urdf.xacro"
    [initial]
    joints = { m1_left_drive = 0.3 }
    [effects]
    use = ["default", "viscous_friction"]
    [output]
    rate = 100.0

docs/scenes.md describes every key. Paths are relative to the scene's folder; a shipped robot needs only its
name. A scene is data and runs no code: it may name a Python controller, which the user has to allow.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..description.shipped import find_robot
from .scene_tables import CONTROLLERS, Scene
from .toml_source import TomlSource, read_schema


@dataclass(frozen=True)
class SceneFile(TomlSource):
    """A scene and the text of its file.

    Attributes:
        scene: The parsed and validated content.
    """

    scene: Scene

    def beside(self, path: str) -> str:
        """Return the path of a file that the scene names, from the working directory."""
        return str(Path(self.file).parent / path)

    @property
    def robot(self) -> str:
        """The robot's file: that of the scene, or of the shipped robot it names.

        Raises:
            ModelError: There is no file and no shipped robot of this name.
        """
        return find_robot(self.scene.robot.file, Path(self.file).parent)


def read_scene(path: str | Path) -> SceneFile:
    """Read a scene.

    Raises:
        ModelError: The file cannot be read, is not TOML, or has a wrong key or value; the message names file,
            line and key.
    """
    source, scene = read_schema(path, Scene, CONTROLLERS)
    return SceneFile(source.file, source.text, scene)
