"""Measurements of any length, reduced to one triangular factor."""

from dataclasses import replace

import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.request import request
from hybridyn.compiled.inertial_columns import InertialNumbers, regressor_program
from hybridyn.compiled.programs.whole_robot import function_of
from hybridyn.identification.long_measurements import triangular_factor
from hybridyn.identification.parameters import standard_parameters
from tests.robots.shipped import shipped, states_near_home


def test_parts_of_any_size_give_the_base_parameters_back() -> None:
    robot = hybridyn.load("rps3")
    q, v, a = states_near_home(shipped("rps3"), "fixed", 1, 12)
    base = hybridyn.base_parameters(robot, effects="model", symmetric=True)
    tau = hybridyn.idm(robot, q, v, a, effects="model")
    parts = [(q[i:j], v[i:j], a[i:j], tau[i:j]) for i, j in ((0, 4), (4, 5), (5, 12))]
    found = triangular_factor(robot, parts, effects="model", symmetric=True, base=base)
    x = np.linalg.solve(found.R, found.z)
    assert np.abs(x - base.values).max() <= 1e-9 * np.abs(base.values).max()
    assert found.rest <= 1e-12 * np.linalg.norm(tau)
    assert found.rows == tau.size


@pytest.mark.parametrize(
    ("name", "symmetric"),
    [
        ("rps3", True),
        ("five_bar", False),
        pytest.param("scara_delta", True, marks=pytest.mark.slow),
        pytest.param("lx4", True, marks=pytest.mark.slow),
    ],
)
def test_the_code_of_the_rows_gives_them(name: str, symmetric: bool) -> None:
    robot = hybridyn.load(name)
    q, v, a = (x[:4] for x in states_near_home(shipped(name), "fixed", 1, 4))
    parameters = standard_parameters(robot, symmetric=symmetric)
    columns = hybridyn.base_parameters(robot, symmetric=symmetric).columns
    places = [*parameters.bodies.items(), *parameters.payloads]
    numbers = InertialNumbers(robot, places, len(parameters.names))
    asked = replace(request(robot, None), arguments=numbers)
    code = function_of(regressor_program(asked, columns))
    wanted = hybridyn.regressor(robot, q, v, a, symmetric=symmetric).Y[..., columns]
    for t, want in enumerate(wanted):
        Y = np.array(code(q[t], v[t], a[t], parameters.values)[1]).reshape(want.shape)
        assert np.abs(Y - want).max() <= 1e-11 * np.abs(wanted).max()


@pytest.mark.slow
def test_compiled_rows_and_threads_give_the_same_factor() -> None:
    robot = hybridyn.load("rps3")
    q, v, a = (np.tile(x, (60, 1)) for x in states_near_home(shipped("rps3"), "fixed", 1, 60))
    tau = hybridyn.idm(robot, q, v, a, effects="model")
    options = {"effects": ["model", "offsets"], "symmetric": True}
    options["base"] = hybridyn.base_parameters(robot, **options)
    found = [
        triangular_factor(robot, [(q, v, a, tau)], compiled=compiled, threads=threads, **options)
        for compiled, threads in ((False, 1), (True, 1), (True, 3))
    ]
    size = np.abs(found[0].R).max()
    for other in found[1:]:
        assert np.abs(np.abs(other.R) - np.abs(found[0].R)).max() <= 1e-10 * size
        assert other.rest <= 1e-9 * size
