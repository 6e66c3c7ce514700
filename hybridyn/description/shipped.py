"""Find the robots that come with hybridyn by name: `lx4`, `delta`, ...

In a clone, their files are beside the package; in an installed wheel, they are inside it. The files of a
clone take precedence, because an editable install may contain an old copy.
"""

from __future__ import annotations

import os
import re
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from ..errors import ModelError

PACKAGE = Path(__file__).parents[1]
ENDINGS = (".urdf.xacro", ".urdf")
BARE_NAME = re.compile(r"[A-Za-z]\w*")


class ShippedRobot(NamedTuple):
    """A robot that comes with hybridyn.

    Attributes:
        name: Name of the robot.
        file: Path of the robot file.
        what: Description in one phrase.
        modules: Number of modules, None for a benchmark mechanism.
        motors: Number of motors, None for a benchmark mechanism.
        source: Source of its structure and its numbers.
        trajectory: File of a sample trajectory, or None.
        scene: File of the scene that its name plays, or None where nothing tells which.
        scenes: Files of its scenes.
    """

    name: str
    file: Path
    what: str
    modules: int | None
    motors: int | None
    source: str
    trajectory: Path | None
    scene: Path | None
    scenes: tuple[Path, ...]

    @property
    def is_benchmark(self) -> bool:
        """Whether this is a mechanism from the literature that tests and benchmarks use."""
        return self.file.parent.name != "urdf"


def data_folder() -> Path | None:
    """Return the folder that holds `urdf/` and `models/`, or None if they are not installed."""
    for folder in (PACKAGE.parent, PACKAGE / "_data"):
        if (folder / "urdf").is_dir() and (folder / "models" / "robots.toml").is_file():
            return folder
    return None


@lru_cache(maxsize=1)
def shipped_robots() -> dict[str, ShippedRobot]:
    """Return the shipped robots by name, in the order of their list."""
    import tomllib  # imported late: a robot given by its file needs no list of names

    folder = data_folder()
    if folder is None:
        return {}
    stated = tomllib.loads((folder / "models" / "robots.toml").read_text(encoding="utf-8"))
    found = ((name, shipped_file(name), facts) for name, facts in stated.items())
    return {name: _record(folder, name, file, facts) for name, file, facts in found if file is not None}


def find_robot(path: str | os.PathLike[str], folder: str | os.PathLike[str] = "") -> str:
    """Return the file of a robot: the path if it exists, else the shipped robot of that name.

    Args:
        path: A path, or a name.
        folder: Folder to which the path is relative; the working directory by default.

    Returns:
        Path of the file. A text that cannot be a robot's name is returned as a path, even if no file exists.

    Raises:
        ModelError: There is neither a file nor a shipped robot of this name.
    """
    word = os.fspath(path)
    place = str(Path(folder, word)) if os.fspath(folder) else word
    if os.path.exists(place) or not BARE_NAME.fullmatch(word):
        return place
    if (file := shipped_file(word)) is None:
        raise ModelError(no_such_robot(word), element=word)
    return shown(file)


def shipped_file(name: str) -> Path | None:
    """Return the file of the shipped robot of a name, or None; it reads no list of robots."""
    folder = data_folder()
    places = [] if folder is None else [folder / "urdf", folder / "urdf" / "benchmarks"]
    files = (place / f"{name}{ending}" for place in places for ending in ENDINGS)
    return next(filter(os.path.isfile, files), None)


def no_such_robot(word: str) -> str:
    """Return the message for a name that neither a file nor a shipped robot has."""
    from .names import did_you_mean  # imported late to keep shell completion fast

    known = shipped_robots()
    hint = did_you_mean(word, known)
    listing = f"; the shipped robots are {', '.join(main_names())}" if known and not hint else ""
    return f"there is no file '{word}', and no shipped robot of that name{hint}{listing}"


def main_names() -> list[str]:
    """Return the names of the README's robots, without the benchmark mechanisms."""
    return [name for name, robot in shipped_robots().items() if not robot.is_benchmark]


def find_data(word: str) -> str | None:
    """Return the path of a shipped robot's file, named like "lx4/traj.csv", or None if there is none."""
    folder = data_folder()
    if folder is None or not re.fullmatch(r"\w+/[\w.]+", word):
        return None
    file = folder / "models" / word
    return shown(file) if file.is_file() and word.partition("/")[0] in shipped_robots() else None


def data_names() -> list[str]:
    """Return the names of the files of shipped robots, like "lx4/traj.csv", as `find_data` takes them."""
    folder = data_folder()
    if folder is None:
        return []
    files = (file for name in shipped_robots() for file in sorted((folder / "models" / name).glob("*.*")))
    return [f"{file.parent.name}/{file.name}" for file in files]


def own_trajectory(file: str) -> str | None:
    """Return the path of the sample trajectory of a shipped robot, or None if there is none."""
    own = (one for one in shipped_robots().values() if os.path.realpath(file) == os.path.realpath(one.file))
    return next((shown(robot.trajectory) for robot in own if robot.trajectory), None)


def shown(file: Path) -> str:
    """Return a path relative to the working directory if the file is inside it, else the full path."""
    try:
        return str(file.relative_to(Path.cwd()))
    except ValueError:
        return str(file)


def _record(folder: Path, name: str, file: Path, facts: dict[str, Any]) -> ShippedRobot:
    """Build the record of a robot from its catalogue entry."""
    home = folder / "models" / name
    if not home.is_dir():
        home = folder / "models" / "benchmarks" / name
    scenes = tuple(sorted(path for path in home.glob("*.toml") if path.name != "model.toml"))
    return ShippedRobot(
        name=name,
        file=file,
        what=facts.get("what", ""),
        modules=facts.get("modules"),
        motors=facts.get("motors"),
        source=facts.get("source", ""),
        trajectory=home / "traj.csv" if (home / "traj.csv").is_file() else None,
        scene=home / facts["scene"] if "scene" in facts else scenes[0] if len(scenes) == 1 else None,
        scenes=scenes,
    )
