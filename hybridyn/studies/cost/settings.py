"""The solver settings and effect sets of a scene that are compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from ...scenes.stage import Stage
from .points import Use

#: Fixed steps relative to the mean step of the scene's own solver.
FACTORS = (8.0, 4.0, 2.0, 1.0)

#: Relative tolerances of the adaptive methods.
TOLERANCES = (1e-3, 1e-5, 1e-7, 1e-9)

#: Effects that can be omitted without changing the task of a scene.
DROPPABLE = (
    "leg_inertia", "velocity", "rotor_inertia", "viscous_friction", "coulomb_friction", "stribeck_friction",
)  # fmt: skip

ENGINES = {"": "", "float64": ", C in float64", "float32": ", C in float32"}


class Setting(NamedTuple):
    """One configuration.

    Attributes:
        line: Family that it belongs to.
        words: What distinguishes it within its family.
        options: Arguments of `simulate`.
        dtype: Number type of the C code that computes accelerations, or "" for the general path.
        effects: Names of the effects, or None for those of the scene.
        use: As in `Point`.
    """

    line: str
    words: str
    options: dict[str, Any]
    dtype: str = ""
    effects: tuple[str, ...] | None = None
    use: Use = "command"


def own_options(ready: Stage) -> dict[str, Any]:
    """Return the scene's table [solver] as arguments of `simulate`."""
    return dict(ready.source.scene.solver.model_dump(exclude_none=True))


def usual_setting(options: dict[str, Any]) -> Setting:
    """Return the setting of the scene's own solver."""
    adaptive = options["method"] == "dopri5" or "step" not in options
    pace = f"rtol {options['rtol']:.0e}" if adaptive else f"step {options['step']:g} s"
    return Setting("as the scene says", f"{options['method']}, {pace} (usual)", options, use="usual")


def of_integration(step: float) -> Iterator[Setting]:
    """Yield settings that vary method, step or tolerance, projection, and general path or C code.

    Args:
        step: The step that `FACTORS` multiplies [s].
    """
    lines = [("stages", dtype, engine) for dtype, engine in ENGINES.items()]
    lines += [(projection, "", f", projected {projection}") for projection in ("steps", "never")]
    for projection, dtype, suffix in lines:
        yield from _adaptive("dopri5", projection, dtype, suffix)
        yield from _fixed("rk4", projection, step, dtype, suffix)
    yield from _adaptive("implicit", "stages", "", "")
    yield from _fixed("implicit", "stages", step, "", ", fixed steps")
    yield from _fixed("conserving", "stages", step, "", "")


def _adaptive(method: str, projection: str, dtype: str, suffix: str) -> Iterator[Setting]:
    for rtol in TOLERANCES:
        options = {"method": method, "rtol": rtol, "atol": rtol * 1e-2, "projection": projection}
        yield Setting(method + suffix, f"rtol {rtol:.0e}", options, dtype, use=_use(dtype, projection))


def _fixed(method: str, projection: str, step: float, dtype: str, suffix: str) -> Iterator[Setting]:
    """Yield settings of a method with fixed steps."""
    for factor in FACTORS:
        options = {"method": method, "step": float(f"{factor * step:g}"), "projection": projection}
        words = f"step {options['step']:g} s"
        yield Setting(method + suffix, words, options, dtype, use=_use(dtype, projection))


def _use(dtype: str, projection: str) -> Use:
    """Return the use of a setting: commands offer no float32, and without projection loops drift open."""
    if projection == "never":
        return "comparison"
    return "program" if dtype == "float32" else "command"


def of_effects(names: Sequence[str], options: dict[str, Any]) -> Iterator[Setting]:
    """Yield the scene's own solver without one effect each, then without all effects that can be omitted."""
    there = [name for name in DROPPABLE if name in names]
    for out in [*([name] for name in there), *([there] if len(there) > 1 else [])]:
        kept = tuple(name for name in names if name not in out)
        words = " and ".join(name.replace("_", " ") for name in out)
        yield Setting("effects", f"without {words}", options, effects=kept)
