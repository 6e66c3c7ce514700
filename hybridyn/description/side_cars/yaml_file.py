"""Read strict YAML, and the line of each value: no duplicate keys, no tags, few aliases."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import yaml
from pydantic import ValidationError

from ...errors import ModelError
from ..bounds import refuse_above
from ..names import did_you_mean
from .problems import first_problem

#: Ends of the tags of scalars that are read.
SCALARS = ("null", "bool", "int", "float", "str")

#: Whole numbers that PyYAML reads to another base than ten: `012` is ten, `1:30` ninety.
OTHER_BASES = re.compile(r"[-+]?0[0-9_]+|.*:.*")

Place = tuple[str | int, ...]


class _Loader(yaml.SafeLoader):
    """Reads `1e-10`, which many programs write, as the number; PyYAML wants a dot."""


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?[0-9]+[eE][-+]?[0-9]+$"), list("-+0123456789")
)


@dataclass
class YamlFile:
    """A YAML document as plain lists, dicts, texts and numbers.

    Attributes:
        data: The content.
        lines: Line and column (from 1) of every value, by its keys and indices from the top.
    """

    file: str
    data: Any = None
    lines: dict[Place, tuple[int, int]] = field(default_factory=dict)

    def mark(self, place: Place, node: yaml.Node) -> None:
        """Record line and column of a node."""
        self.lines[place] = (node.start_mark.line + 1, node.start_mark.column + 1)

    def refuse_unknown(self, place: Place, names: Sequence[str], known: Iterable[str], what: str) -> None:
        """Raise for the first name of a list at a place that is not known."""
        every = list(known)
        for index, name in enumerate(names):
            if name not in every:
                hint = did_you_mean(name, every)
                raise self.error((*place, index), f"no {what} is called '{name}'{hint}")

    def error(self, place: Place, message: str) -> ModelError:
        """Return (do not raise) an error that names file, line, column and key."""
        while place not in self.lines and place:
            place = place[:-1]
        line, column = self.lines.get(place, (1, 1))
        key = ".".join(str(part) for part in place)
        where = f"column {column}, '{key}'" if key else f"column {column}"
        return ModelError(f"{where}: {message}", file=self.file, line=line, element=key or None)


def read_yaml(text: bytes, file: str) -> YamlFile:
    """Read a YAML document.

    Raises:
        ModelError: The text is not YAML, is too large, or contains a duplicate key or a tag; the message
            names line and column.
    """
    refuse_above("side-car", len(text), partial(ModelError, file=file))
    document = YamlFile(file)
    try:
        loader = _Loader(text.decode("utf-8"))
        node = loader.get_single_node()
        document.data = None if node is None else _value(document, loader, node, ())
    except UnicodeDecodeError as error:
        raise ModelError(f"is not UTF-8 text (byte {error.start})", file=file) from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = f"not readable as YAML: {error.problem or error.context}"
        raise ModelError(message, file=file, line=mark.line + 1 if mark else None) from None
    except (yaml.YAMLError, ValueError) as error:
        raise ModelError(f"not readable as YAML: {' '.join(str(error).split())}", file=file) from None
    except RecursionError:
        raise ModelError("is nested too deeply", file=file) from None
    return document


def checked(document: YamlFile, schema: Any) -> Any:
    """Return the content of a document as an object of a schema of `tables`.

    Raises:
        ModelError: A key or value is wrong; the message names line and column.
    """
    try:
        return schema.model_validate(document.data)
    except ValidationError as error:
        raise document.error(*first_problem(error, document.data)) from None


def _value(document: YamlFile, loader: yaml.SafeLoader, node: yaml.Node, place: Place) -> Any:
    """Return the node at a place as a plain value, and record line and column of all that it holds."""
    document.mark(place, node)
    refuse_above("values", len(document.lines), partial(document.error, place))
    kind = node.tag.removeprefix("tag:yaml.org,2002:")
    if isinstance(node, yaml.SequenceNode) and kind == "seq":
        return [_value(document, loader, child, (*place, index)) for index, child in enumerate(node.value)]
    if isinstance(node, yaml.MappingNode) and kind == "map":
        values: dict[str, Any] = {}
        for key, value in node.value:
            plain = isinstance(key, yaml.ScalarNode)
            name = str(key.value) if plain else "?"
            document.mark((*place, name), key)
            if not plain or name in values:
                problem = "the key is stated twice" if plain else "a key must be a plain word"
                raise document.error((*place, name), problem)
            values[name] = _value(document, loader, value, (*place, name))
        return values
    if kind in ("int", "float") and OTHER_BASES.fullmatch(node.value):
        raise document.error(place, f"'{node.value}' is no number to the base ten; leave the 0 or : out")
    if isinstance(node, yaml.ScalarNode) and kind in SCALARS:
        return loader.construct_object(node)
    raise document.error(place, f"tag '{node.tag}' is not allowed")
