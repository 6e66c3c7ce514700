"""Identification of every shipped robot and of a random mechanism of every kind."""

import numpy as np
import pytest

import hybridyn
from hybridyn.identification.base_parameters import random_motions
from hybridyn.identification.identify import estimate
from hybridyn.identification.parameters import with_parameters
from tests.identification.robots import base_of, cases, described, effects_of, other_values, robot_of
from tests.mechanisms import KINDS, random_states

#: Base parameters without noise, of the largest.
EXACT = 1e-9
#: Rounding over the condition of the regressor: above `EXACT` for one mechanism only, of condition 2e7.
ROUNDED = np.finfo(float).eps
#: Few motors: their efforts can be those of random states only for the file's numbers.
FEW = {kind for kind, recipe in KINDS.items() if recipe.motors == "few"}


@pytest.mark.parametrize(("kind", "seed"), cases())
def test_base_parameters_come_back(kind: str, seed: int) -> None:
    """From efforts at random states; where motors drive all motions, the bodies differ from the file's."""
    robot, base, effects = robot_of(kind, seed), base_of(kind, seed), effects_of(seed)
    count = 20 + 3 * base.rank // len(robot.motors)
    if seed >= 0 and kind in FEW:
        values, (q, v, a) = base.standard.values, random_states(described(kind, seed), "fixed", seed, count)
    else:
        values, (q, v, a) = other_values(base, seed), random_motions(robot, count)
    tau = hybridyn.idm(with_parameters(robot, values, effects=effects), q, v, a, effects=effects)
    Y = hybridyn.regressor(robot, q, v, a, effects=effects).Y[:, :, base.columns]
    found, wanted = estimate(Y, tau, base.names), base.combination @ values
    bound = max(EXACT, ROUNDED * found.condition)
    assert np.abs(found.x - wanted).max() <= bound * np.abs(wanted).max()
