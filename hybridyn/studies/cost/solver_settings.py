"""Settings of the solver that runs a scene."""

from __future__ import annotations

from typing import Any, NamedTuple

from ..compare.methods import written
from .points import Use

#: Methods with fixed steps.
FIXED = ("rk4", "conserving")


class Setting(NamedTuple):
    """One setting of the solver.

    Attributes:
        options: Arguments of `simulate`.
        line: Family that it belongs to.
        use: As in `CostPoint`.
        compiled: Whether accelerations are computed in C.
    """

    options: dict[str, Any]
    line: str
    use: Use = "command"
    compiled: bool = True

    @property
    def words(self) -> str:
        """What distinguishes it within its family."""
        pace = "step" if self.options["method"] != "dopri5" and "step" in self.options else "rtol"
        words = written({pace: self.options[pace]})
        return f"{self.options['method']}, {words} (usual)" if self.use == "usual" else words

    @property
    def fragment(self) -> str:
        """The table [solver] that replaces the scene's own, and the option of the command."""
        engine = "compiled" if self.compiled else "general"
        said = {name: x for name, x in self.options.items() if name not in ("method", "stiction")}
        numbers = [f"{name} = {x:g}" for name, x in said.items()]
        numbers += ["stiction = true"] * bool(self.options.get("stiction"))
        lines = ["[solver]", f'method = "{self.options["method"]}"', *numbers]
        return "\n".join([*lines, f"# hybridyn simulate --engine {engine}"])


def setting_of(method: str, pace: float, compiled: bool, stiction: bool) -> Setting:
    """Return the setting of a method at a step [s] or at a relative tolerance."""
    paces = {"step": pace} if method in FIXED else {"rtol": pace, "atol": pace * 1e-2}
    return Setting({"method": method, "stiction": stiction} | paces, method, compiled=compiled)
