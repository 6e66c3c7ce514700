"""Measures that are functions, in Python files beside the study or of packages."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...errors import HybridynError, ModelError
from ...spatial import Array
from ...structure.robot import HybridRobot
from .added_measures import measure_of
from .study_file import PYTHON, StudyFile, python_of


@dataclass(eq=False)
class Followed:
    """The motion of a design along a trajectory, for functions in Python.

    Attributes:
        time: Times, shape (T,), [s], or None.
        q: Positions, shape (T, nq).
        v: Rates, shape (T, nv).
        a: Accelerations, shape (T, nv).
        effort: Efforts of the motors, shape (T, motors), [N or N m].
        measures: The other measures of the task by name.
    """

    time: Array | None
    q: Array
    v: Array
    a: Array
    effort: Array
    measures: Mapping[str, float]


def functions_of(source: StudyFile) -> dict[str, Callable[..., Any]]:
    """Run the Python files of a study, which have all rights of this process; return their functions.

    The functions of packages are among them.

    Raises:
        ModelError: A file fails, or has no such function.
    """
    words = [word for task in source.study.tasks.values() for word in task.wanted.values()]
    out = {word: one.function for word in words if (one := measure_of(word)) is not None}
    for word in (word for word in words if PYTHON in word):
        file, name = python_of(word)
        path = source.beside(file)
        spec = importlib.util.spec_from_file_location(file.removesuffix(".py").replace("/", "_"), path)
        if spec is None or spec.loader is None:
            raise ModelError("there is no such Python file", file=path)
        module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
            out[word] = getattr(module, name)
        except Exception as error:
            raise ModelError(f"'{name}': {type(error).__name__}: {error}", file=path) from error
    return out


def call(functions: Mapping[str, Callable[..., Any]], word: str, robot: HybridRobot, result: object) -> float:
    """Call a function in Python and return its number.

    Raises:
        ModelError: It fails, or returns no number.
    """
    try:
        return float(functions[word](robot, result))
    except HybridynError:
        raise
    except Exception as error:
        raise ModelError(f"'{word}': {type(error).__name__}: {error}") from error
