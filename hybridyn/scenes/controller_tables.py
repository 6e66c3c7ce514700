"""Tables of a scene that state motions and controllers."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat, model_validator

from ..description.side_cars.tables import Schema

NotNegative = Annotated[FiniteFloat, Field(ge=0)]

Six = Annotated[list[FiniteFloat], Field(min_length=6, max_length=6)]
Seven = Annotated[list[FiniteFloat], Field(min_length=7, max_length=7)]

ByJoint = dict[str, FiniteFloat]
Gains = NotNegative | dict[str, NotNegative]
Coordinate = Literal["x", "y", "z", "roll", "pitch", "yaw"]
Turn = Literal["qx", "qy", "qz", "qw", "rx", "ry", "rz"]
Further = Literal["xx", "xy", "xz", "yx", "yy", "yz", "zx", "zy", "zz", "distance", "cx", "cy", "cz"]
Poses = dict[str, Seven | dict[Coordinate | Turn | Further, FiniteFloat]]
Twists = dict[str, Six | dict[Coordinate | Further | Literal["wx", "wy", "wz"], FiniteFloat]]


def exactly_one(table: Schema, *keys: str) -> None:
    """Check that a table has exactly one of some keys.

    Raises:
        ValueError: It has none or several; the message names them.
    """
    given = [key for key in keys if getattr(table, key) is not None]
    if len(given) != 1:
        raise ValueError(f"give one of {', '.join(keys)}, not {' and '.join(given) or 'none'}")


class PointTable(Schema):
    """[[...points]]: a time, and the posture at rest at that time."""

    time: NotNegative
    joints: ByJoint = Field(default_factory=dict)
    platforms: Poses = Field(default_factory=dict)


class ReferenceTable(Schema):
    """A reference motion: a table, or points with quintic motions between them."""

    table: str | None = None
    points: Annotated[list[PointTable], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _one(self) -> ReferenceTable:
        exactly_one(self, "table", "points")
        times = [point.time for point in self.points or ()]
        if any(later <= earlier for earlier, later in pairwise(times)):
            raise ValueError("the times of points must grow")
        return self


class EffortsTable(Schema):
    """[controller] kind = "efforts": efforts over time, or constant ones."""

    kind: Literal["efforts"]
    table: str | None = None
    efforts: ByJoint | None = None

    @model_validator(mode="after")
    def _one(self) -> EffortsTable:
        exactly_one(self, "table", "efforts")
        return self


class PdTable(Schema):
    """[controller] kind = "pd": tau = kp (x_d - x) + kd (x_d' - x')."""

    kind: Literal["pd"]
    kp: Gains
    kd: Gains
    reference: ReferenceTable


class TorqueTable(Schema):
    """[controller] kind = "computed_torque": the inverse model of x_d'' + kd (x_d' - x') + kp (x_d - x)."""

    kind: Literal["computed_torque"]
    kp: Gains
    kd: Gains
    reference: ReferenceTable
    effects: list[str] | None = None


class PythonTable(Schema):
    """[controller] kind = "python": a function in a file beside the scene; see `controllers.from_file`."""

    kind: Literal["python"]
    file: str
    function: str = "controller"


CONTROLLERS: dict[str, type[Schema]] = {
    "efforts": EffortsTable, "pd": PdTable, "computed_torque": TorqueTable, "python": PythonTable
}  # fmt: skip
