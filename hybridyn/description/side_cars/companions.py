"""Find the files beside a robot's file; write `model.toml`: what that cannot say, and the table `[home]`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ...errors import ModelError
from ..records import Coupling, Description
from ..writing import write_text
from .toml_file import parse_toml

#: The table `[home]` of a file, without the comments that stand before the next table.
_HOME = r"(?m)^[ \t]*\[[ \t]*home[ \t]*\].*\n?(?:(?!(?:[ \t]*(?:#.*)?\n)*[ \t]*\[)(?:.+\n?|\n))*"


def model_file(
    description: Description,
    *,
    motors: bool = False,
    home: bool = False,
    couplings: Iterable[Coupling] = (),
    joints: Mapping[str, Mapping[str, float]] | None = None,
    effects: Iterable[str] = (),
) -> str:
    """Return the text of a model file, "" if there is nothing to say.

    Args:
        motors: Whether to write the list of motors.
        home: Whether to write the home posture.
        couplings: Couplings to write.
        joints: By joint, the numbers to write: rotor_inertia, gear_ratio, damping, friction.
        effects: Names of the effects to write, those of `description.effects`.
    """
    parts = [f"motors = {_value(description.motors)}\n"] if motors else []
    parts += [home_table(description.home)] if home and description.home else []
    parts += [_table(f"joints.{key_of(name)}", numbers) for name, numbers in (joints or {}).items()]
    parts += [
        _table(f"couplings.{key_of(one.name)}", {"terms": dict(one.terms), "offset": one.offset})
        for one in couplings
    ]
    wanted = set(effects)
    parts += [_table(f"effects.{name}", numbers) for name, numbers in description.effects if name in wanted]
    return "\n".join(parts)


def home_table(home: Mapping[str, tuple[float, ...]]) -> str:
    """Return a home posture as the table `[home]`.

    Args:
        home: Position of each joint: one number, or Pinocchio's coordinates.
    """
    return _table("home", _plain(home))


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
    old = parse_toml(before.encode(), str(path))[1]
    try:
        new = parse_toml(after.encode(), str(path))[1]
    except ModelError:
        new = {}
    if new != {**old, "home": _plain(home)}:
        raise ModelError(
            "states home in a way that cannot be replaced; remove it there, or write [home] by hand",
            file=str(path), element="home",
        )  # fmt: skip
    write_text(path, after)
    return path


def key_of(name: str, *, bare: bool = True) -> str:
    """Return a name as a key or a string of TOML.

    Args:
        bare: Whether it may stand without quotes, as a key may.
    """
    if bare and re.fullmatch(r"[A-Za-z0-9_-]+", name):
        return name
    quoted = name.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08X}" for c in quoted) + '"'


def _with_table(text: str, table: str) -> str:
    """Replace the table `[home]` of a text, or append it; comments before the next table stay."""
    found = re.search(_HOME, text)
    if found is None:
        return text + ("" if not text else "\n" if text.endswith("\n") else "\n\n") + table
    rest = text[found.end() :]
    return text[: found.start()] + table + ("\n" if rest.lstrip(" \t").startswith("[") else "") + rest


def _plain(home: Mapping[str, tuple[float, ...]]) -> dict[str, Any]:
    """Return a home posture as TOML states it: one number, or a list."""
    return {name: x[0] if len(x) == 1 else list(x) for name, x in home.items()}


def _table(name: str, values: Mapping[str, Any]) -> str:
    return "\n".join(
        [f"[{name}]", *(f"{key_of(key)} = {_value(value)}" for key, value in values.items()), ""]
    )


def _value(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, str):
        return key_of(value, bare=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key_of(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return repr(float(value))


def find_side_car(file: str) -> Path | None:
    """Return the side-car of a robot file: `X.yaml` beside `X.urdf`, else `robot.yaml` in the same folder."""
    path = Path(file)
    name = re.sub(r"(\.urdf)?(\.xacro)?$", "", path.name)
    candidates = [path.with_name(stem + ending) for stem in (name, "robot") for ending in (".yaml", ".yml")]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def find_submechanisms(file: str) -> Path | None:
    """Return the file `submechanisms.yml` of Phobos and HyRoDyn in a robot file's folder, or None."""
    folder = Path(file).parent
    candidates = [folder / f"submechanisms{ending}" for ending in (".yml", ".yaml")]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def find_model_file(file: str) -> Path | None:
    """Return the path of the model file that belongs to a robot file, or None.

    It is `X.urdf.model.toml` beside `X.urdf`, as `hybridyn convert` writes it, or `X.model.toml`; else
    `models/X/model.toml` for `urdf/X.urdf`, and `models/group/X/model.toml` for `urdf/group/X.urdf`.
    """
    path = Path(file)
    beside = own_model_file(file)
    name = beside.name.removesuffix(".model.toml")
    group = path.absolute().parent.name
    candidates = [
        path.with_name(f"{path.name}.model.toml"),
        beside,
        path.parent / ".." / "models" / name / "model.toml",
        path.parent / ".." / ".." / "models" / group / name / "model.toml",
    ]
    return next((candidate for candidate in candidates if candidate.is_file()), None)


def own_model_file(file: str) -> Path:
    """Return the path of the model file beside a robot file, whether or not it exists."""
    path = Path(file)
    name = re.sub(r"(\.urdf|\.xml|\.sdf|\.usd[acz]?)?(\.xacro)?$", "", path.name)
    return path.with_name(f"{name}.model.toml")
