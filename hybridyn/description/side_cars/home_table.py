"""Write the table `[home]` of a robot's `model.toml`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from ...errors import ModelError
from ..writing import write_text
from .companions import find_model_file, own_model_file
from .toml_file import parse_toml

_TABLE = re.compile(r"^[ \t]*\[[ \t]*home[ \t]*\][^\n]*\n?", re.MULTILINE)
_NEXT = re.compile(r"^[ \t]*\[", re.MULTILINE)
_BARE = re.compile(r"[A-Za-z0-9_-]+")


def key_of(name: str, *, bare: bool = True) -> str:
    """Return a name as a key or a string of TOML.

    Args:
        bare: Whether it may stand without quotes, as a key may.
    """
    if bare and _BARE.fullmatch(name):
        return name
    quoted = name.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in quoted) + '"'


def home_table(home: Mapping[str, tuple[float, ...]]) -> str:
    """Return a home posture as the table `[home]`.

    Args:
        home: Position of each joint: one number, or Pinocchio's coordinates.
    """
    lines = ["[home]"]
    for name, values in home.items():
        key = key_of(name)
        numbers = ", ".join(repr(float(value)) for value in values)
        lines.append(f"{key} = {numbers if len(values) == 1 else f'[{numbers}]'}")
    return "\n".join(lines) + "\n"


def write_home(robot_file: str, home: Mapping[str, tuple[float, ...]]) -> Path:
    """Write a home posture into the model file of a robot; keep all other content of the file.

    Returns:
        The model file; one beside the robot's file, if there was none.

    Raises:
        ModelError: The file states home in a way that cannot be replaced.
        OSError: The file cannot be written.
    """
    path = find_model_file(robot_file) or own_model_file(robot_file)
    before = path.read_bytes().decode("utf-8") if path.exists() else ""
    after = _with_table(before, home_table(home))
    _check(before, after, home, str(path))
    write_text(path, after)
    return path


def _with_table(text: str, table: str) -> str:
    """Replace the table `[home]` of a text, or append it; comments before the next table stay."""
    found = _TABLE.search(text)
    if found is None:
        gap = "" if not text else "\n" if text.endswith("\n") else "\n\n"
        return text + gap + table
    following = _NEXT.search(text, found.end())
    end = following.start() if following else len(text)
    body = text[found.end() : end]
    kept = re.search(r"(?:^[ \t]*(?:#[^\n]*)?\n)*\Z", body, re.MULTILINE)
    rest = kept[0] if kept and following else ""
    return text[: found.start()] + table + (rest or ("\n" if following else "")) + text[end:]


def _check(before: str, after: str, home: Mapping[str, tuple[float, ...]], file: str) -> None:
    """Check that only home has changed."""
    old = parse_toml(before.encode(), file)[1]
    try:
        new = parse_toml(after.encode(), file)[1]
    except ModelError:
        new = {}
    wanted = {name: values[0] if len(values) == 1 else list(values) for name, values in home.items()}
    if new.get("home") != wanted or {**old, "home": None} != {**new, "home": None}:
        raise ModelError(
            "states home in a way that cannot be replaced; remove it there, or write [home] by hand",
            file=file, element="home",
        )  # fmt: skip
