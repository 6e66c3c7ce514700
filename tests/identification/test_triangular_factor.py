"""Measurements of any length, reduced to one triangular factor."""

import numpy as np

import hybridyn
from hybridyn.identification.triangular_factor import triangular_factor
from tests.shipped import shipped, states_near_home


def test_parts_of_any_size_give_the_base_parameters_back() -> None:
    robot = hybridyn.load("rps3")
    q, v, a = states_near_home(shipped("rps3"), "fixed", 1, 60)
    base = hybridyn.base_parameters(robot, effects="model", symmetric=True)
    tau = hybridyn.idm(robot, q, v, a, effects="model")
    parts = [(q[i:j], v[i:j], a[i:j], tau[i:j]) for i, j in ((0, 7), (7, 8), (8, 60))]
    found = triangular_factor(robot, parts, effects="model", symmetric=True, base=base)
    x = np.linalg.solve(found.R, found.z)
    assert np.abs(x - base.values).max() <= 1e-9 * np.abs(base.values).max()
    assert found.rest <= 1e-12 * np.linalg.norm(tau)
    assert found.rows == tau.size
