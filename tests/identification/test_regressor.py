"""tau = Y values: the regressor against the inverse model, on shipped robots and random mechanisms."""

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.building import build_robot
from tests.identification.robots import described
from tests.robots.mechanisms import KINDS, random_states
from tests.robots.shipped import ROBOTS, shipped, states_near_home
from tests.support.samples import CHOSEN, slow

#: Rounding of two orders of summation, relative to the largest effort.
AGREE = 1e-12


def agrees(robot, q, v, a, effects=None, symmetric=False) -> None:
    want = hybridyn.idm(robot, q, v, a, effects=[e for e in effects or ["default"] if e != "offsets"])
    rows = hybridyn.regressor(robot, q, v, a, effects=effects, symmetric=symmetric)
    assert rows.Y.shape == (*want.shape, len(rows.names))
    assert np.abs(rows.Y @ rows.values - want).max() <= AGREE * np.abs(want).max()


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("symmetric", [False, True])
def test_shipped_robots(name: str, symmetric: bool) -> None:
    robot = hybridyn.load(name)
    q, v, a = states_near_home(shipped(name), "fixed", 1, 2)
    agrees(robot, q, v, a, ["model", "offsets"], symmetric)
    agrees(robot, q, v, a, None, symmetric)


@pytest.mark.parametrize(
    ("seed", "kind"), [(i, kind) if kind in CHOSEN else slow(i, kind) for i, kind in enumerate(KINDS)]
)
def test_random_mechanisms(kind: str, seed: int) -> None:
    base = ("fixed", "moving", "floating")[seed % 3] if kind != "sps_thin" else "fixed"
    description = described(kind, seed, base)
    q, v, a = random_states(description, base, seed, 2)
    agrees(build_robot(description, base=base), q, v, a)
