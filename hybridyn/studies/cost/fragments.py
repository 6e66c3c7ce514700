"""Write lines to paste into a scene file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ...effects import UNITS

if TYPE_CHECKING:
    from ...scenes.scene_file import SceneFile

#: Effects that a scene requests only by tables of their own.
TABLES = ("payload", "wrench", "base_motion")


def solver_fragment(options: dict[str, Any], dtype: str) -> str:
    """Write the table [solver] that replaces the scene's own.

    Args:
        options: Arguments of `simulate`.
        dtype: Number type of the C code that computes accelerations, or "" for the general path.
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
    """Write the table [effects] that requests some of the scene's effects."""
    own = {name for name in source.scene.effects.stated() if name in UNITS}
    use = [name for name in names if name not in own and name not in TABLES]
    gone = sorted(own - set(names) - set(TABLES))
    return "\n".join([_used(use), *(f"# without the table [effects.{name}]" for name in gone)])


def model_fragment(names: Sequence[str], engine: str, command: str = "idm") -> str:
    """Write the table [effects] of some effects, and the options of a command that request them."""
    return f"{_used(names)}\n# hybridyn {command} --engine {engine} --effects {','.join(names)}"


def _used(names: Sequence[str]) -> str:
    """Write a table [effects] that requests effects by their names."""
    return f"[effects]\nuse = [{', '.join(map(_toml, names))}]"


def _toml(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else f"{value:g}"
