"""What the tests of the direct model share: drawn robots with states, efforts, the oracle's answer."""

from functools import lru_cache

import numpy as np

from hybridyn.description import Description
from tests.oracle import Base, Oracle
from tests.robots.mechanisms import random_mechanism, random_states, random_wrenches
from tests.robots.shipped import States

ORACLE = 1e-10  # the claim; dense elimination on both sides loses a few hundred roundings
BACKWARD = 1e-12  # of the largest term: B idm(ddm(tau)) = B tau is backward stable
BASES: tuple[Base, ...] = ("fixed", "moving", "floating")
Wrenches = dict[str, np.ndarray]


def efforts(description: Description, count: int, seed: int = 5) -> np.ndarray:
    """Draw motor efforts, shape (count, motors)."""
    return 20 * np.random.default_rng(seed).normal(size=(count, len(description.motors)))


@lru_cache(maxsize=256)
def drawn(kind: str, base: Base, seed: int = 0) -> tuple[Description, Wrenches, States]:
    """Return a random mechanism with outer wrenches and two states."""
    description = random_mechanism(seed, kind=kind)
    wrenches = random_wrenches(description, seed)
    return description, wrenches, random_states(description, base, seed, 2, wrenches=wrenches)


def judged(
    description: Description, base: Base, q: np.ndarray, v: np.ndarray, tau: np.ndarray, **given: np.ndarray
) -> np.ndarray:
    """Return the oracle's accelerations, shape (samples, nv)."""
    oracle = Oracle(description, base)
    return np.array([oracle.ddm(*state, **given) for state in zip(q, v, tau, strict=True)])
