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

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from ...assembly.redundancy import LEAST, Rule
from ...description.shipped import find_robot
from ...description.side_cars.tables import Schema
from ...scenes.controller_tables import exactly_one
from ...scenes.scene_file import RobotTable, read_scene
from ...scenes.stage import files_of
from ...scenes.toml_source import TomlSource, naming

#: Names of parameters, tasks and measures: they are columns of the table, and names in expressions.
Name = Annotated[str, Field(pattern=r"^[A-Za-z_]\w*$")]
Pair = Annotated[list[FiniteFloat], Field(min_length=2, max_length=2)]
Method = Literal["grid", "latin_hypercube", "sobol", "random", "table"]
#: Kinds of tasks: the key of each in the table of a task.
TASKS = ("trajectory", "workspace", "scene")
#: Methods that take a number of designs.
COUNTED = ("latin_hypercube", "sobol", "random")
#: Largest number of designs of a study.
MOST_DESIGNS = 10**7


class DesignsTable(Schema):
    """[designs]: how the values of the parameters are drawn."""

    method: Method
    count: Annotated[int, Field(ge=1, le=MOST_DESIGNS)] | None = None
    seed: Annotated[int, Field(ge=0)] = 0
    check: Annotated[int, Field(ge=0)] | None = None
    table: str | None = None

    @model_validator(mode="after")
    def _complete(self) -> DesignsTable:
        for key, methods in (("count", COUNTED), ("table", ("table",))):
            given, needed = getattr(self, key) is not None, self.method in methods
            if given != needed:
                verb = "needs" if needed else "takes no"
                raise ValueError(f"the method '{self.method}' {verb} '{key}'")
        return self


class ParameterTable(Schema):
    """[parameters.NAME]: what the parameter changes, and its values."""

    xacro: str | None = None
    scale_inertia: str | list[str] | None = None
    range: Pair | None = None
    steps: Annotated[int, Field(ge=1)] | None = None
    normal: Pair | None = None
    values: Annotated[list[FiniteFloat], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> ParameterTable:
        if self.xacro is not None and self.scale_inertia is not None:
            raise ValueError("give 'xacro' or 'scale_inertia', not both")
        if self.range is not None and not self.range[0] < self.range[1]:
            raise ValueError(f"the range from {self.range[0]:g} to {self.range[1]:g} is empty")
        if self.normal is not None and not self.normal[1] > 0:
            raise ValueError(f"the standard deviation must be positive, not {self.normal[1]:g}")
        if self.steps is not None and self.range is None:
            raise ValueError("'steps' divide a 'range', and there is none")
        return self

    @property
    def links(self) -> list[str]:
        """The links whose mass and inertia are scaled."""
        links = self.scale_inertia or []
        return [links] if isinstance(links, str) else links


class WorkspaceTable(Schema):
    """[tasks.NAME.workspace]: the arguments of `workspace`."""

    module: int | str | None = None
    link: str | None = None
    axes: list[str] | None = None
    at: dict[str, FiniteFloat] = Field(default_factory=dict)
    steps: dict[str, FiniteFloat] = Field(default_factory=dict)
    limits: bool = True


class TaskTable(Schema):
    """[tasks.NAME]: what every design does, and what is measured."""

    trajectory: str | None = None
    workspace: WorkspaceTable | None = None
    scene: str | None = None
    effects: str | list[str] = "model"
    passive: Literal["given", "solved"] = "given"
    redundancy: Rule = LEAST
    measure: Annotated[list[str], Field(min_length=1)] | dict[Name, str]

    @model_validator(mode="after")
    def _one(self) -> TaskTable:
        exactly_one(self, *TASKS)
        for key in ("effects", "passive"):
            if key in self.model_fields_set and self.trajectory is None:
                raise ValueError(f"'{key}' belongs to a trajectory; a {self.kind} has none")
        if "redundancy" in self.model_fields_set and self.scene is not None:
            raise ValueError("a scene states its own 'redundancy': write it there")
        return self

    @property
    def kind(self) -> str:
        """What the task is: "trajectory", "workspace" or "scene"."""
        return next(kind for kind in TASKS if getattr(self, kind) is not None)

    @property
    def wanted(self) -> dict[str, str]:
        """What is measured, by the name of its column."""
        return self.measure if isinstance(self.measure, dict) else {word: word for word in self.measure}


class Study(Schema):
    """A whole study file."""

    robot: RobotTable
    designs: DesignsTable
    parameters: Annotated[dict[Name, ParameterTable], Field(min_length=1)]
    numbers: dict[str, str] = Field(default_factory=dict)
    tasks: Annotated[dict[Name, TaskTable], Field(min_length=1)]

    @model_validator(mode="after")
    def _values(self) -> Study:
        for name, one in self.parameters.items():
            if self.designs.method != "table":
                try:
                    exactly_one(one, "range", "normal", "values")
                except ValueError as error:
                    raise ValueError(f"parameter '{name}': {error}") from None
            elif one.range or one.normal or one.values:
                raise ValueError(f"parameter '{name}': its values are those of the table")
            if self.designs.method == "grid" and not (one.values or one.steps):
                raise ValueError(f"parameter '{name}': a grid needs 'values', or a 'range' with 'steps'")
        return self


#: Columns beside gradients: the smallest singular value of the loops' rows, and the least part that it is of
#: the largest.
MARGINS = ("closing", "conditioning")
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
    def gradient_columns(self) -> list[str]:
        """Columns of the derivatives of measures, of `MARGINS` and of their derivatives, by measure."""
        names = self.study.parameters
        over = {value: [f"{value}.d_{name}" for name in names] for value in (*self.columns, *MARGINS)}
        beside = [column for value in MARGINS for column in (value, *over[value])]
        return [*(column for value in self.columns for column in over[value]), *beside]

    @property
    def files(self) -> list[str]:
        """Absolute paths of the files that the study reads, without those that the robot includes."""
        found = [self.robot, *([self.beside(self.study.designs.table)] if self.study.designs.table else [])]
        for task in self.study.tasks.values():
            found += [self.beside(task.trajectory)] if task.trajectory else []
            of_scene = files_of(read_scene(self.beside(task.scene))) if task.scene else []
            found += [path for path in of_scene if Path(path).is_file()]
            found += [self.beside(python_of(word)[0]) for word in task.wanted.values() if PYTHON in word]
        return list(dict.fromkeys(found))


def python_of(word: str) -> tuple[str, str]:
    """Split `file.py:function` into file and function."""
    file, _, function = word.rpartition(":")
    return file, function
