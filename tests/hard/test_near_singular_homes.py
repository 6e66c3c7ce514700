"""Linkages whose home lies near a singular posture keep the mobility that they have far from it.

Home's own loss of rank is a singular posture, no mobility. Starts scattered about such a home close in any of
the modes that meet there: three stages of a lift with bars at 89.9 degrees had mobility 3.
"""

import numpy as np
import pytest

import hybridyn
from hybridyn.structure.building import build_robot
from tests.hard.degenerate import FAMILIES, mobility_far_from
from tests.oracle import Oracle
from tests.robots.sketch import rounded
from tests.support.samples import slow

DISTANCES = (0.5, 0.07, 0.01, 1.7e-4, 1e-6)  # bars at 60 to 89.99 degrees, and next to it
NEAR = 2e-3
QUICK = ("scissors 2", "scissors 3", "scissors 6", "hoberman ring 6", "peaucellier", "sarrus", "bennett",
         "bricard", "pantograph", "parallelograms 2", "delta")  # fmt: skip
#: Families small enough for sixty digits.
JUDGED = (*QUICK[:2], "hoberman ring 4", *QUICK[3:], "bricard of tetrahedra")
SAME = 1e-8  # of the largest acceleration; the rows' condition is up to 1e3


@pytest.mark.parametrize("family", QUICK)
def test_a_home_near_singular_has_the_mobility_of_the_rest(family: str) -> None:
    make, mobility = FAMILIES[family]
    assert build_robot(make(NEAR)).mobility == mobility


@pytest.mark.slow
@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize("family", FAMILIES)
def test_mobility_does_not_hang_on_the_distance(family: str, distance: float) -> None:
    make, mobility = FAMILIES[family]
    assert build_robot(make(distance)).mobility == mobility


@pytest.mark.parametrize("family", [name if name == "sarrus" else slow(name) for name in JUDGED])
def test_mobility_is_that_of_sixty_digits_far_from_home(family: str) -> None:
    make, mobility = FAMILIES[family]
    assert mobility_far_from(make(NEAR)) == mobility


@pytest.mark.parametrize("family", ["scissors 3", *map(slow, FAMILIES)])
@pytest.mark.parametrize(("digits", "distance"), [(6, 0.07), (9, 1e-3)])
def test_a_file_of_few_digits_keeps_its_mobility(family: str, digits: int, distance: float) -> None:
    """Home is farther from singular than its numbers are rounded, also in the smallest singular values."""
    make, mobility = FAMILIES[family]
    assert build_robot(rounded(make(distance), digits)).mobility == mobility


def told(robot: hybridyn.HybridRobot) -> bool:
    return any("home is a singular posture" in module.mechanism.rank_decision for module in robot.modules)


@pytest.mark.parametrize("family", ["scissors 2", *(slow(name) for name in FAMILIES if name != "bennett")])
def test_a_home_that_is_singular_is_told(family: str) -> None:
    """Where modes meet exactly, no rank decides which is meant; a home next to it is not told of."""
    make, mobility = FAMILIES[family]
    exact = build_robot(make(0.0))
    assert told(exact) or exact.mobility == mobility
    assert not told(build_robot(make(NEAR)))


def test_a_lift_raised_to_its_end_moves_as_one_freedom_does() -> None:
    """Told at a posture far from home, as the oracle does; taken for three freedoms it fell apart."""
    description = FAMILIES["scissors 3"][0](NEAR)
    robot, oracle = build_robot(description), Oracle(description)
    home = np.concatenate([description.home[name] for name in oracle.joint_names])
    q = oracle.close(oracle.integrate(home, 0.1 * oracle.motions(home)[:, 0]))
    v, tau = 0.1 * oracle.motions(q)[:, 0], np.array([-30.0])
    expected = oracle.ddm(q, v, tau)
    assert np.abs(hybridyn.ddm(robot, q, v, tau) - expected).max() < SAME * np.abs(expected).max()
