"""Every shipped robot and a random mechanism of every kind, to be identified."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

import hybridyn
from hybridyn.description.records import Description
from hybridyn.identification.base_parameters import BaseParameters
from hybridyn.structure.building import build_robot
from tests.mechanisms import KINDS, random_mechanism
from tests.samples import CHOSEN, slow
from tests.shipped import ROBOTS

#: A shipped robot (seed -1), or a kind of random mechanism and its seed.
EVERY = [*((name, -1) for name in ROBOTS), *((kind, seed) for seed, kind in enumerate(KINDS))]
#: Those that are tried by default.
QUICK = {(name, -1) for name in ("five_bar", "rps3", "delta")} | {
    (kind, seed) for kind, seed in EVERY if seed >= 0 and kind in CHOSEN
}


def cases(without: Iterable[str] = (), quick: Iterable[tuple[str, int]] = QUICK) -> list[Any]:
    """Return the robots as parameters of tests, those that are not quick as slow ones."""
    every = [one for one in EVERY if one[1] < 0 or one[0] not in set(without)]
    return [one if one in set(quick) else slow(*one) for one in every]


def described(kind: str, seed: int) -> Description:
    """Return a random mechanism; motors of several units share their load by limits of their efforts."""
    found = random_mechanism(seed, kind=kind, base="fixed")
    if kind != "gough_eight_motors":
        return found
    return replace(found, joints=tuple(replace(joint, effort=10.0) for joint in found.joints))


@lru_cache(maxsize=4)
def robot_of(kind: str, seed: int) -> hybridyn.HybridRobot:
    """Return a robot; a shipped one has friction and rotors in its files."""
    return hybridyn.load(kind) if seed < 0 else build_robot(described(kind, seed))


def effects_of(seed: int) -> str | None:
    """Return the effects of the model: a random mechanism has numbers of bodies only."""
    return "model" if seed < 0 else None


@lru_cache(maxsize=4)
def base_of(kind: str, seed: int, symmetric: bool = False) -> BaseParameters:
    """Return the base parameters."""
    return hybridyn.base_parameters(robot_of(kind, seed), effects=effects_of(seed), symmetric=symmetric)


def other_values(base: BaseParameters, seed: int) -> np.ndarray:
    """Return standard parameters of a robot whose bodies are up to 30 % heavier or lighter."""
    rng, out = np.random.default_rng(seed + 1), base.standard.values.copy()
    for at in base.standard.tens:
        out[at] *= rng.uniform(0.7, 1.3)
    return out
