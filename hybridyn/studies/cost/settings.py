"""The solver settings of a scene that are compared, each family from coarse to fine, and lines to paste."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ...effects import UNITS
from .points import Use

if TYPE_CHECKING:
    from ...scenes.scene_file import SceneFile

#: Fixed steps relative to the mean step of the scene's own solver.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5)
#: Relative tolerances of the adaptive methods.
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
#: Effects that a scene requests only by tables of their own.
TABLES = ("payload", "wrench", "base_motion")
#: Methods with fixed steps.
FIXED = ("rk4", "conserving")


class Setting(NamedTuple):
    """One setting.

    Attributes:
        line: Family that it belongs to.
        words: What distinguishes it within its family.
        options: Arguments of `simulate`.
        compiled: Whether accelerations are computed in C.
        use: As in `Point`.
    """

    line: str
    words: str
    options: dict[str, Any]
    compiled: bool = True
    use: Use = "command"

    @property
    def fragment(self) -> str:
        """The table [solver] that replaces the scene's own, and the option of the command."""
        lines = ["[solver]", *(f"{key} = {_toml(value)}" for key, value in self.options.items())]
        return "\n".join(
            [*lines, f"# hybridyn simulate --engine {'compiled' if self.compiled else 'general'}"]
        )


def setting_of(method: str, pace: float, compiled: bool) -> Setting:
    """Return the setting of a method at a step [s] or at a relative tolerance."""
    line = method if compiled else f"{method}, general path"
    if method in FIXED:
        return Setting(line, f"step {pace:g} s", {"method": method, "step": pace}, compiled)
    options = {"method": method, "rtol": pace, "atol": pace * 1e-2}
    return Setting(line, f"rtol {pace:.0e}", options, compiled)


def usual_setting(source: SceneFile, compiled: bool) -> Setting:
    """Return the setting of the scene's own solver."""
    options = source.scene.solver.model_dump(exclude_none=True)
    adaptive = options["method"] == "dopri5" or "step" not in options
    pace = f"rtol {options['rtol']:.0e}" if adaptive else f"step {options['step']:g} s"
    words = f"{options['method']}, {pace} (usual)"
    return Setting("as the scene says", words, options, compiled, use="usual")


def families(step: float, compiled: bool) -> list[list[Setting]]:
    """Return the settings of each method, from coarse to fine.

    Args:
        step: The step that `FACTORS` multiplies [s].
        compiled: Whether accelerations are computed in C.
    """
    steps = [float(f"{factor * step:g}") for factor in FACTORS]
    return [
        [setting_of(method, pace, compiled) for pace in (steps if method in FIXED else TOLERANCES)]
        for method in ("dopri5", "rk4", "conserving", "implicit")
    ]


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
