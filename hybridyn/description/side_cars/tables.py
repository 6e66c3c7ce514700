"""Define the tables of side-car files, their keys and the types of their values.

    [effects.spring]
    stiffness = { elbow = 40.0 }
    rest = { elbow = 0.1 }
    [effects.ground_contact]
    points = { foot = [[0, 0, -0.05]] }
    stiffness = 2e4

The laws and units of effects are documented in `hybridyn.effects`; the numbers become the parameters of its
objects.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args, get_type_hints

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PydanticSchemaGenerationError,
    TypeAdapter,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import PydanticCustomError

from ...errors import ModelError
from ...extensions import added, added_names, refused
from ..names import did_you_mean, listed
from .problems import UNKNOWN, first_problem
from .toml_file import Keys, line_of, parse_toml

NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
ByJoint = dict[str, NotNegative]
Coefficients = Annotated[list[FiniteFloat], Field(min_length=1, max_length=8)]
Quaternion = Annotated[list[FiniteFloat], Field(min_length=4, max_length=4)]
Point = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
Three = Annotated[list[NotNegative], Field(min_length=3, max_length=3)]
Pose = Annotated[list[FiniteFloat], Field(min_length=7, max_length=7)]


File = TypeVar("File", bound=BaseModel)


class Schema(BaseModel):
    """Base class of the schemas of side-car files: unknown keys are errors, texts are not numbers."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown(cls, content: Any) -> Any:
        """Refuse the first key that is not known, and name those that are."""
        for key in content if isinstance(content, dict) and cls.model_config["extra"] == "forbid" else ():
            if key not in cls.model_fields:
                known = cls.names()
                about = {"key": key, "hint": did_you_mean(str(key), known), "known": listed(known)}
                raise PydanticCustomError(UNKNOWN, "unknown key '{key}'{hint}; known: {known}", about)
        return content

    @classmethod
    def names(cls) -> Iterable[str]:
        """Return the keys that are known."""
        return cls.model_fields

    def stated(self) -> dict[str, Any]:
        """Return the values by key, tables too, without keys that are left out and have no default."""
        return self.model_dump(exclude_none=True)


class OfEffects(Schema):
    """Base class of the tables of effects, some of which may be of other packages."""

    @classmethod
    def names(cls) -> Iterable[str]:
        """Return the names of effects that are known."""
        return dict.fromkeys([*cls.model_fields, *added_names("effects")])


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


#: Keys of the effects that model.toml may state; wrenches and base motions belong to scenes. A payload is
#: part of the robot under any effects. A missing level of dry friction is taken from `[joints]` or URDF, and
#: missing limits of stops from URDF.
EFFECTS: dict[str, dict[str, Any]] = {
    "coulomb_friction": {"level": ByJoint | None, "width": Positive | None},
    "stribeck_friction": {"level": ByJoint, "static": ByJoint, "speed": ByJoint, "width": Positive | None},
    "directed_friction": {"forward": ByJoint, "backward": ByJoint, "width": Positive | None},
    "spring": {"stiffness": ByJoint, "rest": dict[str, FiniteFloat] | None},
    "damper": {"coefficient": ByJoint},
    "stop": {
        "stiffness": ByJoint, "damping": NotNegative | None, "lower": dict[str, FiniteFloat] | None,
        "upper": dict[str, FiniteFloat] | None,
    },
    "polynomial_spring": {"coefficients": dict[str, Coefficients], "rest": dict[str, FiniteFloat] | None},
    "polynomial_damper": {"coefficients": dict[str, Coefficients]},
    "ball_spring": {"stiffness": ByJoint, "rest": dict[str, Quaternion] | None},
    "tendons": {
        "arms": dict[str, dict[str, FiniteFloat]], "stiffness": ByJoint | None, "damping": ByJoint | None,
        "friction": ByJoint | None, "lower": dict[str, FiniteFloat] | None,
        "upper": dict[str, FiniteFloat] | None, "width": Positive | None,
    },
    "gravity_compensation": {"fraction": dict[str, FiniteFloat]},
    "line_springs": {
        "ends": dict[str, Annotated[list[str], Field(min_length=2)]], "points": dict[str, list[Point]],
        "stiffness": ByJoint | None, "damping": ByJoint | None, "friction": ByJoint | None,
        "lower": ByJoint | None, "upper": ByJoint | None, "width": Positive | None,
        "shares": dict[str, Annotated[list[NotNegative], Field(min_length=1)]] | None,
    },
    "bushings": {
        "ends": dict[str, Annotated[list[str], Field(min_length=2, max_length=2)]],
        "frames": dict[str, Annotated[list[Pose], Field(min_length=2, max_length=2)]] | None,
        "torque_stiffness": dict[str, Three] | None, "torque_damping": dict[str, Three] | None,
        "force_stiffness": dict[str, Three] | None, "force_damping": dict[str, Three] | None,
    },
    "ground_contact": {
        "points": dict[str, list[Point]], "stiffness": Positive, "damping": NotNegative | None,
        "friction": NotNegative | None, "width": Positive | None, "height": FiniteFloat | None,
    },
    "load_friction": {
        "radial": ByJoint | None, "axial": ByJoint | None, "tilt": ByJoint | None, "normal": ByJoint | None,
        "static": ByJoint | None, "speed": ByJoint | None, "width": Positive | None,
    },
    "gear_efficiency": {
        "efficiency": dict[str, Positive], "back": dict[str, FiniteFloat] | None, "width": Positive | None,
    },
    "dc_motors": {
        "torque_constant": dict[str, Positive], "resistance": dict[str, Positive],
        "voltage": dict[str, Positive] | None, "current": dict[str, Positive] | None,
    },
    "payload": {
        "link": str, "mass": NotNegative, "com": Point | None,
        "inertia": Annotated[list[Point], Field(min_length=3, max_length=3)] | None,
    },
}  # fmt: skip

EffectTables: Any = table(
    "EffectTables", OfEffects, **{name: table(name, **keys) | None for name, keys in EFFECTS.items()}
)


def with_added_effects(schema: type[File], content: Mapping[str, Any]) -> type[File]:
    """Return the schema of a file, whose table `effects` has the effects of other packages that it states.

    Args:
        schema: The schema without them.
        content: The content of the file.

    Raises:
        ModelError: A package adds an effect that cannot be used.
    """
    own, stated = schema.model_fields.get("effects"), content.get("effects")
    base = None if own is None else own.annotation
    if not (isinstance(base, type) and issubclass(base, OfEffects) and isinstance(stated, dict)):
        return schema
    names = [name for name in stated if name not in base.model_fields]
    added_ones = {name: kind for name in names if (kind := added("effects", name)) is not None}
    if not added_ones:
        return schema
    tables = {
        name: table(name, **keys_of("effects", name, kind.__module__.partition(".")[0], kind)) | None
        for name, kind in added_ones.items()
    }
    extended = table(base.__name__, base, **tables)
    return create_model(schema.__name__, __base__=schema, effects=(extended, ...))


def keys_of(kind: str, name: str, package: str, make: Callable[..., Any], given: int = 0) -> dict[str, Any]:
    """Return the keys of a table for what another package adds: the arguments of its class or function.

    Args:
        kind: One of `extensions.KINDS`.
        name: Its name.
        package: Its package.
        make: The class or function.
        given: Number of its first arguments that no file states.

    Raises:
        ModelError: One has no type, or one that TOML has no values for.
    """
    try:
        known = dict([*inspect.signature(make).parameters.items()][given:])
        types = get_type_hints(vars(make).get("__init__", make) if isinstance(make, type) else make)
        keys = {
            key: types[key] if one.default is one.empty else types[key] | None for key, one in known.items()
        }
        for of in keys.values():
            TypeAdapter(of)
    except (NameError, KeyError, TypeError, PydanticSchemaGenerationError) as error:
        told = " ".join(str(error).split())[:80]
        raise refused(
            kind, name, package,
            f"cannot be stated in a file ({told}): give its arguments types such as "
            "float, str, Sequence[float], Mapping[str, float]",
        ) from None  # fmt: skip
    return keys


#: The numbers that model.toml may state for one joint; see `records.Joint`.
JointNumbers: Any = table(
    "JointNumbers", rotor_inertia=NotNegative | None, gear_ratio=FiniteFloat | None,
    damping=NotNegative | None, friction=NotNegative | None,
)  # fmt: skip

#: What bends a relation between joint positions; see `records.Curve`.
CurveTable: Any = table(
    "CurveTable", terms=Annotated[dict[str, FiniteFloat], Field(min_length=1)],
    coefficients=Coefficients,
    reference=(FiniteFloat, 0.0),
)  # fmt: skip

#: A relation between joint positions; see `records.Coupling`.
CouplingTable: Any = table(
    "CouplingTable", terms=Annotated[dict[str, FiniteFloat], Field(min_length=1)], offset=(FiniteFloat, 0.0),
    curve=CurveTable | None,
)  # fmt: skip

#: A closure of another package, see `residuals`.
ResidualTable: Any = table(
    "ResidualTable", closure=str, joints=(list[str], []), frames=(list[str], []),
    numbers=(dict[str, Any], {}), zeros=(dict[str, FiniteFloat], {}),
)  # fmt: skip

#: The tables of model.toml.
ModelFile: Any = table(
    "ModelFile",
    motors=list[str] | None,
    home=(dict[str, FiniteFloat | list[FiniteFloat]], {}),
    joints=(dict[str, JointNumbers], {}),
    couplings=(dict[str, CouplingTable], {}),
    residuals=(dict[str, ResidualTable], {}),
    closures=(dict[str, Literal["fixed", "revolute", "spherical"]], {}),
    effects=(EffectTables, EffectTables()),
)


def checked(text: bytes, file: str) -> dict[str, Any]:
    """Check the text of a model file and return its content, with defaults where keys are left out.

    Raises:
        ModelError: The text is not TOML, or a key or value is wrong; the message names the line.
    """
    plain, content = parse_toml(text, file)
    inside: Keys = ()
    try:
        out = dict(with_added_effects(ModelFile, content).model_validate(content).stated())
        for name, stated in out["residuals"].items():
            inside, content = ("residuals", name, "numbers"), stated["numbers"]
            line = line_of(plain, ("residuals", name))
            allowed = _keys_of_closure(stated["closure"], name, file, line)
            stated["numbers"] = table("Numbers", **allowed).model_validate(content).stated()
        return out
    except ValidationError as error:
        place, message = first_problem(error, content)
        keys = tuple(str(part) for part in (*inside, *place))
        key = ".".join(keys)
        raise ModelError(f"'{key}': {message}", file=file, line=line_of(plain, keys), element=key) from None


def _keys_of_closure(closure: str, name: str, file: str, line: int | None) -> dict[str, Any]:
    """Return the keys of the numbers of a closure of another package.

    Raises:
        ModelError: No package adds it, or it cannot be used.
    """
    if (maker := added("closures", closure)) is None:
        known = added_names("closures")
        hint = f"{did_you_mean(closure, known)}; packages add: {listed(known) or 'none'}"
        text = f"'residuals.{name}': there is no closure '{closure}'{hint}"
        raise ModelError(text, file=file, line=line, element=name)
    return keys_of("closures", closure, maker.package, maker.make, given=1)
