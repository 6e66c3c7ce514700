"""Fitted rates against motions known in closed form, and windows against the whole table."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from hybridyn.tables.opening import Block
from hybridyn.tables.rates import BLOCK, DEGREE, Spline, aligned, angular_rates, derivatives, turns, windows

ROUNDING = 1e-13
STEP = 1e-2
VELOCITY_ERROR = 200 * STEP**5  # order of a quintic spline's first derivative; sixth derivatives are 3^6
ACCELERATION_ERROR = 500 * STEP**4  # order of its second derivative, worst at the ends of the table


@pytest.mark.parametrize("size", [1, 7, 100, 333, 1000])
@pytest.mark.parametrize("halo", [0, 5, 128])
def test_windows_cover_the_table_with_its_neighbours(size: int, halo: int) -> None:
    rows = np.arange(1000.0)[:, None]
    blocks = [Block(start + 1, rows[start : start + size]) for start in range(0, len(rows), size)]
    found = list(windows(blocks, halo))
    assert [window.first_row for window in found] == [block.first_row for block in blocks]
    for window, block in zip(found, blocks, strict=True):
        first, last = block.values[0, 0], block.values[-1, 0]
        assert np.array_equal(window.values[window.core], block.values)
        assert window.values[0, 0] == max(0.0, first - halo)
        assert window.values[-1, 0] == min(999.0, last + halo)


@pytest.mark.parametrize("jitter", [0.0, 0.9])
def test_derivatives_of_sines(jitter: float) -> None:
    time = 1e3 + STEP * (np.arange(400) + jitter * np.random.default_rng(1).uniform(-0.5, 0.5, 400))
    omega = np.array([1.0, 2.0, 3.0])
    values = np.sin(time[:, None] * omega)
    first, second = derivatives(time, values, slice(0, 400))
    worse = 1.0 + 30.0 * jitter  # the largest step nearly doubles, and the order is high
    assert np.abs(first - omega * np.cos(time[:, None] * omega)).max() < VELOCITY_ERROR * worse
    assert np.abs(second + omega**2 * values).max() < ACCELERATION_ERROR * worse


def test_the_halo_is_wide_enough_even_for_noise() -> None:
    generator = np.random.default_rng(2)
    time = np.cumsum(np.where(np.arange(1500) % 2, 1e-5, 1e-3))
    values = generator.normal(size=(1500, 1))
    whole = np.hstack(derivatives(time, values, slice(0, 1500)))
    table = np.column_stack([time, values])
    blocks = [Block(start + 1, table[start : start + 250]) for start in range(0, 1500, 250)]
    pieces = [np.hstack(derivatives(w.values[:, 0], w.values[:, 1:], w.core)) for w in windows(blocks)]
    error = np.abs(np.concatenate(pieces) - whole).max(axis=0) / np.abs(whole).max(axis=0)
    assert error.max() < ROUNDING


def test_angular_rates_of_a_known_motion() -> None:
    """Two turns in series, about fixed z then about body x: omega and its derivative follow by hand."""
    time = STEP * np.arange(300)
    alpha, beta = 0.8 * np.sin(2 * time), 1.2 * np.cos(1.5 * time)
    alpha_dot, beta_dot = 1.6 * np.cos(2 * time), -1.8 * np.sin(1.5 * time)
    alpha_ddot, beta_ddot = -3.2 * np.sin(2 * time), -2.7 * np.cos(1.5 * time)
    x = np.column_stack([np.cos(alpha), np.sin(alpha), np.zeros_like(time)])
    y = np.column_stack([-np.sin(alpha), np.cos(alpha), np.zeros_like(time)])
    z = np.array([0.0, 0.0, 1.0])
    omega = alpha_dot[:, None] * z + beta_dot[:, None] * x
    omega_dot = alpha_ddot[:, None] * z + beta_ddot[:, None] * x + (alpha_dot * beta_dot)[:, None] * y

    turn = Rotation.from_rotvec(alpha[:, None] * z) * Rotation.from_rotvec(beta[:, None] * [1, 0, 0])
    quaternions = turn.as_quat()
    quaternions[::3] *= -1.0  # either sign is the same rotation
    p = aligned(quaternions)
    first, second = derivatives(time, p, slice(0, 300))
    found, found_dot = angular_rates(p, first, second)
    assert np.abs(found - omega).max() < VELOCITY_ERROR
    assert np.abs(found_dot - omega_dot).max() < ACCELERATION_ERROR
    steps = Rotation.from_quat(quaternions[:-1]).inv() * Rotation.from_quat(quaternions[1:])
    assert turns(quaternions) == pytest.approx(steps.magnitude(), abs=1e-7)


def test_angular_rates_do_not_see_the_length_of_the_quaternion() -> None:
    generator = np.random.default_rng(3)
    p, p_dot, p_ddot = generator.normal(size=(3, 20, 4))
    s, s_dot, s_ddot = generator.normal(size=(3, 20, 1))
    scaled = (s * p, s_dot * p + s * p_dot, s_ddot * p + 2 * s_dot * p_dot + s * p_ddot)
    for one, other in zip(angular_rates(p, p_dot, p_ddot), angular_rates(*scaled), strict=True):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-9)  # ill-scaled draws lose a few digits


@pytest.mark.parametrize("rows", [6, 7, 68, 69, 70, 200])
def test_splines_are_those_of_scipy(rows: int) -> None:
    generator = np.random.default_rng(rows)
    time = np.cumsum(generator.uniform(0.1, 1.0, rows))
    values = generator.normal(size=(rows, 3))
    between = np.sort(np.concatenate([time, generator.uniform(time[0], time[-1], 20)]))
    wanted = make_interp_spline(time, values, k=DEGREE)
    for first_row in (0, 1, BLOCK - 1):
        found = Spline(time, values, first_row)
        for order in range(DEGREE):
            derivative = wanted.derivative(order)(between) if order else wanted(between)
            error = np.abs(found(between, order) - derivative).max()
            assert error < ROUNDING * np.abs(derivative).max()


def test_times_without_a_spline_are_refused() -> None:
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="too close together"):
        Spline(np.array([0.0, 1e-320, 2e-320, 3e-320, 4e-320, 5e-320, 1.0]), np.zeros((7, 1)))
