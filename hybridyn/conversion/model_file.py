"""Write `model.toml` for what a format cannot say and hybridyn reads beside every robot file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..description.records import Coupling, Description
from ..description.side_cars.home_table import home_table, key_of


def model_file(
    description: Description,
    *,
    motors: bool = False,
    home: bool = False,
    joints: Mapping[str, Mapping[str, float]] | None = None,
    couplings: Iterable[Coupling] = (),
    effects: Iterable[str] = (),
) -> str:
    """Return the text of a model file, "" if there is nothing to say.

    Args:
        motors: Whether to write the list of motors.
        home: Whether to write the home posture.
        joints: By joint, the numbers to write: rotor_inertia, gear_ratio, damping, friction.
        effects: Names of the effects to write, those of `description.effects`.
    """
    parts = []
    if motors:
        parts.append(f"motors = {_value(list(description.motors))}\n")
    if home and description.home:
        parts.append(home_table(description.home))
    for name, numbers in (joints or {}).items():
        parts.append(_table(f"joints.{key_of(name)}", numbers))
    for coupling in couplings:
        table = {"terms": dict(coupling.terms), "offset": coupling.offset}
        parts.append(_table(f"couplings.{key_of(coupling.name)}", table))
    wanted = set(effects)
    for name, numbers in description.effects:
        if name in wanted:
            parts.append(_table(f"effects.{name}", numbers))
    return "\n".join(parts)


def _table(name: str, values: Mapping[str, Any]) -> str:
    lines = [f"[{name}]"] + [f"{key_of(key)} = {_value(value)}" for key, value in values.items()]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, str):
        return key_of(value, bare=False)
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key_of(key)} = {_value(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_value(item) for item in value) + "]"
    return repr(float(value))
