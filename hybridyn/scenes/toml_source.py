"""A TOML file with a schema, as a scene or a study: its content, and errors with file, line and key."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from ..description.names import did_you_mean, listed
from ..description.reading import read_bytes
from ..description.side_cars.tables import Schema, schemas_in
from ..description.side_cars.toml_file import Keys, line_of, parse_toml
from ..errors import HybridynError, ModelError

Whole = TypeVar("Whole", bound=Schema)
#: Schemas of the tables whose key `kind` says which they are, by kind.
Kinds = Mapping[str, type[Schema]]


@dataclass(frozen=True)
class TomlSource:
    """A file and its text.

    Attributes:
        file: Path as the user gave it.
    """

    file: str
    text: str

    def error(self, keys: Keys, message: str) -> ModelError:
        """Build an error that names file, line and key."""
        key = ".".join(str(part) for part in keys if isinstance(part, str))
        return ModelError(f"'{key}': {message}", file=self.file, line=line_of(self.text, keys), element=key)

    def check(self, keys: Keys, what: str, name: str, known: Collection[str]) -> None:
        """Refuse a name that is not known; the error names file, line and key, and the nearest name.

        Args:
            what: What it should be the name of.
        """
        if name not in known:
            raise self.error(keys, f"'{name}' is no {what}{did_you_mean(name, known)}")


@contextmanager
def naming(source: TomlSource, keys: Keys) -> Iterator[None]:
    """Give an error file, line and key as its place."""
    try:
        yield
    except HybridynError as error:
        if not f"{error.place}:".startswith(f"{source.file}:"):
            here = source.error(keys, "")
            error.within(f"{here.place}: '{here.element}'")
        raise


def read_schema(path: str | Path, schema: type[Whole], kinds: Kinds) -> tuple[TomlSource, Whole]:
    """Read a file, and check its content.

    Raises:
        ModelError: The file cannot be read, is not TOML, or has a wrong key or value; the message names file,
            line and key.
    """
    file = str(path)
    text, content = parse_toml(read_bytes(file), file)
    try:
        return TomlSource(file, text), schema.model_validate(content)
    except ValidationError as error:
        keys, message = _problem(error, schema, content, kinds)
        key = ".".join(str(part) for part in keys)
        line = line_of(text, keys)
        raise ModelError(
            f"'{key}': {message}" if key else message, file=file, line=line, element=key
        ) from None


def _problem(
    error: ValidationError, schema: type[Schema], content: dict[str, Any], kinds: Kinds
) -> tuple[Keys, str]:
    """Return keys and text of the most specific problem: an unknown key, else the most deeply nested one."""
    found = [(_keys(problem["loc"], content, problem["type"]), problem) for problem in error.errors()]
    keys, problem = max(found, key=lambda pair: (pair[1]["type"] == "extra_forbidden", len(pair[0])))
    if problem["type"] == "extra_forbidden":
        known = _keys_at(schema, keys[:-1], content, kinds)
        return keys, f"unknown key{did_you_mean(str(keys[-1]), known)}; known: {listed(known)}"
    if problem["type"] in ("union_tag_invalid", "union_tag_not_found"):
        given = str(problem.get("ctx", {}).get("tag", ""))
        return (*keys, "kind"), f"must be one of {listed(kinds)}{did_you_mean(given, kinds)}"
    if problem["type"] == "missing":
        return keys, "is missing"
    if problem["type"] == "string_pattern_mismatch":
        return keys, "a name has letters, digits and underscores, and begins with no digit"
    return keys, problem["msg"].removeprefix("Value error, ").replace("Input should", "should")


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


def _keys_at(schema: type[Schema], place: Keys, content: Any, kinds: Kinds) -> list[str]:
    """Return the keys known in the table at a place of the content."""
    table = schema
    for part in place:
        content = content[part]
        if isinstance(part, str) and part in table.model_fields:
            inner = schemas_in(table.model_fields[part].annotation)
            kind = content.get("kind") if len(inner) > 1 and isinstance(content, dict) else None
            table = kinds.get(str(kind), inner[0]) if inner else table
    return [*table.model_fields]
