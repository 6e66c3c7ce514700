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

from ...description.shipped import find_robot
from ...scenes.scene_file import read_scene
from ...scenes.stage import files_of
from ...scenes.toml_source import TomlSource, naming
from .study_tables import Study

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
            of_scene = files_of(read_scene(self.beside(task.scene))) if task.scene else []
            found += [path for path in of_scene if Path(path).is_file()]
            found += [self.beside(python_of(word)[0]) for word in task.wanted.values() if PYTHON in word]
        return list(dict.fromkeys(found))


def python_of(word: str) -> tuple[str, str]:
    """Split `file.py:function` into file and function."""
    file, _, function = word.rpartition(":")
    return file, function
