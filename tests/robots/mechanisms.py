"""Random mechanisms, seeded and well conditioned, for tests that state identities.

A recipe of `KINDS` fixes the structure (so its mobility is known), a seed the geometry, masses, frames, names
and fixed joints in between. Each is drawn assembled, in a posture that is stored as `home`. A draw whose
closure rows or motors' map are ill conditioned, or whose mobility is not the recipe's, is thrown away.

    description = random_mechanism(seed, kind="five_bar", base="floating")
    wrenches = random_wrenches(description, seed)
    q, v, a = random_states(description, "floating", seed, count=5, wrenches=wrenches)
"""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from hybridyn.description.records import Description
from tests.oracle import Base, Oracle
from tests.robots.recipes import KINDS, Kind
from tests.robots.sketch import Sketch, unit
from tests.support import once

__all__ = [
    "KINDS", "OVER_FOLDS", "Kind", "home_posture", "near", "random_mechanism", "random_states",
    "random_wrenches",
]  # fmt: skip

KEPT = 1e-2  # least singular value of the scaled closure rows that are kept, relative to the largest
DROPPED = 1e-12  # greatest one that is dropped: closed to rounding, far under the oracle's threshold of 1e-9
MOTORS = 1e-2  # least singular value of the motors' map, relative to the largest
CLOSED = 1e-13  # residual of an assembled posture [m]
DRAWS = 300
#: Motors of "loop_universal" of seed 3. On the ways from home Newton's method alone jumps over folds to other
#: branches. The second way has no end.
OVER_FOLDS = [[-0.79835767, 1.45554765, -1.18541176], [-0.96970056, 0.91743157, -0.59774038]]
HOME_MARGIN = 3.0  # how much clearer home must be, so that the states around it are clear too
STEP = 0.25  # how far a random state lies from home, in the oracle's scaled coordinates


@lru_cache(maxsize=512)
def random_mechanism(seed: int, *, kind: str | None = None, base: Base = "fixed") -> Description:
    """Draw a mechanism.

    Args:
        seed: Same seed, same robot.
        kind: A name of `KINDS`; by default `seed` picks one.
        base: Not part of the description, and without influence on the geometry; it only seeds the draw.

    Raises:
        RuntimeError: No draw was well conditioned.
    """
    name = kind or list(KINDS)[seed % len(KINDS)]
    recipe = KINDS[name]
    number = list(KINDS).index(name)
    for draw in range(DRAWS):
        rng = np.random.default_rng([seed, number, draw, len(base)])
        sketch = Sketch(rng)
        recipe.recipe(sketch)
        description = sketch.description(f"{name}_{seed}")
        oracle = Oracle(description)
        if is_well_conditioned(oracle, home_posture(description, "fixed"), recipe, HOME_MARGIN):
            return description
    raise RuntimeError(f"no well conditioned {name} in {DRAWS} draws")


def home_posture(description: Description, base: Base) -> np.ndarray:
    """Return the home posture on the spanning tree, a free base at the world's origin, shape (nq,)."""
    oracle = Oracle(description, base)
    q = np.zeros(oracle.nq)
    for name, (kind, at, _) in oracle.coordinates.items():
        if name in description.home:
            q[at] = description.home[name]
        elif kind == "floating":
            q[at] = [0, 0, 0, 0, 0, 0, 1]
    return q


def near(oracle: Oracle, home: np.ndarray, rng: np.random.Generator, step: float) -> np.ndarray | None:
    """Return a closed posture so far from home, a free base anywhere; None where none closes."""
    q = home.copy()
    if oracle.base != "fixed":
        q[:7] = [*rng.normal(size=3), *unit(rng.normal(size=4))]
    motions = oracle.motions(q)
    away = motions @ rng.normal(size=motions.shape[1]) * step / max(np.sqrt(motions.shape[1]), 1.0)
    try:
        return oracle.close(oracle.integrate(q, away)) if step else q
    except ValueError:
        return None


def is_well_conditioned(oracle: Oracle, q: np.ndarray, recipe: Kind, margin: float = 1.0) -> bool:
    """Tell whether mobility is the recipe's, and closure rows and motors' map clear by a margin."""
    if np.abs(oracle.residual(q)).max(initial=0.0) > CLOSED:
        raise RuntimeError("the posture is not assembled")
    posture = oracle.posture(q)
    K = posture.K * oracle.unit / posture.scale[:, None]
    s = np.linalg.svd(K, compute_uv=False) if len(K) else np.zeros(0)
    rank = oracle.nv - recipe.mobility - (0 if oracle.base == "fixed" else 6)
    kept, dropped = s[:rank], s[rank:]
    if (
        len(kept) < rank
        or (rank and kept[-1] < margin * KEPT * s[0])
        or (dropped.size and dropped[0] > DROPPED * max(s[0], 1.0))
    ):
        return False
    B = oracle.motor_map(posture)
    s = np.linalg.svd(B, compute_uv=False)
    independent = min(recipe.mobility, len(oracle.motors))
    return len(s) >= independent and bool(s[independent - 1] > margin * MOTORS * s[0])


def recipe_of(description: Description) -> Kind:
    """Return the recipe that a description was drawn by."""
    return KINDS[description.name.rsplit("_", 1)[0]]


def random_wrenches(description: Description, seed: int, count: int = 3) -> dict[str, np.ndarray]:
    """Draw outer wrenches on some links; where motions have no mass, on a platform, which forces none."""
    rng = np.random.default_rng([seed, 11])
    names = [link.name for link in description.links]
    if recipe_of(description).massless:
        names = [name for name in names if name.endswith("platform_link")]
    chosen = rng.choice(names, size=min(count, len(names)), replace=False)
    return {str(name): 5 * rng.normal(size=6) for name in chosen}


def random_states(
    description: Description,
    base: Base,
    seed: int,
    count: int,
    *,
    wrenches: Mapping[str, Any] | None = None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw assembled states near home, moving and accelerating as the closures allow.

    Where motors are too few, or the base floats, the passive accelerations are those of zero effort (under
    `wrenches`), so that the inverse model has an answer.

    Returns:
        q, v, a: Shapes (count, nq), (count, nv), (count, nv).
    """
    asked = ("random_states", description, base, seed, count, wrenches)
    q, v, a = once.kept(lambda: _drawn_states(description, base, seed, count, wrenches), *asked)
    return q.copy(), v.copy(), a.copy()


def _drawn_states(
    description: Description, base: Base, seed: int, count: int, wrenches: Mapping[str, Any] | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    recipe = recipe_of(description)
    oracle = Oracle(description, base)
    home = home_posture(description, base)
    rng = np.random.default_rng([seed, 7])
    states: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for _ in range(50 * count):
        if len(states) == count:
            return tuple(np.array(part) for part in zip(*states, strict=True))  # type: ignore[return-value]
        q = near(oracle, home, rng, STEP)
        if q is None or not is_well_conditioned(oracle, q, recipe):
            continue
        v = oracle.project_velocity(q, rng.normal(size=oracle.nv))
        a = oracle.consistent_acceleration(q, v, 3 * rng.normal(size=oracle.nv))
        if recipe.motors == "few" or base == "floating":
            a = oracle.solve_passive(q, v, a, wrenches)
        states.append((q, v, a))
    raise RuntimeError(f"{description.name}: too few well conditioned states")
