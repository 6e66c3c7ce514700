"""Scene files: their tables and keys, and how they are read.

One TOML file states robot, start, controller, effects and duration of a simulation:

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
from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat, model_validator

from ..assembly.redundancy import LEAST, Rule
from ..description.shipped import find_robot
from ..description.side_cars.tables import EffectTables, Schema, table
from ..errors import TrajectoryError
from ..simulation.solver import Solver
from .added_controllers import kinds_of_controllers
from .controller_tables import (
    ByJoint,
    EffortsTable,
    NotNegative,
    PdTable,
    Poses,
    PythonTable,
    ReferenceTable,
    Six,
    TorqueTable,
    Twists,
    exactly_one,
)
from .toml_source import TomlSource, read_schema

Positive = Annotated[FiniteFloat, Field(gt=0)]
Three = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]


class RobotTable(Schema):
    """[robot]: the arguments of `hybridyn.load`."""

    file: str
    base: Literal["fixed", "moving", "floating"] | None = None
    gravity: Three | None = None
    motors: list[str] | None = None
    xacro: dict[str, str | bool | int | float] = Field(default_factory=dict)
    package_dirs: list[str] = Field(default_factory=list)
    strict: bool = False

    def stricter(self, strict: bool) -> RobotTable:
        """Return the table with `strict` set, too, where asked."""
        return self.model_copy(update={"strict": self.strict or strict})


class RatesTable(Schema):
    """[initial.rates]."""

    joints: ByJoint = Field(default_factory=dict)
    platforms: Twists = Field(default_factory=dict)


class InitialTable(Schema):
    """[initial]: positions of joints and poses of platforms, from which the start is assembled."""

    joints: ByJoint = Field(default_factory=dict)
    platforms: Poses = Field(default_factory=dict)
    rates: RatesTable = Field(default_factory=RatesTable)
    on_reference: bool = False
    project: bool = False


class PayloadTable(Schema):
    """[[effects.payload]]."""

    link: str
    mass: NotNegative
    com: Three = [0.0, 0.0, 0.0]  # noqa: RUF012
    inertia: Annotated[list[Three], Field(min_length=3, max_length=3)] | None = None


class WrenchTable(Schema):
    """[[effects.wrench]]: constant, or over time from a table."""

    link: str
    wrench: Six | None = None
    table: str | None = None
    frame: Literal["link", "world"] = "link"

    @model_validator(mode="after")
    def _one(self) -> WrenchTable:
        exactly_one(self, "wrench", "table")
        return self


#: Keys of the effects that scenes alone may state.
EFFECTS: dict[str, dict[str, Any]] = {
    "rotor_inertia": {"inertia": dict[str, NotNegative]},
    "viscous_friction": {"coefficient": dict[str, NotNegative]},
    "limits": {"effort": dict[str, Positive] | None},  # where left out, the limits of the robot's files
    "base_motion": {"table": str},
}
Numbers: Any = table(
    "Numbers", EffectTables, **{name: table(name, **keys) | None for name, keys in EFFECTS.items()}
)


class SceneEffects(Numbers):  # type: ignore[misc]
    """[effects]: the names of effects, and their numbers; others are not computed."""

    use: str | list[str] = "default"
    payload: list[PayloadTable] = Field(default_factory=list)
    wrench: list[WrenchTable] = Field(default_factory=list)


class SolverTable(Schema):
    """[solver]: the fields of `simulation.solver.Solver`."""

    method: Literal["dopri5", "rk4", "implicit", "conserving"] = "dopri5"
    step: Positive | None = None
    rtol: Positive = 1e-8
    atol: Positive = 1e-10
    stiction: bool = False

    @model_validator(mode="after")
    def _fits(self) -> SolverTable:
        try:
            Solver(**self.model_dump())
        except TrajectoryError as error:
            raise ValueError(str(error)) from None
        return self


class OutputTable(Schema):
    """[output]: times, columns and file of the result."""

    rate: Positive | None = None
    columns: Annotated[list[str], Field(min_length=1)] | None = None
    file: str | None = None


class EventTable(Schema):
    """[[events]]: a joint's position, a coordinate of a link's origin, or a singularity."""

    name: str | None = None
    joint: str | None = None
    link: str | None = None
    singularity: Literal["closures", "motors"] | None = None
    axis: Literal["x", "y", "z"] = "z"
    at: FiniteFloat
    direction: Literal["rising", "falling", "both"] = "both"
    stop: bool = True

    @model_validator(mode="after")
    def _one(self) -> EventTable:
        exactly_one(self, "joint", "link", "singularity")
        return self

    @property
    def title(self) -> str:
        """The name, or else what happens."""
        if self.name is not None:
            return self.name
        if self.singularity is not None:
            return f"singularity of the {self.singularity}"
        return f"{self.joint} at {self.at:g}" if self.joint else f"{self.link} at {self.axis} = {self.at:g}"


class Scene(Schema):
    """A whole scene."""

    robot: RobotTable
    duration: Positive
    redundancy: Rule = LEAST
    initial: InitialTable = Field(default_factory=InitialTable)
    motion: ReferenceTable | None = None
    controller: (
        Annotated[EffortsTable | PdTable | TorqueTable | PythonTable, Field(discriminator="kind")] | None
    ) = None
    effects: SceneEffects = Field(default_factory=SceneEffects)
    solver: SolverTable = Field(default_factory=SolverTable)
    output: OutputTable = Field(default_factory=OutputTable)
    events: list[EventTable] = Field(default_factory=list)

    @model_validator(mode="after")
    def _either(self) -> Scene:
        if self.motion is not None and self.controller is not None:
            raise ValueError("give [motion] or [controller], not both")
        return self


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


def read_scene(path: str | Path, *, strict: bool = False) -> SceneFile:
    """Read a scene. `strict`: whether notes on its robot are errors, although the scene may not say so.

    Raises:
        ModelError: The file cannot be read, is not TOML, or has a wrong key or value; the message names file,
            line and key.
    """
    source, scene = read_schema(path, Scene, kinds_of_controllers)
    scene = scene.model_copy(update={"robot": scene.robot.stricter(strict)})
    return SceneFile(source.file, source.text, scene)
