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


def own_options(ready: Stage) -> dict[str, Any]:
    """Return the scene's table [solver] as arguments of `simulate`."""
    return dict(ready.source.scene.solver.model_dump(exclude_none=True))


def usual_setting(options: dict[str, Any], dtype: str) -> Setting:
    """Return the setting of the scene's own solver."""
    adaptive = options["method"] == "dopri5" or "step" not in options
    pace = f"rtol {options['rtol']:.0e}" if adaptive else f"step {options['step']:g} s"
    return Setting("as the scene says", f"{options['method']}, {pace} (usual)", options, dtype, use="usual")


def families(step: float, engines: tuple[str, ...]) -> Iterator[list[Setting]]:
    """Yield the settings of each method, from coarse to fine.

    Args:
        step: The step that `FACTORS` multiplies [s].
        engines: Number types of compiled accelerations, the usual one first; "" for the general path.
    """
    usual = engines[0]
    yield _adaptive("dopri5", usual)
    yield _fixed("rk4", step, usual)
    for dtype in engines[1:]:
        yield _adaptive("dopri5", dtype)
    yield _fixed("conserving", step, usual)
    yield _adaptive("implicit", usual)


def _adaptive(method: str, dtype: str) -> list[Setting]:
    """Return settings of a method with adaptive steps."""
    return [
        Setting(
            _named(method, dtype), f"rtol {rtol:.0e}", {"method": method, "rtol": rtol, "atol": rtol * 1e-2},
            dtype, _use(dtype),
        )
        for rtol in TOLERANCES
    ]  # fmt: skip


def _fixed(method: str, step: float, dtype: str) -> list[Setting]:
    """Return settings of a method with fixed steps."""
    steps = [float(f"{factor * step:g}") for factor in FACTORS]
    return [
        Setting(_named(method, dtype), f"step {h:g} s", {"method": method, "step": h}, dtype, _use(dtype))
        for h in steps
    ]


def _named(method: str, dtype: str) -> str:
    """Return the name of a family."""
    return method + {"float64": "", "float32": ", float32", "": ", general path"}[dtype]


def _use(dtype: str) -> Use:
    """Return the use of a setting: commands offer no float32."""
    return "program" if dtype == "float32" else "command"
