"""Define the tables of physical effects in files, `[effects.NAME]`: the keys of each effect and their types.

    [effects.spring]
    stiffness = { elbow = 40.0 }
    rest = { elbow = 0.1 }
    [effects.ground_contact]
    points = { foot = [[0, 0, -0.05]] }
    stiffness = 2e4

The laws and units are documented in `hybridyn.effects`; the numbers become the parameters of its objects.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, FiniteFloat

from .schema import Schema

NotNegative = Annotated[FiniteFloat, Field(ge=0)]
Positive = Annotated[FiniteFloat, Field(gt=0)]
ByJoint = dict[str, NotNegative]
Point = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]


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


def known_keys(place: tuple[str | int, ...]) -> list[str]:
    """Return the keys known at a place below `effects`, for "did you mean"."""
    if len(place) < 3:
        return [*EffectTables.model_fields]
    tables: dict[str, type[Schema]] = {
        "coulomb_friction": CoulombTable, "stribeck_friction": StribeckTable, "spring": SpringTable,
        "damper": DamperTable, "stop": StopTable, "ground_contact": GroundTable,
    }  # fmt: skip
    return [*tables[str(place[1])].model_fields]
