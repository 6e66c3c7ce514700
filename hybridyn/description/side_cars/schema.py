"""Turn pydantic's errors into one-line messages: the problem, its key, and the key probably meant."""

from __future__ import annotations

from collections.abc import Iterable

from pydantic import BaseModel, ConfigDict, ValidationError

from ..names import did_you_mean, listed


class Schema(BaseModel):
    """Base class of the schemas of side-car files: unknown keys are errors, texts are not numbers."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


def first_problem(error: ValidationError, known: Iterable[str]) -> tuple[tuple[str | int, ...], str]:
    """Return the place (keys and indices) and the message of the first problem that pydantic found."""
    problem = min(error.errors(), key=lambda entry: entry["type"] != "extra_forbidden")
    place = tuple(problem["loc"])
    if problem["type"] == "extra_forbidden":
        names = list(known)
        key = str(place[-1])
        return place, f"unknown key '{key}'{did_you_mean(key, names)}; known: {listed(names)}"
    return place, problem["msg"].removeprefix("Value error, ")
