"""Read strict YAML, and the line of each value: YAML 1.2 numbers, no duplicate keys or tags, few aliases."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import yaml

from ...errors import ModelError

#: Largest YAML file read [bytes]; side-cars have a few kilobytes.
LARGEST_YAML = 2**20

#: Most values that a document may expand to; aliases of aliases grow without bound.
MOST_VALUES = 100_000

Place = tuple[str | int, ...]


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

    def error(self, place: Place, message: str) -> ModelError:
        """Return (do not raise) an error that names file, line, column and key."""
        while place not in self.lines and place:
            place = place[:-1]
        line, column = self.lines.get(place, (1, 1))
        key = ".".join(str(part) for part in place)
        where = f"column {column}, '{key}'" if key else f"column {column}"
        return ModelError(f"{where}: {message}", file=self.file, line=line, element=key or None)


class _Loader(yaml.SafeLoader):
    """SafeLoader with the plain scalars of YAML 1.2: `1e-10` is a number, `1:30`, `yes` and `012` are not."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012


for _tag, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
):
    _Loader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(rf"^(?:{_pattern})$"), _first)


def read_yaml(text: bytes, file: str) -> YamlFile:
    """Read a YAML document.

    Raises:
        ModelError: The text is not YAML, is too large, or contains a duplicate key or a tag; the message
            names line and column.
    """
    if len(text) > LARGEST_YAML:
        raise ModelError(f"is larger than {LARGEST_YAML // 2**20} MiB", file=file)
    document = YamlFile(file)
    try:
        node = yaml.compose(text.decode("utf-8"), Loader=_Loader)
        if node is not None:
            document.data = _Reader(document).read(node, ())
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


class _Reader:
    """Convert YAML nodes into plain values, and record the line and column of each."""

    def __init__(self, document: YamlFile) -> None:
        self.document = document
        self.count = 0

    def read(self, node: yaml.Node, place: Place) -> Any:
        """Return the value of the node at `place`."""
        self.document.lines[place] = (node.start_mark.line + 1, node.start_mark.column + 1)
        self.count += 1
        if self.count > MOST_VALUES:
            raise self.document.error(place, f"more than {MOST_VALUES} values; are aliases nested?")
        kind = node.tag.removeprefix("tag:yaml.org,2002:")
        if isinstance(node, yaml.SequenceNode) and kind == "seq":
            return [self.read(child, (*place, index)) for index, child in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode) and kind == "map":
            return self._mapping(node, place)
        if isinstance(node, yaml.ScalarNode) and kind in ("null", "bool", "int", "float", "str"):
            return self._scalar(kind, str(node.value))
        raise self.document.error(place, f"tag '{node.tag}' is not allowed")

    def _mapping(self, node: yaml.MappingNode, place: Place) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for key_node, value_node in node.value:
            here = (*place, str(key_node.value) if isinstance(key_node, yaml.ScalarNode) else "?")
            self.document.lines[here] = (key_node.start_mark.line + 1, key_node.start_mark.column + 1)
            if not isinstance(key_node, yaml.ScalarNode):
                raise self.document.error(here, "a key must be a plain word")
            key = str(key_node.value)
            if key in values:
                raise self.document.error(here, "the key is stated twice")
            values[key] = self.read(value_node, here)
        return values

    @staticmethod
    def _scalar(kind: str, text: str) -> Any:
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() == "true"
        return int(text) if kind == "int" else float(text) if kind == "float" else text
