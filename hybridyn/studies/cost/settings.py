"""The solver settings of a scene that are compared, each family from coarse to fine."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from ...scenes.stage import Stage
from .points import Use

#: Fixed steps relative to the mean step of the scene's own solver.
FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5)
#: Relative tolerances of the adaptive methods.
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
#: Methods with fixed steps.
FIXED = ("rk4", "conserving")


class Setting(NamedTuple):
    """One setting.

    Attributes:
        line: Family that it belongs to.
        words: What distinguishes it within its family.
        options: Arguments of `simulate`.
        dtype: Number type of the compiled accelerations, or "" for the general path.
        use: As in `Point`.
    """

    line: str
    words: str
    options: dict[str, Any]
    dtype: str = "float64"
    use: Use = "command"


def setting_of(method: str, pace: float, dtype: str) -> Setting:
    """Return the setting of a method at a step [s] or at a relative tolerance; commands offer no float32."""
    line = method + {"float64": "", "float32": ", float32", "": ", general path"}[dtype]
    use: Use = "program" if dtype == "float32" else "command"
    if method in FIXED:
        return Setting(line, f"step {pace:g} s", {"method": method, "step": pace}, dtype, use)
    options = {"method": method, "rtol": pace, "atol": pace * 1e-2}
    return Setting(line, f"rtol {pace:.0e}", options, dtype, use)


def usual_setting(ready: Stage, dtype: str) -> Setting:
    """Return the setting of the scene's own solver."""
    options = dict(ready.source.scene.solver.model_dump(exclude_none=True))
    adaptive = options["method"] == "dopri5" or "step" not in options
    pace = f"rtol {options['rtol']:.0e}" if adaptive else f"step {options['step']:g} s"
    return Setting("as the scene says", f"{options['method']}, {pace} (usual)", options, dtype, use="usual")


def families(step: float, engines: tuple[str, ...]) -> Iterator[list[Setting]]:
    """Yield the settings of each method, from coarse to fine.

    Args:
        step: The step that `FACTORS` multiplies [s].
        engines: Number types of compiled accelerations, the usual one first; "" for the general path.
    """
    steps = [float(f"{factor * step:g}") for factor in FACTORS]
    for method, dtype in (
        ("dopri5", engines[0]), ("rk4", engines[0]), *(("dopri5", dtype) for dtype in engines[1:]),
        ("conserving", engines[0]), ("implicit", engines[0]),
    ):  # fmt: skip
        yield [setting_of(method, pace, dtype) for pace in (steps if method in FIXED else TOLERANCES)]
