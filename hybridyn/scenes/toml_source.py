"""A TOML file with a schema, as a scene or a study: its content, and errors with file, line and key."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from pydantic import ValidationError

from ..description.names import did_you_mean
from ..description.reading import read_bytes
from ..description.side_cars.problems import first_problem
from ..description.side_cars.tables import Schema, with_added_effects
from ..description.side_cars.toml_file import Keys, line_of, parse_toml
from ..errors import HybridynError, ModelError
from .added_controllers import with_added_controller

Whole = TypeVar("Whole", bound=Schema)


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


def read_schema(
    path: str | Path, schema: type[Whole], kinds: Callable[[], Iterable[str]]
) -> tuple[TomlSource, Whole]:
    """Read a file, and check its content.

    Raises:
        ModelError: The file cannot be read, is not TOML, or has a wrong key or value; the message names file,
            line and key.
    """
    file = str(path)
    text, content = parse_toml(read_bytes(file), file)
    try:
        whole = with_added_controller(with_added_effects(schema, content), content)
        return TomlSource(file, text), whole.model_validate(content)
    except ValidationError as error:
        keys, message = first_problem(error, content, kinds())
        key = ".".join(str(part) for part in keys)
        line = line_of(text, keys)
        raise ModelError(
            f"'{key}': {message}" if key else message, file=file, line=line, element=key
        ) from None
