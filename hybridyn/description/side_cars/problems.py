"""What pydantic finds wrong in a file, in one line: the problem, its key, and the key probably meant."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from pydantic import ValidationError

from ..names import did_you_mean, listed
from .toml_file import Keys

#: The type of the error of an unknown key.
UNKNOWN: Final = "unknown_key"


def first_problem(error: ValidationError, content: Any, kinds: Iterable[str] = ()) -> tuple[Keys, str]:
    """Return keys and text of the most specific problem: an unknown key, else the most deeply nested one.

    Args:
        error: What pydantic found.
        content: The content of the file.
        kinds: Values of the key `kind` of tables that it tells apart.
    """
    found = [(_keys(problem["loc"], content, problem["type"]), problem) for problem in error.errors()]
    keys, problem = max(found, key=lambda pair: (pair[1]["type"] == UNKNOWN, len(pair[0])))
    kind, text = problem["type"], problem["msg"].removeprefix("Value error, ")
    if kind == UNKNOWN:
        keys = (*keys, problem["ctx"]["key"])
    elif kind in ("union_tag_invalid", "union_tag_not_found"):
        given = str(problem.get("ctx", {}).get("tag", ""))
        return (*keys, "kind"), f"must be one of {listed(kinds)}{did_you_mean(given, kinds)}"
    elif kind == "missing":
        text = f"'{keys[-1]}' is missing"
    elif kind in ("model_type", "dict_type"):
        text = f"should hold keys with values, not {_kind_of(problem['input'])}"
    elif kind == "string_pattern_mismatch":
        text = "a name has letters, digits and underscores, and begins with no digit"
    return keys, text.replace("Input should", "should")


def _kind_of(value: object) -> str:
    """Return what a value is that should be a table."""
    if isinstance(value, list) and value and all(isinstance(one, dict) for one in value):
        return "a list of tables (write one, [...] instead of [[...]])"
    words = {list: "a list", str: "a text", bool: "true or false", int: "a number", float: "a number"}
    return words.get(type(value), "nothing")


def _keys(place: Keys, content: Any, kind: str) -> Keys:
    """Return the keys of a problem as they are in the file, without pydantic's marks of alternatives."""
    out: list[str | int] = []
    for i, part in enumerate(place):
        inside = isinstance(content, dict) and part in content
        if inside or (isinstance(content, list) and isinstance(part, int) and part < len(content)):
            content = content[part]
            out.append(part)
        elif kind == "missing" and i == len(place) - 1:
            out.append(part)
    return tuple(out)
