"""Read study files, check what can be checked without loading the robot, and tell studies apart."""

from __future__ import annotations

import contextlib
from pathlib import Path

from ...description.bounds import recorded
from ...description.reading import read_bytes
from ...description.side_cars.toml_file import Keys
from ...errors import HybridynError, ModelError
from ...scenes.toml_source import read_schema
from ...spatial import Array
from ..results_folder import by_name
from .added_measures import measure_of
from .measures import check_word
from .playing import Player
from .study_file import PYTHON, Study, StudyFile, python_of
from .variants import Variants

#: Columns that every table of results has.
FIXED_COLUMNS = ("design", "status", "message")


def read_study(path: str | Path, *, allow_python: bool = False, strict: bool = False) -> StudyFile:
    """Read a study, and check what can be checked without loading its robot.

    Args:
        path: The TOML file.
        allow_python: Whether measures may be functions of Python files, which run with all rights of this
            process.
        strict: Whether notes on the robot are errors, although the study may not say so.

    Raises:
        ModelError: The file cannot be read, is not TOML, has a wrong key or value, or names a missing file;
            the message names file, line and key.
    """
    read, study = read_schema(path, Study, tuple)
    study = study.model_copy(update={"robot": study.robot.stricter(strict)})
    source = StudyFile(read.file, read.text, str(Path(read.file).parent.absolute()), study)
    _check(source, allow_python)
    return source


def _check(source: StudyFile, allow_python: bool) -> None:
    """Check the measures' names, the files, and the permission to run Python."""
    for name, task in source.study.tasks.items():
        for measure, word in task.wanted.items():
            keys: Keys = ("tasks", name, "measure", *([measure] if isinstance(task.measure, dict) else []))
            check_word(source, keys, word, task.kind, named=isinstance(task.measure, dict))
            if PYTHON in word and not allow_python:
                raise source.error(keys, f"'{word}' is a Python program; allow it with allow_python=True")
            if PYTHON in word and not Path(source.beside(python_of(word)[0])).is_file():
                raise source.error(keys, f"there is no file '{python_of(word)[0]}'")
        file = task.trajectory or task.scene
        if file and not Path(source.beside(file)).is_file():
            raise source.error(("tasks", name, task.kind), f"there is no file '{file}'")
        if task.scene:
            Player(source, name).check(allow_python=allow_python)
    robot = source.robot
    if not Path(robot).is_file():
        raise source.error(("robot", "file"), f"there is no file '{source.study.robot.file}'")
    columns = [*source.study.parameters, *source.columns]
    twice = [name for name in columns if columns.count(name) > 1 or name in FIXED_COLUMNS]
    if twice:
        raise ModelError(
            f"'{twice[0]}' would be two columns of the table: choose another name", file=source.file
        )


def identity(source: StudyFile, first: Array) -> dict[str, str]:
    """Return what a study asks: its text, and digests of all files that it reads; meshes are no part of it.

    These are the files that the study names, functions in Python among them, those that the robot's file
    includes for the first design, and `model.toml` and other files beside it.

    Args:
        first: Values of the parameters of the first design, shape (parameters,).

    Raises:
        ModelError: A file that the study names cannot be read.
    """
    variants = Variants(source)
    with recorded() as files:
        for path in source.files:
            read_bytes(path)
        with contextlib.suppress(HybridynError):  # the files of a robot that does not load
            variants.description(variants.named(first))
    words = (word for task in source.study.tasks.values() for word in task.wanted.values())
    packages = {f"measure {word}": one.package for word in words if (one := measure_of(word))}
    return {
        "study": source.study.model_dump_json(exclude={"designs": {"check"}}),
        **packages,
        **by_name(files),
    }
