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
from dataclasses import dataclass
from pathlib import Path

from ...description.reading import read_bytes
from ...description.shipped import find_robot
from ...description.side_cars.toml_file import Keys
from ...errors import ModelError
from ...scenes.toml_source import TomlSource, naming, read_schema
from .study_tables import Study, TaskTable

#: Between file and function of a measure in Python.
PYTHON = ".py:"


@dataclass(frozen=True)
class StudyFile(TomlSource):
    """A study and the text of its file. Instances are pickled for other processes.

    Attributes:
        folder: Folder of the study, absolute.
        study: The parsed and validated content.
    """

    folder: str
    study: Study

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
    read, study = read_schema(path, Study, {})
    source = StudyFile(read.file, read.text, str(Path(read.file).parent.absolute()), study)
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
