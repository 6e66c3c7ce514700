"""Lines to paste into a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ...effects import UNITS

if TYPE_CHECKING:
    from ...scenes.scene_file import SceneFile

#: Effects that only tables of their own ask for.
TABLES = ("payload", "wrench", "base_motion")


def solver_fragment(options: dict[str, Any], dtype: str) -> str:
    """Return a scene's table [solver], which takes the place of the one that is there.

    Args:
        options: Arguments of `simulate`.
        dtype: Numbers of the accelerations written out as C, or "".
    """
    lines = ["[solver]", *(f"{key} = {_toml(value)}" for key, value in options.items())]
    if dtype == "float64":
        lines.append("# hybridyn simulate --engine compiled")
    elif dtype:
        lines.append(f'# hybridyn.simulate(..., compiled=hybridyn.compile(robot, effects, dtype="{dtype}"))')
    else:
        lines.append("# hybridyn simulate --engine general")
    return "\n".join(lines)


def effects_fragment(source: SceneFile, names: Sequence[str]) -> str:
    """Return the line of a scene's table [effects] that asks for some of its effects.

    Args:
        source: The scene.
        names: Effects that stay.
    """
    own = {name for name, _ in source.scene.effects.stated() if name in UNITS}
    use = [name for name in names if name not in own and name not in TABLES]
    lines = ["[effects]", f"use = [{', '.join(_toml(name) for name in use)}]"]
    gone = sorted(own - set(names) - set(TABLES))
    return "\n".join(lines + [f"# without the table [effects.{name}]" for name in gone])


def _toml(value: object) -> str:
    """Write a value as TOML does."""
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
