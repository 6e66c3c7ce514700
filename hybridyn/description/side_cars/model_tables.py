"""Define the tables of `model.toml`, and check its text; only a text that was never read needs it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, FiniteFloat, ValidationError

from ...errors import ModelError
from .effect_tables import EffectTables, known_keys
from .schema import Schema, first_problem
from .toml_file import line_of, parse_toml

NotNegative = Annotated[FiniteFloat, Field(ge=0)]


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
        model = ModelFile.model_validate(content)
        return model.model_dump(exclude_none=True)
    except ValidationError as error:
        known = [*ModelFile.model_fields]
        if error.errors()[0]["loc"][:1] == ("joints",):
            known = [*JointNumbers.model_fields]
        if error.errors()[0]["loc"][:1] == ("couplings",):
            known = [*CouplingTable.model_fields]
        if error.errors()[0]["loc"][:1] == ("effects",):
            known = known_keys(error.errors()[0]["loc"])
        place, message = first_problem(error, known)
        keys = tuple(str(part) for part in place)
        key = ".".join(keys)
        raise ModelError(f"'{key}': {message}", file=file, line=line_of(plain, keys), element=key) from None
