"""tau = Y values: the regressor against the inverse model, on shipped robots and random mechanisms."""

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.building import build_robot
from tests.mechanisms import KINDS, random_mechanism, random_states
from tests.shipped import ROBOTS, shipped, states_near_home

#: Rounding of two orders of summation, relative to the largest effort.
AGREE = 1e-12
#: Random mechanisms, but those whose redundant motors of several units share the load by weights.
RANDOM = [(kind, seed) for seed, kind in enumerate(KINDS) if kind not in ("gough_eight_motors",)]


def agrees(robot, q, v, a, effects=None, symmetric=False) -> None:
    want = hybridyn.idm(robot, q, v, a, effects=[e for e in effects or ["default"] if e != "offsets"])
    rows = hybridyn.regressor(robot, q, v, a, effects=effects, symmetric=symmetric)
    assert rows.Y.shape == (*want.shape, len(rows.names))
    assert np.abs(rows.Y @ rows.values - want).max() <= AGREE * np.abs(want).max()


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("symmetric", [False, True])
def test_shipped_robots(name: str, symmetric: bool) -> None:
    robot = hybridyn.load(name)
    q, v, a = states_near_home(shipped(name), "fixed", 1, 4)
    agrees(robot, q, v, a, ["model", "offsets"], symmetric)
    agrees(robot, q, v, a, None, symmetric)


@pytest.mark.parametrize(("kind", "seed"), RANDOM)
def test_random_mechanisms(kind: str, seed: int) -> None:
    base = ("fixed", "moving", "floating")[seed % 3] if kind != "sps_thin" else "fixed"
    description = random_mechanism(seed, kind=kind, base=base)
    q, v, a = random_states(description, base, seed, 3)
    agrees(build_robot(description, base=base), q, v, a)
