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
from typing import Annotated, Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, create_model

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

    def stated(self) -> dict[str, Any]:
        """Return the values by key, tables too, without keys that are left out and have no default."""
        return self.model_dump(exclude_none=True)


class Open(Schema):
    """Base class of the schemas of files with keys for others, too."""

    model_config = ConfigDict(extra="ignore")


def table(name: str, base: type[Schema] = Schema, /, **keys: Any) -> Any:
    """Return the schema of a table.

    Args:
        name: Name of the table.
        base: Its base class.
        keys: Type of the value of each key. A key whose type allows None may be left out, and so may one with
            a type and a default.
    """
    given: dict[str, Any] = {
        key: of if isinstance(of, tuple) else (of, None if type(None) in get_args(of) else ...)
        for key, of in keys.items()
    }
    return create_model(name, __base__=base, **given)


#: Keys of the effects that model.toml may state; payloads, wrenches and base motions belong to scenes. A
#: missing level of dry friction is taken from `[joints]` or URDF, and missing limits of stops from URDF.
EFFECTS: dict[str, dict[str, Any]] = {
    "coulomb_friction": {"level": ByJoint | None, "width": Positive | None},
    "stribeck_friction": {"level": ByJoint, "static": ByJoint, "speed": ByJoint, "width": Positive | None},
    "spring": {"stiffness": ByJoint, "rest": dict[str, FiniteFloat] | None},
    "damper": {"coefficient": ByJoint},
    "stop": {
        "stiffness": ByJoint, "damping": NotNegative | None, "lower": dict[str, FiniteFloat] | None,
        "upper": dict[str, FiniteFloat] | None,
    },
    "ground_contact": {
        "points": dict[str, list[Point]], "stiffness": Positive, "damping": NotNegative | None,
        "friction": NotNegative | None, "width": Positive | None, "height": FiniteFloat | None,
    },
}  # fmt: skip

EffectTables: Any = table(
    "EffectTables", **{name: table(name, **keys) | None for name, keys in EFFECTS.items()}
)

#: The numbers that model.toml may state for one joint; see `records.Joint`.
JointNumbers: Any = table(
    "JointNumbers", rotor_inertia=NotNegative | None, gear_ratio=FiniteFloat | None,
    damping=NotNegative | None, friction=NotNegative | None,
)  # fmt: skip

#: A linear relation between joint positions; see `records.Coupling`.
CouplingTable: Any = table(
    "CouplingTable", terms=Annotated[dict[str, FiniteFloat], Field(min_length=1)], offset=(FiniteFloat, 0.0)
)

#: The tables of model.toml.
ModelFile: Any = table(
    "ModelFile",
    motors=list[str] | None,
    home=(dict[str, FiniteFloat | list[FiniteFloat]], {}),
    joints=(dict[str, JointNumbers], {}),
    couplings=(dict[str, CouplingTable], {}),
    closures=(dict[str, Literal["fixed", "revolute", "spherical"]], {}),
    effects=(EffectTables, EffectTables()),
)


def checked(text: bytes, file: str) -> dict[str, Any]:
    """Check the text of a model file and return its content, with defaults where keys are left out.

    Raises:
        ModelError: The text is not TOML, or a key or value is wrong; the message names the line.
    """
    plain, content = parse_toml(text, file)
    try:
        return dict(ModelFile.model_validate(content).stated())
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
    if problem["type"] == "missing":
        return place, f"'{place[-1]}' is missing"
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
