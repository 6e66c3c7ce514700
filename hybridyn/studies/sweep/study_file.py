"""Read study files: one TOML file states robot, parameters, tasks and measures.

    [robot]
    file = "five_bar"
    [designs]
    method = "sobol"
    count = 1024
    [parameters]
    upper_length = { range = [0.2, 0.3] }
    [tasks.pick]
    trajectory = "pick.csv"
    measure = ["peak_effort", "rms_effort"]

Paths are relative to the study's folder; a shipped robot needs only its name.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ...description.names import did_you_mean, listed
from ...description.reading import read_bytes
from ...description.shipped import find_robot
from ...description.side_cars.toml_file import Keys, line_of, parse_toml
from ...errors import HybridynError, ModelError
from .study_tables import Study, TaskTable, keys_at

#: Between file and function of a measure in Python.
PYTHON = ".py:"


@dataclass(frozen=True)
class StudyFile:
    """A study and the text of its file. Instances are pickled for other processes.

    Attributes:
        file: Path as the user gave it.
        folder: Folder of the study, absolute.
        text: The text.
        study: The parsed and validated content.
    """

    file: str
    folder: str
    text: str
    study: Study

    def error(self, keys: Keys, message: str) -> ModelError:
        """Build an error that names file, line and key."""
        key = ".".join(str(part) for part in keys if isinstance(part, str))
        return ModelError(f"'{key}': {message}", file=self.file, line=line_of(self.text, keys), element=key)

    def beside(self, path: str) -> str:
        """Return the absolute path of a file that the study names."""
        return str(Path(self.folder, path))

    @property
    def robot(self) -> str:
        """The robot's file, absolute: that of the study, or of the shipped robot it names."""
        with naming(self, ("robot", "file")):
            return str(Path(find_robot(self.study.robot.file, self.folder)).absolute())

    def column(self, task: str, measure: str) -> str:
        """Return the name of a column: the measure, after its task where there are several."""
        return measure if len(self.study.tasks) == 1 else f"{task}.{measure}"

    @property
    def columns(self) -> list[str]:
        """Columns of everything that is measured."""
        tasks = self.study.tasks.items()
        return [self.column(name, measure) for name, task in tasks for measure in task.wanted]

    @property
    def files(self) -> list[str]:
        """Absolute paths of the files that the study reads, without those that the robot includes."""
        found = [self.robot, *([self.beside(self.study.designs.table)] if self.study.designs.table else [])]
        for task in self.study.tasks.values():
            found += [self.beside(task.trajectory)] if task.trajectory else []
            found += [self.beside(python_of(word)[0]) for word in task.wanted.values() if PYTHON in word]
        return list(dict.fromkeys(found))

    @property
    def identity(self) -> str:
        """A digest of the study and of the files that it reads."""
        digest = hashlib.sha256(self.study.model_dump_json().encode())
        for path in self.files:
            digest.update(read_bytes(path))
        return digest.hexdigest()


def python_of(word: str) -> tuple[str, str]:
    """Split `file.py:function` into file and function."""
    file, _, function = word.rpartition(":")
    return file, function


def read_study(path: str | Path, *, allow_python: bool = False) -> StudyFile:
    """Read a study, and check what can be checked without loading its robot.

    Args:
        path: The TOML file.
        allow_python: Whether measures may be functions of Python files, which run with all rights of this
            process.

    Raises:
        ModelError: The file cannot be read, is not TOML, has a wrong key or value, or names a missing file;
            the message names file, line and key.
    """
    file = str(path)
    text, content = parse_toml(read_bytes(file), file)
    try:
        study = Study.model_validate(content)
    except ValidationError as error:
        keys, message = _problem(error, content)
        key = ".".join(str(part) for part in keys)
        line = line_of(text, keys)
        raise ModelError(
            f"'{key}': {message}" if key else message, file=file, line=line, element=key
        ) from None
    source = StudyFile(file, str(Path(file).parent.absolute()), text, study)
    _check(source, allow_python)
    return source


def _check(source: StudyFile, allow_python: bool) -> None:
    """Check the measures' names, the files, and the permission to run Python.

    Raises:
        ModelError: One of these is wrong.
    """
    from .measures import check_word

    for name, task in source.study.tasks.items():
        for measure, word in task.wanted.items():
            keys: Keys = ("tasks", name, "measure", *([measure] if isinstance(task.measure, dict) else []))
            check_word(source, keys, word, _kind(task), named=isinstance(task.measure, dict))
            if PYTHON in word and not allow_python:
                raise source.error(keys, f"'{word}' is a Python program; allow it with allow_python=True")
            if PYTHON in word and not Path(source.beside(python_of(word)[0])).is_file():
                raise source.error(keys, f"there is no file '{python_of(word)[0]}'")
        if task.trajectory and not Path(source.beside(task.trajectory)).is_file():
            raise source.error(("tasks", name, "trajectory"), f"there is no file '{task.trajectory}'")
    robot = source.robot
    if not Path(robot).is_file():
        raise source.error(("robot", "file"), f"there is no file '{source.study.robot.file}'")
    columns = [*source.study.parameters, *source.columns]
    twice = [name for name in columns if columns.count(name) > 1 or name in FIXED_COLUMNS]
    if twice:
        raise ModelError(
            f"'{twice[0]}' would be two columns of the table: choose another name", file=source.file
        )


#: Columns that every table of results has.
FIXED_COLUMNS = ("design", "status", "unreachable", "singular", "message")


def _kind(task: TaskTable) -> str:
    """Return the kind of a task."""
    return "trajectory" if task.trajectory is not None else "workspace"


@contextmanager
def naming(source: StudyFile, keys: Keys) -> Iterator[None]:
    """Prefix the message of an error with file, line and key of a study."""
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
        known = keys_at(keys[:-1])
        return keys, f"unknown key{did_you_mean(str(keys[-1]), known)}; known: {listed(known)}"
    if problem["type"] == "missing":
        return keys, "is missing"
    if problem["type"] == "string_pattern_mismatch":
        return keys, "a name has letters, digits and underscores, and begins with no digit"
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
