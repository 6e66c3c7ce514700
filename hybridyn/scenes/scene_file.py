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

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..description.names import did_you_mean, listed
from ..description.reading import read_bytes
from ..description.shipped import find_robot
from ..description.side_cars.toml_file import Keys, line_of, parse_toml
from ..errors import HybridynError, ModelError
from .scene_tables import CONTROLLERS, Scene, keys_at


@dataclass(frozen=True)
class SceneFile:
    """A scene and the text of its file.

    Attributes:
        file: Path as the user gave it.
        text: The text.
        scene: The parsed and validated content.
    """

    file: str
    text: str
    scene: Scene

    def error(self, keys: Keys, message: str) -> ModelError:
        """Build an error that names file, line and key."""
        key = ".".join(str(part) for part in keys if isinstance(part, str))
        return ModelError(f"'{key}': {message}", file=self.file, line=line_of(self.text, keys), element=key)

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

    Args:
        path: The TOML file.

    Raises:
        ModelError: The file cannot be read, is not TOML, or has a wrong key or value; the message names file,
            line and key.
    """
    file = str(path)
    text, content = parse_toml(read_bytes(file), file)
    try:
        return SceneFile(file, text, Scene.model_validate(content))
    except ValidationError as error:
        keys, message = _problem(error, content)
        key = ".".join(str(part) for part in keys)
        line = line_of(text, keys)
        raise ModelError(
            f"'{key}': {message}" if key else message, file=file, line=line, element=key
        ) from None


@contextmanager
def naming(source: SceneFile, keys: Keys) -> Iterator[None]:
    """Prefix the message of an error with file, line and key of a scene."""
    try:
        yield
    except HybridynError as error:
        if not str(error).startswith(f"{source.file}:"):
            error.args = (str(source.error(keys, str(error))),)
        raise


def _problem(error: ValidationError, content: dict[str, Any]) -> tuple[Keys, str]:
    """Return keys and text of the most specific problem: an unknown key, else the most deeply nested one."""
    found = [(_keys(problem["loc"], content, problem["type"]), problem) for problem in error.errors()]
    keys, problem = max(found, key=lambda pair: (pair[1]["type"] == "extra_forbidden", len(pair[0])))
    if problem["type"] == "extra_forbidden":
        known = keys_at(keys[:-1], content)
        name = str(keys[-1])
        return keys, f"unknown key{did_you_mean(name, known)}; known: {listed(known)}"
    if problem["type"] in ("union_tag_invalid", "union_tag_not_found"):
        given = str(problem.get("ctx", {}).get("tag", ""))
        return (*keys, "kind"), f"must be one of {listed(CONTROLLERS)}{did_you_mean(given, CONTROLLERS)}"
    if problem["type"] == "missing":
        return keys, "is missing"
    return keys, problem["msg"].removeprefix("Value error, ").replace("Input should", "should")


def _keys(place: Keys, content: Any, kind: str) -> Keys:
    """Return the keys of a problem as they are in the file, without pydantic's marks of alternatives."""
    out: list[str | int] = []
    for i, part in enumerate(place):
        inside = isinstance(content, dict) and part in content
        if inside or (isinstance(content, list) and isinstance(part, int) and part < len(content)):
            content = content[part]
            out.append(part)
        elif kind == "missing" and i == len(place) - 1:
            out.append(part)
    return tuple(out)
