"""Define the tables of side-car files, their keys and the types of their values.

    [effects.spring]
    stiffness = { elbow = 40.0 }
    rest = { elbow = 0.1 }
    [effects.ground_contact]
    points = { foot = [[0, 0, -0.05]] }
    stiffness = 2e4

The laws and units of effects are documented in `hybridyn.effects`; the numbers become the parameters of its
objects. pydantic's errors become one-line messages: the problem, its key, and the key probably meant.
"""

from __future__ import annotations

import typing
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from ...errors import ModelError
from ..names import did_you_mean, listed
from .toml_file import Keys, line_of, parse_toml

NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
ByJoint = dict[str, NotNegative]
Point = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]


class Schema(BaseModel):
    """Base class of the schemas of side-car files: unknown keys are errors, texts are not numbers."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class CoulombTable(Schema):
    """Dry friction; a missing level is taken from `[joints]` or URDF."""

    level: ByJoint | None = None
    width: Positive | None = None


class StribeckTable(Schema):
    """Dry friction that is larger near rest."""

    level: ByJoint
    static: ByJoint
    speed: ByJoint
    width: Positive | None = None


class SpringTable(Schema):
    """Joint springs."""

    stiffness: ByJoint
    rest: dict[str, FiniteFloat] | None = None


class DamperTable(Schema):
    """Joint dampers."""

    coefficient: ByJoint


class StopTable(Schema):
    """Joint stops; missing limits are taken from URDF."""

    stiffness: ByJoint
    damping: NotNegative | None = None
    lower: dict[str, FiniteFloat] | None = None
    upper: dict[str, FiniteFloat] | None = None


class GroundTable(Schema):
    """Points on compliant ground."""

    points: dict[str, list[Point]]
    stiffness: Positive
    damping: NotNegative | None = None
    friction: NotNegative | None = None
    width: Positive | None = None
    height: FiniteFloat | None = None


class EffectTables(Schema):
    """The effects that model.toml may state; payloads, wrenches and base motions belong to scenes."""

    coulomb_friction: CoulombTable | None = None
    stribeck_friction: StribeckTable | None = None
    spring: SpringTable | None = None
    damper: DamperTable | None = None
    stop: StopTable | None = None
    ground_contact: GroundTable | None = None

    def stated(self) -> tuple[tuple[str, dict[str, Any]], ...]:
        """Return the effects as pairs (name, numbers by key), as in `Description.effects`."""
        return tuple(self.model_dump(exclude_none=True).items())


class JointNumbers(Schema):
    """The numbers that model.toml may state for one joint; see `records.Joint`."""

    rotor_inertia: NotNegative | None = None
    gear_ratio: FiniteFloat | None = None
    damping: NotNegative | None = None
    friction: NotNegative | None = None


class CouplingTable(Schema):
    """A linear relation between joint positions; see `records.Coupling`."""

    terms: Annotated[dict[str, FiniteFloat], Field(min_length=1)]
    offset: FiniteFloat = 0.0


class ModelFile(Schema):
    """The tables of model.toml; a new table is a new field."""

    motors: list[str] | None = None
    home: dict[str, FiniteFloat | list[FiniteFloat]] = Field(default_factory=dict)
    joints: dict[str, JointNumbers] = Field(default_factory=dict)
    couplings: dict[str, CouplingTable] = Field(default_factory=dict)
    closures: dict[str, Literal["fixed", "revolute", "spherical"]] = Field(default_factory=dict)
    effects: EffectTables = Field(default_factory=EffectTables)


def checked(text: bytes, file: str) -> dict[str, Any]:
    """Check the text of a model file and return its content, with defaults where keys are left out.

    Raises:
        ModelError: The text is not TOML, or a key or value is wrong; the message names the line.
    """
    plain, content = parse_toml(text, file)
    try:
        return ModelFile.model_validate(content).model_dump(exclude_none=True)
    except ValidationError as error:
        place, message = first_problem(error, ModelFile)
        keys = tuple(str(part) for part in place)
        key = ".".join(keys)
        raise ModelError(f"'{key}': {message}", file=file, line=line_of(plain, keys), element=key) from None


def first_problem(error: ValidationError, schema: type[Schema]) -> tuple[Keys, str]:
    """Return the place (keys and indices) and the message of the first problem that pydantic found."""
    problem = min(error.errors(), key=lambda entry: entry["type"] != "extra_forbidden")
    place = tuple(problem["loc"])
    if problem["type"] == "extra_forbidden":
        names, key = keys_at(schema, place[:-1]), str(place[-1])
        return place, f"unknown key '{key}'{did_you_mean(key, names)}; known: {listed(names)}"
    return place, problem["msg"].removeprefix("Value error, ")


def keys_at(schema: type[Schema], place: Keys) -> list[str]:
    """Return the keys that are known in the table at a place of a schema."""
    for part in place:
        if part in schema.model_fields:
            schema = next(iter(schemas_in(schema.model_fields[str(part)].annotation)), schema)
    return [*schema.model_fields]


def schemas_in(annotation: Any) -> list[type[Schema]]:
    """Return the schemas in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Schema):
        return [annotation]
    return [schema for part in typing.get_args(annotation) for schema in schemas_in(part)]
