"""Derivatives of both models against differences of the oracle in 113 bits, along random closed motions."""

import mpmath
import numpy as np
import pytest

import hybridyn
from hybridyn.compiled.equations.states import random_states
from tests.compiled.test_derivatives import tangent
from tests.oracle import Extended, Oracle
from tests.support.comparing import close_to

BITS = 113
STEP = 1e-10  # central differences: STEP^2 and 2^-BITS / STEP are far below rounding of doubles
EXACT = 1e-11  # largest difference over the largest rate; 2e-14 is found


@pytest.mark.slow
@pytest.mark.parametrize(("name", "directions"), [("five_bar", 4), ("rps3", 3)])
def test_derivatives_against_differences_in_113_bits(name: str, directions: int) -> None:
    robot = hybridyn.load(name)
    q, v, a, tau = (x[0] for x in random_states(robot, 1))
    idm, ddm = hybridyn.idm_jacobian(robot, q, v, a), hybridyn.ddm_jacobian(robot, q, v, tau)
    E, rng = tangent(robot, q), np.random.default_rng(3)
    with mpmath.workprec(BITS):
        oracle = Oracle(robot.description, robot.base, arithmetic=Extended(mpmath.mp))
        for _ in range(directions):
            moved = [rng.normal(size=len(x)) * np.abs(x).max() for x in (v, v, a, tau)]

            def state(h: float, moved: list[np.ndarray] = moved) -> list[np.ndarray]:
                """Return q, v, a, tau, and the results of both models."""
                dq, dv, da, dtau = (mpmath.mpf(h) * x for x in moved)
                at = oracle.close(oracle.integrate(oracle.close(q), dq))
                rates = oracle.project_velocity(at, v + dv)
                rate = oracle.consistent_acceleration(at, rates, a + da)
                efforts = tau + dtau
                return [
                    at, rates, rate, efforts, oracle.idm(at, rates, rate), oracle.ddm(at, rates, efforts)
                ]  # fmt: skip

            pairs = zip(state(STEP), state(-STEP), strict=True)
            dq, dv, da, dtau, d_efforts, d_rate = (
                np.array((x - y) / (2 * mpmath.mpf(STEP)), float) for x, y in pairs
            )
            along = np.linalg.lstsq(E, dq, rcond=None)[0]
            close_to(idm["q"] @ along + idm["v"] @ dv + idm["a"] @ da, d_efforts, EXACT)
            close_to(ddm["q"] @ along + ddm["v"] @ dv + ddm["tau"] @ dtau, d_rate, EXACT)
