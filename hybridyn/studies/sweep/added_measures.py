"""Measures that other packages add, and those that are functions in Python files."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ...extensions import Extension, added
from .study_file import PYTHON, TASKS


class Measure(NamedTuple):
    """A measure of a package.

    Attributes:
        function: Returns its number, from a robot and its motion (`python_measures.Followed`) or `Workspace`.
        unit: Its unit, "" for none.
        tasks: The kinds of tasks that it measures.
        package: Name and version of its package, which are filled in.
    """

    function: Callable[..., float]
    unit: str = ""
    tasks: tuple[str, ...] = ("trajectory", "scene")
    package: str = ""


def checked_measure(found: Extension) -> Measure:
    """Return the measure that a package adds.

    Raises:
        ModelError: It is no `Measure`, or for tasks that there are not.
    """
    one = found.value
    if not (isinstance(one, Measure) and callable(one.function)):
        raise found.refused(
            "measures", f"is {one!r}: make it a hybridyn.studies.sweep.added_measures.Measure of a function"
        )
    if not one.tasks or {*one.tasks} - {*TASKS}:
        raise found.refused("measures", f"is for {one.tasks}; tasks are {', '.join(TASKS)}")
    return one._replace(package=f"{found.package} {found.version}")


def measure_of(word: str) -> Measure | None:
    """Return the measure that a package adds under a word, or None.

    Raises:
        ModelError: It cannot be used.
    """
    one: Measure | None = added("measures", word)
    return one


def is_function(word: str) -> bool:
    """Return whether a measure is a function of the robot of a design, of a file or of a package."""
    return PYTHON in word or measure_of(word) is not None
